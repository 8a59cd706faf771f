"""Bodies as they come and go: the only place of pydantic, and of millimetres, rev/min and MPa in the service."""
