"""Which channel of a dynamometer shows which force on the tool: every assignment of axes and signs, tried on the cuts themselves.

Mean forces alone tie: turned axes exchange K_tc and K_rc. The force over time alone ties, too: a slot cut by two teeth looks the
same from four sides. Together they leave one: a cutting force has K_tc above K_rc, which is hardly below zero, and pulls along the
axis as it should; and its waveform with just these coefficients is the one that was recorded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.calibration import ForceCalibration, calibrate_mean_force
from rcsa_ident.cutting.force_record import ForceRecord

#: K_rc over K_tc of cutting metal: 0.1 to 0.7 in published tables, about 0 with sharp positive rake, its error beside.
RATIOS = (-0.1, 1.0)
#: Share of the force over time that a choice may leave; a dynamometer that rings at a line of the teeth leaves up to two thirds.
MOST_UNEXPLAINED = 0.7
#: A second choice that explains nearly as much of the force over time: its unexplained share over the best one's.
CLEAR = 1.25


@dataclass(frozen=True, slots=True, eq=False)
class AxesChoice:
    """One assignment of a dynamometer's channels to the axes of the force on the tool.

    `axes`, shape (c, c): channels (told as X, Y and, where there is one, Z) over the force on the tool: a signed permutation
    `forces`: what the mean forces say then
    `unexplained`: share of the force over time that the same coefficients leave, each cut's tooth angle free
    """

    axes: FloatArray
    forces: ForceCalibration
    unexplained: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "axes", frozen(self.axes))

    @property
    def as_told(self) -> bool:
        """Whether every channel shows the axis that it is told to show."""
        return bool(np.array_equal(self.axes, np.eye(self.axes.shape[0])))

    def shown(self) -> tuple[str, ...]:
        """Return the axis that each channel shows, with its sign, such as ``+Y``."""
        found = [int(np.argmax(np.abs(row))) for row in self.axes]
        return tuple(f"{'-' if row[i] < 0 else '+'}{'XYZ'[i]}" for row, i in zip(self.axes, found, strict=True))


def axes_choices(records: Sequence[ForceRecord]) -> tuple[AxesChoice, ...]:
    """Return all assignments of axes and signs that cutting coefficients allow, the one that explains most of the force first.

    `records`: sequence of ForceRecord, length n; three at least, at two different feeds; two channels (8 choices) or three (48)
    Raises `InputError`: no choice is physical, or the cuts tell no coefficients at all.
    """
    count = min(r.lines.shape[1] for r in records)
    whole = [r if r.lines.shape[1] == count else r.transverse for r in records]
    tried = []
    for order, signs in product(permutations(range(count)), product((1.0, -1.0), repeat=count)):
        axes = np.array(signs)[:, None] * np.eye(count)[list(order)]
        mean = np.array([r.mean @ axes for r in whole])
        tried.append((axes, calibrate_mean_force([(r.cutter, r.conditions) for r in whole], mean)))
    physical = [AxesChoice(axes, forces, _unexplained(whole, axes, forces)) for axes, forces in tried if _physical(forces)]
    physical.sort(key=lambda choice: choice.unexplained)
    if physical and physical[0].unexplained > MOST_UNEXPLAINED:
        raise InputError(
            "axes of the force sensors",
            f"{100.0 * physical[0].unexplained:.0f} % of the force over time unexplained by the best of {len(tried)} choices",
            f"at most {100.0 * MOST_UNEXPLAINED:.0f} %: are teeth, helix, depth and immersion as told?",
        )
    if not physical:
        nearest = max((forces for _, forces in tried), key=lambda forces: forces.of("K_tc")[0])
        tangential, radial = (1e-6 * nearest.of(name)[0] for name in ("K_tc", "K_rc"))
        raise InputError(
            "axes of the force sensors",
            f"no physical choice among {len(tried)} (the largest K_tc is {tangential:.0f} MPa, with K_rc {radial:.0f} MPa)",
            "forces of the cuts that the campaign describes: are feeds, depth, immersion, feed direction and teeth as told?",
        )
    return tuple(physical)


def _physical(forces: ForceCalibration) -> bool:
    """Whether a cutting force can have these coefficients."""
    tangential, radial, axial = (forces.of(name)[0] for name in ("K_tc", "K_rc", "K_ac"))
    low, high = RATIOS
    return tangential > 0.0 and low * tangential <= radial <= high * tangential and axial >= 0.0


def _unexplained(records: Sequence[ForceRecord], axes: FloatArray, forces: ForceCalibration) -> float:
    """Share of the force over time that the coefficients of the mean forces leave."""
    known = np.array([forces.of(name)[0] for name in ("K_tc", "K_rc", "K_te", "K_re")])
    left = [r.seen_through(axes).tooth_angle(known)[1] for r in records]
    return float(np.sqrt(np.mean(np.square(left))))
