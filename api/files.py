"""Files of uploads: written once, named by what they hold, never by a client."""
