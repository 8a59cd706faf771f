"""Identification of a robot from cuts at several postures: its springs and dampers, and the spindle in its hand, as one machine."""
