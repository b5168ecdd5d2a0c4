"""Where a valve loses or regains stability along one parameter."""
