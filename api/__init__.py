"""The web service's package, beside the physics that it will serve."""
