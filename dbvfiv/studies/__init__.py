"""What can be asked of a valve: each study takes a model and options and returns a result object."""
