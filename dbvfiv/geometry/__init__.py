"""The valve's mid-surface: sections, surfaces between them, and the graded mesh on it."""
