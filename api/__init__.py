"""The web service's package, beside the physics that it serves."""

#: Others call a package `api`, too: whoever looks for this one asks whose it is.
DISTRIBUTION = "rcsa-ident"
