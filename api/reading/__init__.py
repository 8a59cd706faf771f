"""Uploads are read in a process of their own with limits; what it cannot read costs nothing else."""
