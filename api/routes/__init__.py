"""Thin: a question in, what the parts answer out."""
