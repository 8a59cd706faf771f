"""What every identification method offers: one verb, whose long work goes as tasks through the map that it is given."""

from __future__ import annotations

from typing import Protocol

from rcsa_ident.base.scaleout import Map
from rcsa_ident.identification.data import IdentificationData
from rcsa_ident.identification.progress import Progress
from rcsa_ident.identification.result import Identification


class Method(Protocol):
    """An identification method: an object that carries its settings."""

    def run(self, data: IdentificationData, seed: int, map: Map = map, progress: Progress | None = None) -> Identification:
        """Return modes and joint.

        Parameters
        ----------
        data : IdentificationData
        seed : int
            Same seed, same answer, whatever `map` is.
        map : callable
            The builtin, or a pool's: it is called with `perform` and the tasks of one phase.
        progress : callable, optional
            Told of every step; with a pool's map it has to be picklable.
        """
        ...
