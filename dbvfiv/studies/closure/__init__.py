"""Back pressure: whether, where and how firmly the valve shuts, and how far its wall is from buckling."""
