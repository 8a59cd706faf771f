"""How deep a cut may be: stability lobes."""
