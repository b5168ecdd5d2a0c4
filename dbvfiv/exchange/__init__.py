"""A computed state for other programs: faces of the wall and the fluid inside as surfaces and bodies, STL and STEP."""
