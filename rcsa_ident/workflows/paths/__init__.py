"""A tool along a path: one use case a file."""
