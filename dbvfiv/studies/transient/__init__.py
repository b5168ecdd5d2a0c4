"""A time history of the coupled valve and its verdict."""
