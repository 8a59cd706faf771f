"""Loops of the methods, arrays and scalars alone."""
