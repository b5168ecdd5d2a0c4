"""Style and output of figures, and views of the valve that several studies share."""
