"""Claims with their figures: ours beside a named peer, both in one run."""
