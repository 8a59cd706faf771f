"""One use case a file: from files to files, with the rooms below doing the work."""
