"""Substructure B: what stands behind the flange."""
