"""demo (in progress)."""


def demo() -> None:
    """The whole chain on the sample runs."""
    raise SystemExit(1)
