"""What clients follow while it happens: streams of forces, and jobs."""
