"""A tooling from the sound of its free ring-down."""
