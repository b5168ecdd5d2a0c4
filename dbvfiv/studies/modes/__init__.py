"""Leading modes of one steady state, and whether it is stable."""
