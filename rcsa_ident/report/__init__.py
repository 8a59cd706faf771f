"""Plots and pages from results; nothing in here computes or reads files."""
