"""Uploads are read in a process of their own with limits; what it can not read costs nothing else."""
