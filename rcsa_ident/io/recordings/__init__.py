"""Recordings of any format, and what their files say of themselves."""
