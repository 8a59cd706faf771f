"""Routes: a request in, what the components answer out."""
