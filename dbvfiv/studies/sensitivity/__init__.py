"""How the leading mode answers to every parameter of a valve."""
