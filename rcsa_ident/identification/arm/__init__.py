"""Identification of a robot: its joints from motion and load, and from cuts at several postures, with the spindle in its hand."""
