"""Durable jobs: accepted is kept, killed is resumed, the same seed gives the same answer."""
