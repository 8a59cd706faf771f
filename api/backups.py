"""Backup and restore of the embedded store, while the service runs."""
