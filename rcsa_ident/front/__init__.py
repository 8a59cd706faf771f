"""The front door: what a script asks, how nouns are drawn and saved, and the processes that help."""
