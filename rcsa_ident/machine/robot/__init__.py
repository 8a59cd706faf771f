"""A robot behind the flange: a machine with a posture."""
