"""Loops of the search, arrays and scalars alone."""
