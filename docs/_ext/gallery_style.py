"""The look of the gallery's figures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

STYLE = Path(__file__).resolve().parents[1] / "examples" / "gallery.mplstyle"


def drawn_in_the_gallerys_style(_gallery: dict[str, Any], _example: str) -> None:
    """Set it before each example, after what matplotlib was set to has been taken back."""
    import matplotlib.pyplot as plt

    plt.style.use(STYLE)
