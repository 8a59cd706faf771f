"""The tip's motion as modes: what the methods that march through time need."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import MODE_STIFFNESS, TIP_DAMPING, TIP_FREQUENCY, TIP_STIFFNESS, remarks_of
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.shown import Saved
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.line_noise import line_noise
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.dynamics.poles import PoleResidue, frequencies
from rcsa_ident.dynamics.rational import fitted_poles
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.uncertain import UncertainReceptance

#: Lines per half-power bandwidth of the least damped mode, and the most there may be.
LINES_PER_BANDWIDTH = 10.0
MOST_LINES = 200_000
#: How far above the highest mode the harmonics of a force are looked at, and the ratio of frequencies up there.
_ABOVE, _STRETCH = 10.0, 1.03
#: Directions in which a tip may move: two of them count where a cut is plain, three or all where its edges have a shape.
DIRECTIONS = tuple(Coordinate("tip", dof) for dof in (Dof.X, Dof.Y, Dof.Z, Dof.SLOPE_X, Dof.SLOPE_Y))
TIP = DIRECTIONS[:2]
#: What a fit of a receptance may be beside it, root mean square.
FIT_TOLERANCE = 2e-3
#: The same beside noise where a receptance was measured, as nearly as anybody measures one; a share of the largest value below which
#: smaller ones matter no more; and the share of the tolerance from which on lines are called noisy.
_MEASURED, _SMALL, _NOISY = 1e-2, 1e-2, 0.1
#: How far poles that are known without a fit may be beside the receptance: materials lose a constant share, modes one that grows with
#: frequency, which between resonances is a few thousandths.
NEAR_ENOUGH = 5e-3
#: Damping ratio of a fitted pole outside the band, at least: lightly damped, it would chatter.
DAMPED_OUTSIDE = 0.1


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TipModes(PoleResidue, Saved):
    """The tip's receptance in r machine directions as damped modes; along the edge they may have a shape.

    Parameters
    ----------
    pole, outputs, inputs, constant
        As in `PoleResidue`, outputs (r, m), inputs (m, r), real parts of the poles negative; the r of them are 2 (X and Y), 3 (with Z)
        or 5 (with the slopes x' and y').
    heights : array, shape (k,) [m], default none
        Distances from the tip along the edge, ascending.
    shape : array, shape (k, m) [-], default none
        How each mode moves there, over its motion at the tip; straight lines in between, constant beyond the first and the last.
        Such modes have real directions, and no constant stands beside them.

    Examples
    --------
    A mode along Y; X is rigid:

    >>> import rcsa_ident as ri
    >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
    >>> tip = ri.TipModes.of({ri.Dof.Y: mode})
    >>> print(tip)
    tip: 1 mode at 900 Hz
    >>> bool(tip.receptance().between("tip.x", "tip.x").any())
    False
    """

    heights: FloatArray | None = None
    shape: FloatArray | None = None

    def __post_init__(self) -> None:
        PoleResidue.__post_init__(self)
        m = self.pole.size
        if self.constant.shape not in ((2, 2), (3, 3), (5, 5)):
            raise InputError("constant", self.constant.shape, "shape (2, 2), (3, 3) with Z, or (5, 5) with Z and the slopes")
        if m == 0 or not np.any(self.outputs) or not np.any(self.inputs):
            raise InputError("tip modes", "none that moves the tip", "at least one flexible direction")
        if not np.all(self.pole.real < 0.0):
            raise InputError("pole", self.pole.tolist(), "damped modes: negative real parts [rad/s]")
        if (self.heights is None) != (self.shape is None):
            raise InputError("heights and shape", "one of them", "both, or neither")
        if self.heights is not None and self.shape is not None:
            object.__setattr__(self, "heights", frozen(self.heights))
            object.__setattr__(self, "shape", frozen(self.shape))
            if self.heights.ndim != 1 or self.heights.size == 0 or np.any(np.diff(self.heights) <= 0.0):
                raise InputError("heights", self.heights.tolist(), "one or more distances from the tip, ascending [m]")
            if self.shape.shape != (self.heights.size, m):
                raise InputError("shape", self.shape.shape, f"shape {(self.heights.size, m)}: heights, modes")
            if np.any(self.constant):
                raise InputError("constant", "not zero", "zero beside modes that have a shape along the edge")
            if self.directions != 2:
                raise InputError("constant", self.constant.shape, "shape (2, 2) beside modes that have a shape along the edge")

    @classmethod
    def of(cls, models: Mapping[Dof, ModalModel]) -> TipModes:
        """Return the modes of planes that do not feel each other; a direction that is missing is rigid.

        Parameters
        ----------
        models : mapping of Dof to ModalModel
            With ``tip.x`` and ``tip.y``, and ``tip.z``; where one of them has the tip's slope, slopes count.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
        >>> print(ri.TipModes.of({ri.Dof.Y: mode}))
        tip: 1 mode at 900 Hz
        """
        told = {coordinate for model in models.values() for coordinate in model.coordinates}
        count = 5 if told & set(DIRECTIONS[3:]) else 3 if DIRECTIONS[2] in told else 2
        parts = []
        for axis, model in models.items():
            if Coordinate("tip", axis) not in model.coordinates:
                raise InputError("tip modes", f"a model of {axis} without tip.{axis}", f"one with tip.{axis}")
            turn = np.zeros((count, len(model.coordinates)))
            for i, direction in enumerate(DIRECTIONS[:count]):
                if direction in model.coordinates and direction.dof.plane is axis:
                    turn[i, model.coordinates.index(direction)] = 1.0
            parts.append(model.pole_residue().projected(turn, turn.T))
        if not parts:
            raise InputError("tip modes", "none", "at least one flexible direction")
        found = cls.joined(parts)
        _ = found.remarks  # impossible ones are refused
        return found

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """What is unusual about the modes, as a wrong unit would make it: the highest frequency, damping ratios, the softest stiffness."""
        frequency, damping = np.abs(self.pole), -self.pole.real / np.abs(self.pole)
        # along a mode's own direction, whatever it is
        compliance = np.abs(np.sum(2.0 * np.real(-self.outputs[:3] * self.inputs.T[:3] / self.pole), axis=0))
        values = [("highest natural frequency of the tip", TIP_FREQUENCY, float(frequency.max()))]
        values += [("damping ratio", TIP_DAMPING, float(end)) for end in np.unique(damping)[[0, -1]]]
        if compliance.any():
            values.append(("stiffness of the tip's softest mode", TIP_STIFFNESS, 1.0 / float(compliance.max())))
        if compliance.all() and compliance.size > 1:
            values.append(("stiffness of the tip's stiffest mode", MODE_STIFFNESS, 1.0 / float(compliance.min())))
        return tuple(dict.fromkeys(remarks_of(values)))

    @property
    def directions(self) -> int:
        """In how many directions the tip moves."""
        return int(self.constant.shape[0])

    @property
    def planar(self) -> TipModes:
        """The same in X and Y alone."""
        if self.directions == 2:
            return self
        return TipModes(self.pole, self.outputs[:2], self.inputs[:, :2], self.constant[:2, :2])

    @property
    def strength(self) -> FloatArray:
        """Size of each mode's own peak, shape (m,) [m/N]."""
        return np.linalg.norm(self.outputs, axis=0) * np.linalg.norm(self.inputs, axis=1) / -self.pole.real

    def receptance(self, wide: bool = False) -> Receptance:
        """Return the receptance at frequencies that resolve the sharpest mode, from 0.1 to 2 times the modes' own.

        Parameters
        ----------
        wide : bool
            From 0.02 times on, and few up to 10 times: where the harmonics of a force still move the tip.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
        >>> tip = ri.TipModes.of({ri.Dof.Y: mode})
        >>> print(tip.receptance())
        tip.x, tip.y: 476 frequencies, 90 to 1800 Hz
        """
        frequency = np.abs(self.pole)
        waves = np.abs(self.pole.imag) > 0.0
        step = float(np.min(-2.0 * self.pole.real[waves], initial=np.inf)) / LINES_PER_BANDWIDTH
        low, high = (0.02 if wide else 0.1) * float(frequency.min()), 2.0 * float(frequency.max())
        step = min(step, (high - low) / 100.0)
        if (high - low) / step > MOST_LINES:
            sharpest = float(np.min(-self.pole.real / frequency))
            raise InputError("damping_ratio", sharpest, f"modes that {MOST_LINES} frequencies resolve")
        omega = np.linspace(low, high, int((high - low) / step) + 2)
        if wide:
            tail = np.arange(1, int(np.log(0.5 * _ABOVE) / np.log(_STRETCH)) + 1)
            omega = np.concatenate([omega, high * _STRETCH**tail])
        known = DIRECTIONS[: self.directions]
        return Receptance(omega, self.response(omega), known, known)

    @property
    def largest(self) -> float:
        """The largest gain of the receptance, from its modes' neighbourhoods [m/N]."""
        places = np.abs(self.pole.imag)[:, None] - self.pole.real[:, None] * np.linspace(-1.5, 1.5, 13)
        places = np.concatenate([places.ravel(), [0.0]])
        return float(np.max(np.linalg.norm(self.response(np.maximum(places, 0.0)), 2, axis=(1, 2))))

    def __str__(self) -> str:
        return f"tip: {frequencies('modes', np.abs(self.pole))}"


class ModeArrays(NamedTuple):
    """What kernels take of modes, p' = pole p + inputs F, y = 2 Re(outputs p) + constant F, with m modes and r displacements.

    The order is that in which the kernels unpack it. They are compiled anew for read-only arrays: these are not.
    """

    #: Complex, shape (m,).
    pole: ComplexArray
    #: Complex, shapes (r, m), (m, r).
    outputs: ComplexArray
    inputs: ComplexArray
    #: Shape (r, r).
    constant: FloatArray


def fitted_modes(tip: Receptance) -> tuple[TipModes, float]:
    """Return modes that stand for the tip's receptance, and how far they are beside it: the norm of what is left, as a share.

    Poles that the receptance knows without a fit are taken where they are near enough, else a rational function is fitted; to one that
    was measured as far as its noise goes.
    """
    known = known_modes(tip)
    if known is not None:
        return known
    size = slope_length(tip.values)
    values = tip.values * np.outer(size, size)
    found, error = fitted_poles(tip.omega, values, FIT_TOLERANCE, DAMPED_OUTSIDE, _allowed(values))
    return TipModes.joined([found.projected(np.diag(1.0 / size), np.diag(1.0 / size))]), error


def _allowed(values: ComplexArray) -> FloatArray | None:
    """What a fit may be beside lines that show noise: the standard deviation of their parts, and of the tolerance; None where they show
    less than the fit may be beside them anyway."""
    noise = line_noise(values)
    size = np.abs(values)
    largest = size.max(axis=0)
    part = np.sqrt(0.5) * np.maximum(size, _SMALL * np.where(largest == 0.0, largest.max(), largest))
    return np.hypot(noise, _MEASURED * part) if np.any(noise > _NOISY * FIT_TOLERANCE * part) else None


def slope_length(values: ComplexArray) -> FloatArray:
    """Return a factor for each direction that makes slopes as large as translations: what a fit of them all is to weigh alike.

    `values`, shape (n, r, r): in 2, 3 or 5 directions
    """
    r = values.shape[1]
    size = np.ones(r)
    if r == len(DIRECTIONS):
        own = np.linalg.norm(np.einsum("nii->ni", values), axis=0)
        for axis, slope in ((0, 3), (1, 4)):
            if own[axis] > 0.0 and own[slope] > 0.0:
                size[slope] = np.sqrt(own[axis] / own[slope])
    return size


def known_modes(tip: Receptance) -> tuple[TipModes, float] | None:
    """Return the modes that a receptance knows without a fit and how far they are beside it; None where it knows none near enough."""
    poles = tip.poles() if isinstance(tip, UncertainReceptance) and tip.poles is not None else None
    if poles is None or not np.all(poles.pole.real < 0.0):
        return None
    above = tip.omega > 0.0
    size = slope_length(tip.values)
    weight = np.outer(size, size)
    error = float(np.linalg.norm(weight * (poles.response(tip.omega) - tip.values)[above]) / np.linalg.norm(weight * tip.values[above]))
    return (TipModes.joined([poles]), error) if error <= NEAR_ENOUGH else None


def require_modes(tip: Receptance | TipModes, method: str) -> TipModes:
    """Return the modes that a method marches with, or say what it needs."""
    if isinstance(tip, TipModes):
        return tip
    raise InputError(
        "tip", f"a receptance at {tip.omega.size} frequencies", f"modes for {method}: a rational fit of the receptance gives them"
    )


def receptance_of(tip: Receptance | TipModes, wide: bool = False) -> Receptance:
    """Return the receptance that a method in the frequency domain takes."""
    return tip.receptance(wide) if isinstance(tip, TipModes) else tip
