"""A robot at a posture as a machine: it takes any tool-holder, and whoever asks for its tip does not know that it is one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy.linalg

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.units import from_hz, to_hz
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.turning_modes import TurningModes
from rcsa_ident.dynamics.uncertain import UncertainReceptance
from rcsa_ident.machine.flange_part import Doubtful, FlangePart, JointedFlange, OpenQuestion
from rcsa_ident.machine.machine import Machine
from rcsa_ident.machine.mode_synthesis import WHOLE_FLANGE
from rcsa_ident.machine.responses import in_plane
from rcsa_ident.machine.robot.carried_spindle import CarriedSpindle
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.tool_holder.model import tool_holder_receptance
from rcsa_ident.tool_holder.rods import rod_poles

#: A joint that nobody has told: its compliance is a hundred-thousandth of a slender tool's, and poles stay a small eigenvalue problem.
STIFF = LumpedJoint(1e13, 1e10)
#: Lowest frequency of its receptances, how they rise up to 100 Hz, and what is asked of each mode: lines over so many half-widths.
_LOWEST_HZ, _RISING, _PER_MODE, _HALF_WIDTHS = 1.0, 1.01, 81, 8.0


@dataclass(frozen=True, eq=False, repr=False)
class PosedRobot(Machine):
    """A robot whose drives hold a posture.

    Parameters
    ----------
    robot : FlexibleRobot
    angles : array, shape (j,) [rad]
    turn : float [rad]
        Of the feed from the tool's x about the tool's axis: the tip's x is the feed.
    spindle : CarriedSpindle or None
        None takes the spindle for rigid.
    joint : LumpedJoint
        Between spindle and tool-holder.
    highest : float [rad/s]
        Up to which it is asked for.
    doubtful : Doubtful or None
        Who can tell what is not known of it at a posture; None takes it for exact.

    Examples
    --------
    >>> import rcsa_ident.machine.robot.model as m
    >>> rod = m.Body(50.0, np.array([0.0, 0.0, 0.5]), np.diag([4.0, 4.0, 0.5]))
    >>> joint = m.Joint("J1", m.Frame(), np.array([1.0, 0.0, 0.0]), rod, stiffness=1e6, damping=200.0)
    >>> arm = FlexibleRobot(m.RobotModel("one", (joint,), flange=m.Frame(offset=np.array([0.0, 0.0, 1.0]))))
    >>> print(PosedRobot(arm, [0.0]))
    one at 0.0°: 1 mode from 39.2 Hz, tip.x, tip.y, tip.z
    """

    robot: FlexibleRobot
    angles: FloatArray
    turn: float = 0.0
    spindle: CarriedSpindle | None = None
    joint: LumpedJoint = STIFF
    highest: float = field(default=from_hz(4500.0))
    doubtful: Doubtful | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "angles", self.robot.model.posture(self.angles))

    @cached_property
    def flange(self) -> TurningModes:
        """The modes where the tool-holder sits, of arm and spindle."""
        structure, residual = self.robot.at(self.angles, self.turn), np.zeros((6, 6))
        if self.spindle is not None:
            spindle = self.spindle.turned(self.turn) if self.turn else self.spindle
            structure, residual[:4, :4] = spindle.on(structure), spindle.residual
        squares, shapes = scipy.linalg.eigh(structure.stiffness, structure.mass)
        damping = shapes.T @ structure.damping @ shapes
        return TurningModes(np.sqrt(squares), damping, np.zeros_like(damping), shapes.T @ structure.ports, residual, 0.0, WHOLE_FLANGE)

    @cached_property
    def parts(self) -> tuple[FlangePart, ...]:
        """One: all six directions feel each other."""
        doubt = None if self.doubtful is None else OpenQuestion(self.doubtful, (self.angles, self.turn))
        return (FlangePart(WHOLE_FLANGE, JointedFlange(self.flange, self.joint), doubt),)

    @property
    def band(self) -> tuple[float, float]:
        """From 1 Hz to `highest` [rad/s]."""
        return from_hz(_LOWEST_HZ), self.highest

    @property
    def lowest(self) -> float:
        """Frequency [rad/s] at which curves begin: an arm moves far below the tool's modes."""
        return self.band[0]

    def lines(self, beyond: float = 1.0) -> FloatArray:
        """Return frequencies [rad/s] 1 Hz apart from 100 Hz on, closer below, and close around each of the arm's modes."""
        low, high = to_hz(self.band[0]), beyond * to_hz(self.highest)
        rising = low * _RISING ** np.arange(np.log(100.0 / low) / np.log(_RISING))
        poles = self.flange.pole_residue().pole
        modes = poles[(np.abs(poles) < self.highest) & (poles.imag > 0.0)]
        around = to_hz(modes.imag[:, None] - modes.real[:, None] * _HALF_WIDTHS * np.linspace(-1.0, 1.0, _PER_MODE)).ravel()
        every = np.sort(np.concatenate([rising, np.arange(100.0, high + 0.5), around]))
        every = every[(every >= low) & (every <= high)]
        # lines that coincide tell nothing
        return from_hz(every[np.concatenate([[True], np.diff(every) > 1e-6 * every[1:]])])

    def coupled(
        self,
        tooling: Tooling | ToolAssembly,
        omega: FloatArray,
        axes: Sequence[Dof] | None = None,
        behind: Mapping[Dof, float] | None = None,
    ) -> UncertainReceptance:
        """Return the receptances of a tooling on the robot between tip and spindle, all six directions of both; see `Machine.coupled`."""
        del axes
        assembly, omega = self.fitted(tooling).assembly, frozen(omega)
        bending = tool_holder_receptance(assembly, omega)
        rods = [rod_poles(assembly, float(omega[-1]), twisting).receptance(omega) for twisting in (False, True)]
        holder = Receptance.block_diagonal([in_plane(bending, Dof.X), in_plane(bending, Dof.Y), *rods])
        order = [c for point in ("tip", "flange") for c in holder.rows if c.point == point]
        whole = couple(holder.block(order), self.flange.receptance(omega), self.joint, behind)
        return UncertainReceptance(whole.omega, whole.values, whole.rows, whole.cols)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What speaks against it: angles that no motor reaches, links that cannot be."""
        return (*self.robot.model.beyond_limits(self.angles), *self.robot.model.warnings)

    def __str__(self) -> str:
        angles = ", ".join(f"{each:.1f}°" for each in np.degrees(self.angles))
        count = self.flange.omega_n.size
        lowest = to_hz(float(self.flange.omega_n.min()))
        tips = ", ".join(str(c) for c in self.translations)
        return f"{self.robot.model.name} at {angles}: {count} mode{'s' if count > 1 else ''} from {lowest:.1f} Hz, {tips}"
