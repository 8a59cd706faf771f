"""Tips that were tapped, as texts in the place of a machine's."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.passivity import Correction
from rcsa_ident.io.curves.frf_files import Source, read_tapped_tip
from rcsa_ident.machine.known_tip import KnownTip

#: A tip as text begins so: neither RESULT.json nor a robot at a posture does.
_TAPPED = '{"tapped_tip": '


def tapped_text(keys: Mapping[str, Any]) -> str:
    """Return FRFs of a tip, as the keys of a query tell them, as the text of a machine."""
    return json.dumps({"tapped_tip": keys})


def is_tapped(text: str) -> bool:
    """Return whether a machine's text is a tip that was tapped."""
    return text.startswith(_TAPPED)


def tapped(text: str) -> KnownTip:
    """Return the tip of a text; errors name which FRF is at fault, and its line."""
    told = json.loads(text)["tapped_tip"]
    with tempfile.TemporaryDirectory(prefix="rcsa-ident-") as folder:
        places = {str(Path(folder) / str(k)): f"tip.frf[{k}]" for k in range(len(told["frf"]))}
        sources = []
        for path, each in zip(map(Path, places), told["frf"], strict=True):
            path.write_bytes(each["text"].encode())
            axes = each["axes"]
            sources.append(Source(path, None if axes is None else (axes[0], axes[-1]), each["record"], Correction(each["correction"])))
        try:
            return KnownTip(read_tapped_tip(sources, told["units"], told["from_hz"]))
        except InputError as error:
            # the client knows its FRFs by their number, not by a file of the service
            where = next((error.where.replace(path, name) for path, name in places.items() if path in error.where), "tip.frf")
            raise InputError(f"{where}: {error.field}", error.found, error.allowed) from None
