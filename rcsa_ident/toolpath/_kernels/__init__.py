"""Loops of removal and of the march along a path, arrays and scalars alone."""
