"""A tool along a path."""
