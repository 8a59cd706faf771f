"""What the identification is given: the cuts' lines beside the tool-holders' receptances, as flat arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rcsa_ident.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.errors import InputError
from rcsa_ident.signals.measurement import CutMeasurement

#: Slopes are multiplied and moments divided by it, so that all receptances have one unit and size [m].
LEVER = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class AxisData:
    """Lines of one axis, sorted by cut.

    Parameters
    ----------
    omega, order, variance : arrays, shape (n,)
        [rad/s], [-], [m^2/N^2] of the real and imaginary part each.
    lines : complex array, shape (n, 2) [m/N]
        Cut and turned air cut over the simulated force.
    cut : array of int, shape (n,)
        Index into the data's cuts.
    flange : complex array, shape (n, 3) [m/N]
        A22 of the cut's tooling: tt, tr, rr, scaled by the lever.
    tip : complex array, shape (n, 2) [m/N]
        A21 for a force at the tip: t, r.
    """

    axis: Dof
    omega: FloatArray
    order: FloatArray
    variance: FloatArray
    lines: ComplexArray
    cut: np.ndarray
    flange: ComplexArray
    tip: ComplexArray

    def __post_init__(self) -> None:
        for name in ("omega", "order", "variance"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        for name in ("lines", "flange", "tip"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.complex128))

    @property
    def measured(self) -> ComplexArray:
        """Cut less air cut, shape (n,) [m/N]."""
        return self.lines[:, 0] - self.lines[:, 1]


@dataclass(frozen=True, slots=True, eq=False)
class IdentificationData:
    """All cuts of a campaign.

    Parameters
    ----------
    cut_ids : tuple of str, length k
    cut_tooling : array of int, shape (k,)
    toolings : tuple of str
    axes : tuple of AxisData
    spindle_speed : array, shape (k,) [rad/s]
    cut_prior : array, shape (k, 4)
        Delay's mean [s] and weight [1/s^2] (0 without a trigger), weight of the angle between cut and air cut [1/rad^2],
        tooth-passing period [s].
    """

    cut_ids: tuple[str, ...]
    cut_tooling: np.ndarray
    toolings: tuple[str, ...]
    axes: tuple[AxisData, ...]
    spindle_speed: FloatArray
    cut_prior: FloatArray

    def only(self, axis: Dof) -> IdentificationData:
        """Return the same data with one axis."""
        return IdentificationData(
            self.cut_ids, self.cut_tooling, self.toolings, tuple(a for a in self.axes if a.axis is axis), self.spindle_speed, self.cut_prior
        )


def prepare(
    measurements: Sequence[CutMeasurement],
    receptances: Mapping[str, Callable[[FloatArray], Receptance]],
    teeth: Mapping[str, int],
) -> IdentificationData:
    """Return the data of all measurements; each tool-holder is asked once for the frequencies of all its cuts.

    Parameters
    ----------
    measurements : sequence of CutMeasurement
    receptances : mapping of tooling to a function omega -> Receptance
        Free-free receptances with points ``tip`` and ``flange`` in one bending plane.
    teeth : mapping of tooling to its number of teeth

    Raises
    ------
    InputError
        If there are no measurements.
    """
    if not measurements:
        raise InputError("cuts", "none usable", "at least one usable cut")
    toolings = tuple(dict.fromkeys(m.tooling for m in measurements))
    axes = tuple(axis for axis in (Dof.X, Dof.Y) if any(axis in m.axes for m in measurements))
    holder: dict[str, dict[float, int]] = {}
    table: dict[str, tuple[ComplexArray, ComplexArray]] = {}
    for name in toolings:
        omega = np.unique(np.concatenate([m.axes[a].omega for m in measurements if m.tooling == name for a in m.axes]))
        response = receptances[name](omega)
        a22, a21 = response["flange", "flange"], response["flange", "tip"]
        flange = np.stack([a22[:, 0, 0], LEVER * a22[:, 0, 1], LEVER**2 * a22[:, 1, 1]], axis=1)
        table[name] = flange, np.stack([a21[:, 0, 0], LEVER * a21[:, 1, 0]], axis=1)
        holder[name] = {float(w): i for i, w in enumerate(omega)}
    data = []
    for axis in axes:
        present = [(k, m) for k, m in enumerate(measurements) if axis in m.axes]
        rows = [[holder[m.tooling][float(w)] for w in m.axes[axis].omega] for _, m in present]
        data.append(
            AxisData(
                axis=axis,
                omega=np.concatenate([m.axes[axis].omega for _, m in present]),
                order=np.concatenate([m.axes[axis].order for _, m in present]).astype(float),
                variance=np.concatenate([m.axes[axis].variance for _, m in present]),
                lines=np.concatenate([np.stack([m.axes[axis].cut, m.axes[axis].air], axis=1) for _, m in present]),
                cut=np.concatenate([np.full(m.axes[axis].omega.size, k) for k, m in present]),
                flange=np.concatenate([table[m.tooling][0][r] for (_, m), r in zip(present, rows, strict=True)]),
                tip=np.concatenate([table[m.tooling][1][r] for (_, m), r in zip(present, rows, strict=True)]),
            )
        )
    speed = np.array([m.spindle_speed for m in measurements])
    prior = np.zeros((len(measurements), 4))
    for k, m in enumerate(measurements):
        if m.delay is not None and m.delay_std is not None:
            prior[k, :2] = m.delay, 1.0 / m.delay_std**2
        prior[k, 2] = 1.0 / max(m.alignment_std, 1e-4) ** 2
        prior[k, 3] = 2.0 * np.pi / speed[k] / teeth[m.tooling]
    index = np.array([toolings.index(m.tooling) for m in measurements])
    return IdentificationData(tuple(m.cut_id for m in measurements), index, toolings, tuple(data), frozen(speed), frozen(prior))
