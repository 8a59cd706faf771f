"""Waves along a cutting edge, as roughers have: a tooth's radial offset over its height."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.shown import Shown


class WaveShape(StrEnum):
    """How an edge waves; `table` by an offset of its own."""

    SINE = "sine"
    CIRCULAR = "circular"
    TRAPEZOID = "trapezoid"
    TABLE = "table"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Serration(Shown):
    """A wave along each tooth's edge.

    `amplitude` [m]: from the middle to a crest
    `wavelength` [m]: along the axis
    `shape`: WaveShape or its name, default sine; arcs of circles that meet in the middle, or flats of a quarter of the wavelength with
        flanks as long between them
    `shift` [-], shape (teeth,): by which share of the wavelength each tooth's wave is moved towards the tip; None moves tooth j by j over
        their number
    `table` [-], shape (n,): offset over the amplitude at n equal steps of a wavelength, for the shape `table`; straight lines between them

    Examples
    --------
    >>> wave = Serration(amplitude=0.25e-3, wavelength=1.5e-3)
    >>> offset, slope = wave.at(np.array([0.375e-3]), 0.0)
    >>> round(1e3 * float(offset[0]), 6), round(float(slope[0]), 6)
    (0.25, 0.0)
    """

    amplitude: float
    wavelength: float
    shape: WaveShape = WaveShape.SINE
    shift: FloatArray | None = None
    table: FloatArray | None = None

    def __post_init__(self) -> None:
        positive("serration amplitude", self.amplitude, "m")
        positive("serration wavelength", self.wavelength, "m")
        if self.amplitude > self.wavelength:
            found = f"amplitude {1e3 * self.amplitude:g} mm of waves {1e3 * self.wavelength:g} mm long"
            raise InputError("serration", found, "an amplitude below the wavelength")
        if self.shape not in tuple(WaveShape):
            raise InputError("serration shape", self.shape, f"one of {', '.join(WaveShape)}")
        object.__setattr__(self, "shape", WaveShape(self.shape))
        if self.shape is WaveShape.CIRCULAR and self.amplitude > 0.25 * self.wavelength:
            raise InputError("serration amplitude", self.amplitude, "at most a quarter of the wavelength, where arcs are half circles [m]")
        if (self.table is not None) != (self.shape is WaveShape.TABLE):
            raise InputError(
                "serration table", "given" if self.table is not None else "nothing", "offsets for the shape table, and no other"
            )
        for name in ("shift", "table"):
            given = getattr(self, name)
            if given is not None:
                object.__setattr__(self, name, frozen(given))
                if getattr(self, name).ndim != 1 or not np.all(np.isfinite(getattr(self, name))):
                    raise InputError(f"serration {name}", given, "a list of finite numbers")

    def shifts(self, teeth: int) -> FloatArray:
        """Return by which share of the wavelength each tooth's wave is moved, shape (teeth,)."""
        return np.arange(teeth) / teeth if self.shift is None else self.shift

    def at(self, z: FloatArray, shift: float) -> tuple[FloatArray, FloatArray]:
        """Return offset [m] and its slope over the height [-] at heights z [m] of an edge whose wave is moved by a share of its length."""
        turn = np.mod(z / self.wavelength + shift, 1.0)
        if self.shape is WaveShape.SINE:
            angle = 2.0 * np.pi * turn
            return self.amplitude * np.sin(angle), 2.0 * np.pi * self.amplitude / self.wavelength * np.cos(angle)
        if self.shape is WaveShape.CIRCULAR:
            quarter = 0.25 * self.wavelength
            radius = 0.5 * (quarter**2 + self.amplitude**2) / self.amplitude
            sign = np.where(turn < 0.5, 1.0, -1.0)
            along = np.mod(turn, 0.5) * self.wavelength - quarter
            root = np.sqrt(np.maximum(radius**2 - along**2, 1e-6 * radius**2))
            return sign * (self.amplitude - radius + root), -sign * along / root
        if self.table is not None:
            size = self.table.size
            corner, values = np.arange(size + 1) / size, np.append(self.table, self.table[0])
        else:
            corner, values = np.array([0.0, 0.125, 0.375, 0.625, 0.875, 1.0]), np.array([0.0, 1.0, 1.0, -1.0, -1.0, 0.0])
        place = np.minimum(np.searchsorted(corner, turn, side="right") - 1, corner.size - 2)
        slope = np.diff(values) / np.diff(corner)
        offset = values[place] + slope[place] * (turn - corner[place])
        return self.amplitude * offset, self.amplitude / self.wavelength * slope[place]

    def __str__(self) -> str:
        return f"{self.shape} serration of {1e3 * self.amplitude:.3g} mm, {1e3 * self.wavelength:.3g} mm long"
