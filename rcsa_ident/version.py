"""The release, on the lowest floor: the package itself is the front door and knows everything."""

__version__ = "0.2.0"
