"""What one recording says of the cutting force: its lines, turned into other axes, and where tooth 1 stood."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import unit_lines

#: Angles of tooth 1 that are tried, a tooth's pitch.
ANGLES = 72
#: Lines of the teeth in which it is looked for.
HARMONICS = 3


@dataclass(frozen=True, slots=True, eq=False)
class ForceRecord:
    """The lines of one cut's force, F = Re sum_m lines[m] e^{i m angle}, by least squares over its time series.

    `conditions`: the cut as programmed, with the spindle speed that was found in the record
    `clamping`: records of one clamping share the run-out
    `lines` [N], shape (m + 1, c): orders 0 to m; X and Y and, where it is measured, along the axis. Sensors with a known response are
        undone.
    `variance` [N^2], shape (m + 1, c): variance of the real and of the imaginary part each, noise only
    `blocks` [N], shape (b, m + 1, c): what each block of whole revolutions says more or less than all of them: their mean is near zero
    """

    cutter: Cutter
    conditions: CuttingConditions
    clamping: str
    lines: ComplexArray
    variance: FloatArray
    blocks: ComplexArray

    def __post_init__(self) -> None:
        for name, dtype in (("lines", complex), ("variance", float), ("blocks", complex)):
            object.__setattr__(self, name, frozen(getattr(self, name), dtype))
        if self.lines.shape != self.variance.shape or self.blocks.shape[1:] != self.lines.shape:
            raise InputError(
                "force lines", f"{self.lines.shape}, {self.variance.shape}, {self.blocks.shape}", "shapes that belong together"
            )

    @property
    def mean(self) -> FloatArray:
        """Mean force over whole revolutions, shape (c,) [N]."""
        return self.lines[0].real

    @property
    def transverse(self) -> ForceRecord:
        """X and Y alone."""
        return replace(self, lines=self.lines[:, :2], variance=self.variance[:, :2], blocks=self.blocks[:, :, :2])

    @property
    def own_orders(self) -> np.ndarray:
        """Orders at which the teeth have a force without any run-out."""
        return np.arange(0, self.lines.shape[0], self.cutter.teeth if self.cutter.equally_spaced else 1)

    def seen_through(self, axes: FloatArray) -> ForceRecord:
        """Return the record of the force on the tool where the channels show `axes` times it, a signed permutation, shape (c, c)."""
        return replace(self, lines=self.lines @ axes, variance=self.variance @ np.abs(axes), blocks=self.blocks @ axes)

    def tooth_angle(self, coefficients: FloatArray) -> tuple[float, float]:
        """Return the immersion of tooth 1 at the start [rad] that fits known coefficients best, and the share of the force left then [-].

        The share is that of the first lines: the mean force says nothing of an angle, and high up dynamometers ring.

        `coefficients` [N/m^2 or N/m], shape (4,): K_tc, K_rc, K_te, K_re; of a leaning edge the radial ones stand for the axial ones as
            well
        """
        orders = self.own_orders[1:]
        orders = orders[orders <= HARMONICS * self.cutter.teeth]
        model = unit_lines(self.cutter, self.conditions, orders)[:, :, :4] @ coefficients
        target = self.lines[orders, :2]
        reach = 2.0 * np.pi / (self.cutter.teeth if self.cutter.equally_spaced else 1)
        angles = np.linspace(0.0, reach, ANGLES * (1 if self.cutter.equally_spaced else self.cutter.teeth), endpoint=False)
        agreement = (np.exp(1j * np.outer(angles, orders)) @ np.sum(model * target.conj(), axis=1)).real
        best = int(np.argmax(agreement))
        size = float(np.sum(np.abs(target) ** 2))
        left = size + float(np.sum(np.abs(model) ** 2)) - 2.0 * float(agreement[best])
        return float(angles[best]), float(np.sqrt(max(left, 0.0) / size)) if size > 0.0 else 1.0
