"""The workpiece's side of the cut: what gives way under the reaction of the force on the tool, as modes.

A force F on the tool is -F on the workpiece. With the tip's receptance C11 and the workpiece's G_w the tool moves by C11 F, the workpiece
by -G_w F, and what a chip feels of both is (C11 + G_w) F.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.shown import Shown
from rcsa_ident.base.units import to_hz
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import ModalModel, normal_modes
from rcsa_ident.dynamics.poles import PoleResidue
from rcsa_ident.dynamics.uncertain import Doubted, Name, Places, Spread, UncertainReceptance, Variation
from rcsa_ident.signals.recording import Role


def gives_way(logs: FloatArray, omega: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Return what modes give way under a force, and how that changes with the logarithms of their numbers.

    G_w = sum_n omega_n^2 / k_n / (omega_n^2 - omega^2 + 2 i zeta_n omega_n omega), which is passive whatever the logarithms are.

    `logs`, shape (3, m): of natural frequencies [rad/s], damping ratios and stiffnesses [N/m]
    `omega` [rad/s], shape (n,)
    Returns complex arrays, shapes (n,) [m/N] and (3, m, n) [m/N].
    """
    natural, zeta, stiffness = (each[:, None] for each in np.exp(logs))
    loss = 2j * zeta * natural * omega
    dynamic = natural**2 - omega**2 + loss
    each = natural**2 / stiffness / dynamic
    change = np.stack([each * (2.0 - (2.0 * natural**2 + loss) / dynamic), -each * loss / dynamic, -each])
    return each.sum(axis=0), change


@dataclass(frozen=True, eq=False, repr=False)
class WorkpieceAxis(Shown):
    """What gives way on the workpiece's side along one machine axis, and what it was found from.

    `sensor`: the accelerometer that showed it
    `role`: what that is fixed to
    `omega_n` [rad/s], shape (m,): natural frequencies, rising; empty where nothing stands above the noise
    `zeta` [-], shape (m,); `stiffness` [N/m], shape (m,)
    `covariance`, shape (3 m, 3 m): of the logarithms of natural frequencies, then of damping ratios, then of stiffnesses
    `chi2_per_point` [-]: mean squared residual in standard deviations of noise and model error
    `model_error` [-]: share of each line that neither the modes nor the records' noise explain
    """

    sensor: str
    role: Role
    omega_n: FloatArray
    zeta: FloatArray
    stiffness: FloatArray
    covariance: FloatArray
    lines: int = 0
    chi2_per_point: float = 0.0
    model_error: float = 0.0

    def __post_init__(self) -> None:
        for name in ("omega_n", "zeta", "stiffness", "covariance"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        m = self.omega_n.size
        for name, shape in (("zeta", (m,)), ("stiffness", (m,)), ("covariance", (3 * m, 3 * m))):
            if getattr(self, name).shape != shape:
                raise InputError(name, getattr(self, name).shape, f"shape {shape}")
        if not all(np.all(each > 0.0) for each in (self.omega_n, self.zeta, self.stiffness)) or not np.all(self.zeta < 1.0):
            raise InputError("workpiece_side", "a mode that is not passive", "values above 0, and damping ratios below 1")

    @property
    def logs(self) -> FloatArray:
        """Logarithms of natural frequencies, damping ratios and stiffnesses, shape (3, m)."""
        return np.log(np.stack([self.omega_n, self.zeta, self.stiffness]))

    @property
    def deviations(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Standard deviations of natural frequencies [rad/s], damping ratios and stiffnesses [N/m], shape (m,) each."""
        shares = np.sqrt(np.maximum(np.diag(self.covariance), 0.0)).reshape(3, -1)
        return self.omega_n * shares[0], self.zeta * shares[1], self.stiffness * shares[2]

    def receptance(self, omega: FloatArray) -> ComplexArray:
        """Return G_w, shape (n,) [m/N]."""
        return gives_way(self.logs, omega)[0]

    def changes(self, omega: FloatArray) -> ComplexArray:
        """Return how G_w varies along independent directions, per standard deviation, shape (3 m, n) [m/N]."""
        values, vectors = np.linalg.eigh(self.covariance)
        change = gives_way(self.logs, omega)[1].reshape(-1, omega.size)
        found: ComplexArray = (vectors * np.sqrt(np.maximum(values, 0.0))).T @ change
        return found

    def modes(self, axis: Dof) -> ModalModel:
        """Return the same as a modal model over the tip's translation: what relative motion has beside the tool's own."""
        psi = self.omega_n / np.sqrt(self.stiffness)
        return normal_modes(self.omega_n, self.zeta, psi[:, None], (Coordinate("tip", axis),))

    def __str__(self) -> str:
        if not self.omega_n.size:
            return "nothing above the noise"
        pairs = zip(to_hz(self.omega_n), 1e-6 * self.stiffness, strict=True)
        return ", ".join(f"{frequency:.0f} Hz ({stiffness:.3g} N/µm)" for frequency, stiffness in pairs)


@dataclass(frozen=True, eq=False, repr=False)
class WorkpieceSide(Shown):
    """What gives way on the workpiece's side of the cut, axis by axis; X and Y feel nothing of each other.

    `axes`: those that an accelerometer showed
    """

    axes: Mapping[Dof, WorkpieceAxis] = field(default_factory=dict)

    @property
    def yielding(self) -> dict[Dof, WorkpieceAxis]:
        """Those axes along which something stands above the noise."""
        return {axis: each for axis, each in self.axes.items() if each.omega_n.size}

    def beside(self, tip: UncertainReceptance) -> UncertainReceptance:
        """Return the receptance between tool and workpiece, C11 + G_w, with the spread of both. `tip`: C11 over the tip's translations."""
        own = {row: self.yielding[c.dof] for row, c in enumerate(tip.rows) if c.dof in self.yielding}
        if not own:
            return tip
        values = tip.values.copy()
        for row, each in own.items():
            values[:, row, row] += each.receptance(tip.omega)
        poles = None if tip.poles is None else partial(self._poles, tip)
        # where nobody knows how well the tool's side is known, a band of the workpiece's alone would be too narrow
        variation = None if tip.variation is None else _Beside(tip.variation, own, tip.omega)
        return replace(tip, values=values, variation=variation, poles=poles)

    def _poles(self, tip: UncertainReceptance) -> PoleResidue | None:
        """Poles of the tool's tip and of the workpiece's side; None where those of the tip are not known."""
        known = None if tip.poles is None else tip.poles()
        if known is None:
            return None
        unit = np.eye(len(tip.rows))
        own = [(unit[:, [row]], self.yielding[c.dof].modes(c.dof)) for row, c in enumerate(tip.rows) if c.dof in self.yielding]
        return PoleResidue.joined([known, *(modes.pole_residue().projected(turn, turn.T) for turn, modes in own)])

    @property
    def words(self) -> str:
        """What limits have in them of it, and what was assumed, as a sentence; empty where nothing stands above the noise."""
        if not self.yielding:
            return ""
        modes = "; ".join(f"{axis.upper()}: {each}" for axis, each in self.yielding.items())
        sensors = " and ".join(f"{each.sensor} (on the {each.role})" for each in self.yielding.values())
        taken = "is" if len(self.yielding) == 1 else "are"
        return (
            f"the workpiece's side gives way, too ({modes}): stability limits and recommendations hold for tool and workpiece together, "
            f"the tool's own tip receptance is without it; {sensors} {taken} taken to move as the workpiece does at the cut: how far "
            "from it is not known"
        )

    def __str__(self) -> str:
        return "; ".join(f"{axis.upper()} {each}" for axis, each in self.axes.items())


@dataclass(frozen=True, eq=False)
class _Beside:
    """How a tip's receptance varies, with what is not known of the workpiece's side."""

    tool: Spread
    own: Mapping[int, WorkpieceAxis]
    omega: FloatArray

    @property
    def covers(self) -> frozenset[int]:
        return self.tool.covers

    def at(self, places: Places) -> tuple[Variation, ...]:
        """Return the variations at some of the frequencies: the tool's own directions, the workpiece's, then those in common."""
        return tuple(self._added(part, self.omega[places]) for part in self.tool.at(places))

    def _added(self, part: Variation, omega: FloatArray) -> Variation:
        more = []
        for i, row in enumerate(part.members):
            if row in self.own:
                change = self.own[row].changes(omega)
                block = np.zeros((*change.shape, len(part.members), len(part.members)), dtype=complex)
                block[:, :, i, i] = change
                more.append(block)
        if not more:
            return part
        added, first = np.concatenate(more), len(part.change) - part.common
        change = np.concatenate([part.change[:first], added, part.change[first:]])

        def moved(named: Mapping[Name, FloatArray]) -> dict[Name, FloatArray]:
            return {name: np.insert(moves, [first] * len(added), 0.0, axis=1) for name, moves in named.items()}

        unknowns, parameters = moved(part.unknowns), moved(part.parameters)
        unknowns[Doubted.WORKPIECE] = np.eye(len(change))[first : first + len(added)]
        return replace(part, change=change, unknowns=unknowns, parameters=parameters)

    def guides(self) -> ComplexArray:
        """Return the tool's curves, and the workpiece's."""
        return np.concatenate([self.tool.guides(), *(each.changes(self.omega) for each in self.own.values())])
