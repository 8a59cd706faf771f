"""One use case a file: from nouns to nouns, with the rooms below doing the work. Files are read and written by `io`."""
