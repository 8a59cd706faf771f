"""The tip of one tooling, measured or written down as modes: in the place of a machine, for that tooling alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.units import from_hz, to_hz
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.receptance import Receptance, assumed_of
from rcsa_ident.dynamics.uncertain import UncertainReceptance
from rcsa_ident.machine.machine import STIFFNESS_SPREAD, TipSource
from rcsa_ident.setup.cut import Workpiece
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.stability.lobes import uncoupled_planes
from rcsa_ident.stability.tip_modes import TIP, TipModes
from rcsa_ident.tool_holder.geometry import ToolAssembly

#: Share of the highest frequency from which on a receptance is at its end.
_END = 0.97
#: Damping ratio of a tool's own mode, and share of the flexibility below from which on one above the end is told.
_USUAL_DAMPING, _CRITICAL = 0.03, 0.7
#: Share of the largest accelerance at which the first mode begins; lines that have to lie below it, and how many of them are the first;
#: share of the modes' most negative real part above which another one matters.
_STANDS_OUT, _FEWEST, _FIRST, _MATTERS = 0.02, 10, 3, 0.1


@dataclass(frozen=True, eq=False, repr=False)
class KnownTip(TipSource):
    """The tip of one tooling, from tap tests or from a modal model; whatever tooling is named, it answers for that one.

    Parameters
    ----------
    known : Receptance or TipModes
        Over ``tip.x`` and ``tip.y``.
    coefficients : CuttingCoefficients or None
        Of what is cut, where the modes' file tells them.

    Examples
    --------
    A mode of the tip, as a tap test shows it, is a machine for one tooling:

    >>> import rcsa_ident as ri
    >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
    >>> machine = ri.KnownTip(ri.TipModes.of({ri.Dof.Y: mode}))
    >>> cut = ri.CutSpec(coefficients={"tangential": 7e8, "radial_ratio": 0.3})
    >>> print(ri.advise(machine, ri.sample_tooling("S1-ER32"), cut, ri.rpm(4000, 12_000, 100)))
    S1-ER32: 12000 rev/min: stability limit 1.66 mm, recommended 1.43 mm
    """

    known: Receptance | TipModes
    coefficients: CuttingCoefficients | None = None

    @property
    def workpiece(self) -> Workpiece | None:
        """What the coefficients are of, where they are known."""
        return None if self.coefficients is None else Workpiece("of the modes' file", self.coefficients)

    @property
    def band(self) -> None:
        """A tip that was measured says itself where it ends."""
        return

    @property
    def ends(self) -> bool:
        """True where it was measured."""
        return not isinstance(self.known, TipModes)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the files' readers assumed, and where a measured tip's ends may be the limit: it still gives way at the upper one as below
        a mode, or the lower one is drift."""
        if isinstance(self.known, TipModes):
            return self.known.remarks
        said = self.known.assumed if isinstance(self.known, MeasuredTip) else ()
        drifts = tuple(
            f"the receptance in {row.dof.upper()} falls from its first line on and is negative up to {to_hz(drift):.0f} Hz, which is how "
            "an accelerometer's drift looks, not a structure: limits there are the sensor's; leave these lines out"
            for row, drift in zip(self.known.rows, _drifts(self.known), strict=True)
            if drift > 0.0
        )
        ends = (
            f"the receptance in {row.dof.upper()} ends at {to_hz(self.known.omega[-1]):.0f} Hz with a real part of {1e6 * end:.3g} µm/N, "
            "as below a mode: true limits may be lower, which a measurement up to higher frequencies would tell"
            for row, end in zip(self.known.rows, _ends(self.known), strict=True)
            if end > 0.0
        )
        return (*said, *drifts, *ends)

    def lines(self, beyond: float = 1.0) -> FloatArray:
        """Return the frequencies at which it was measured, or those that resolve its modes."""
        del beyond
        return (self.known.receptance() if isinstance(self.known, TipModes) else self.known).omega

    def tip(
        self,
        tooling: Tooling | ToolAssembly,
        omega: FloatArray | None = None,
        spread: bool = True,
        stiffness_spread: float = STIFFNESS_SPREAD,
        directions: Sequence[Coordinate] = TIP,
    ) -> UncertainReceptance | TipModes:
        """Return the tip as it is known, whatever tooling is named.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
        >>> machine = ri.KnownTip(ri.TipModes.of({ri.Dof.Y: mode}))
        >>> print(machine.tip(ri.sample_tooling("S1-ER32"), ri.hz(500.0, 2000.0, 1.0)))
        tip: 1 mode at 900 Hz
        """
        del tooling, omega, spread, stiffness_spread, directions
        if isinstance(self.known, TipModes):
            return self.known
        return UncertainReceptance(self.known.omega, self.known.values, self.known.rows, self.known.cols)

    def __str__(self) -> str:
        return f"of one tooling: {self.known}"


def _ends(tip: Receptance) -> FloatArray:
    """Real part at the upper end along X and Y [m/N], 0 where it cannot matter.

    Modes below the end are negative there, so that at least so much comes from modes above. Half of that is left at rest of a mode that
    lies at 1.4 times the end, and its real part sinks to that over 4 times its damping ratio below zero.
    """
    real = np.einsum("nii->ni", tip.values).real
    end = np.median(real[tip.omega >= _END * tip.omega[-1]], axis=0)
    matters = 0.5 * end / (4.0 * _USUAL_DAMPING) >= _CRITICAL * -np.minimum(real.min(axis=0), 0.0)
    return np.where(matters & (end > 0.0), end, 0.0)


def _drifts(tip: Receptance) -> FloatArray:
    """Frequency [rad/s] of X and Y up to which a receptance is what an accelerometer's drift leaves, 0 where that cannot matter.

    Below its first mode a structure is a spring: its receptance is positive and rises with frequency. Drift over the square of the
    frequency is largest at the first lines. What counts as the first mode stands out of the accelerance, in which drift is flat.
    """
    found = np.zeros(len(tip.rows))
    for k, values in enumerate(np.einsum("nii->in", tip.values)):
        accelerance = tip.omega**2 * np.abs(values)
        first = int(np.argmax(accelerance >= _STANDS_OUT * accelerance.max()))
        below = values[:first]
        if below.size < _FEWEST or np.argmax(np.abs(below)) >= _FIRST:
            continue
        negative = np.flatnonzero(below.real < _MATTERS * min(values[first:].real.min(), 0.0))
        if negative.size:
            found[k] = tip.omega[negative[-1]]
    return found


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class MeasuredTip(Receptance):
    """A tip's receptance from files, and what their readers assumed. `omega`, `values`, `rows`, `cols`: as of a `Receptance`."""

    assumed: tuple[Remark, ...] = ()

    def __str__(self) -> str:
        # a class with slots has no argument-free super()
        return "; ".join([Receptance.__str__(self), *self.assumed])


def measured_tip(
    curves: Mapping[Dof, tuple[FloatArray, ComplexArray]], cross: Mapping[tuple[Dof, Dof], tuple[FloatArray, ComplexArray]] | None = None
) -> MeasuredTip:
    """Return the tip's receptance of measured FRFs, over X and Y, and over Z where it is there.

    `curves`: mapping of Dof to (frequency [Hz], values [m/N]); a direction that is missing is rigid
    `cross`: mapping of (response, force) to (frequency [Hz], values [m/N]); of two directions that are both there; one of the two stands
        for the other, too, as Maxwell's reciprocity has it
    """
    planes = {}
    for axis, (frequency, values) in curves.items():
        tip = (Coordinate("tip", axis),)
        planes[axis] = Receptance(from_hz(frequency), np.asarray(values)[:, None, None], tip, tip)
    both, said = _with_axial(planes), assumed_of([*curves.values(), *(cross or {}).values()])
    if not cross:
        return MeasuredTip(both.omega, both.values, both.rows, both.cols, said)
    missing = [axis for axis in dict.fromkeys([Dof.X, Dof.Y, *(axis for pair in cross for axis in pair)]) if axis not in planes]
    if missing:
        raise InputError("cross FRF", f"one without an FRF in {missing[0].upper()}", "FRFs in both directions beside it")
    full = both.values.copy()
    places = {Dof.X: 0, Dof.Y: 1, Dof.Z: 2}
    for (response, force), (frequency, values) in cross.items():
        if not np.array_equal(from_hz(frequency), both.omega):
            raise InputError("cross FRF", f"{np.size(frequency)} frequencies", f"the {both.omega.size} frequencies of the direct FRFs")
        full[:, places[response], places[force]] = values
        if (force, response) not in cross:
            full[:, places[force], places[response]] = values
    return MeasuredTip(both.omega, full, both.rows, both.cols, said)


def _with_axial(planes: Mapping[Dof, Receptance]) -> Receptance:
    """X and Y, rigid where they are missing, and Z behind them where it is there."""
    axial = planes.get(Dof.Z)
    if axial is None:
        return uncoupled_planes(planes.get(Dof.X), planes.get(Dof.Y))
    known = [plane for plane in planes.values() if not np.array_equal(plane.omega, axial.omega)]
    if known:
        raise InputError("z receptance", f"{axial.omega.size} frequencies", f"the {known[0].omega.size} frequencies of the others")
    coordinates = tuple(Coordinate("tip", axis) for axis in (Dof.X, Dof.Y, Dof.Z))
    full = np.zeros((axial.omega.size, 3, 3), dtype=complex)
    for k, coordinate in enumerate(coordinates):
        if coordinate.dof in planes:
            full[:, k, k] = planes[coordinate.dof].values[:, 0, 0]
    return Receptance(axial.omega, full, coordinates, coordinates)
