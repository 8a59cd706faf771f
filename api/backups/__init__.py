"""Backup and restore of the embedded store, while the service runs.

A backup is a plain tar: the database, the durable engine's, the files that rows refer to, and last a manifest with every digest. It gets
its name when it is whole and on the disk. A restored folder gets its name when every digest is right.
"""
