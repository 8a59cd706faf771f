"""A machine: whatever stands behind the flange, ready to take a tool-holder.

An identified spindle, a measured or decoupled flange and a robot at a posture differ in what they know of themselves; a tooling is coupled
to all of them in the same way, and nobody downstream asks which of them it is.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.shown import Drawn, Shown
from rcsa_ident.base.units import to_rpm
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.uncertain import UncertainReceptance
from rcsa_ident.machine.axial_flange import AxialFlange
from rcsa_ident.machine.flange_part import FlangePart
from rcsa_ident.machine.mode_synthesis import poles_of
from rcsa_ident.machine.responses import at_ends, at_flange, respond_over
from rcsa_ident.machine.tip import Behind, Side, tip_over
from rcsa_ident.machine.workpiece_side import WorkpieceSide
from rcsa_ident.setup.cut import Workpiece
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.stability.tip_modes import DIRECTIONS, TIP, TipModes
from rcsa_ident.tool_holder.drawings import FittedDrawing, KnownToolings, fitted
from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.tool_holder.model import tool_holder_receptance
from rcsa_ident.tool_holder.turning import turning_receptance

#: Lower end of the receptances that limits are computed from, and their step [Hz].
LOWEST, STEP = 100.0, 1.0
#: The tip along the axis.
AXIAL_TIP = DIRECTIONS[2]
#: Relative standard deviation of a tool-holder's stiffness that stands for its mesh.
STIFFNESS_SPREAD = 5e-4


class TipSource(Shown, ABC):
    """Whoever knows what the tip of a tooling does: a machine that takes any, or a test of one."""

    @property
    @abstractmethod
    def band(self) -> tuple[float, float] | None:
        """Lowest and highest frequency at which it is known [rad/s]; None where it is known at all."""

    @property
    def ends(self) -> bool:
        """Whether it answers at no frequency beyond those that it is known at, as a measurement does."""
        return False

    @property
    def speed_range(self) -> tuple[float, float] | None:
        """Lowest and highest spindle speed [rad/s] between which it is known how it changes; None where it does not change."""
        return None

    @property
    def unknowns(self) -> int:
        """Independent directions in which it may differ from what is believed."""
        return 0

    @property
    def coupled_planes(self) -> bool:
        """Whether X and Y feel each other, as far as that is known."""
        return False

    @property
    def translations(self) -> tuple[Coordinate, ...]:
        """Axes along which the tip is known to move."""
        return TIP

    @property
    def prepared(self) -> bool:
        """Whether a further tooling costs milliseconds, its spread included."""
        return True

    @property
    def workpiece(self) -> Workpiece | None:
        """What was cut, where that is known: its coefficients serve a cut that names none."""
        return None

    @property
    def remarks(self) -> tuple[str, ...]:
        """What speaks against everything that is computed with it."""
        return ()

    def at(self, speed: float | None) -> TipSource:
        """Return what answers at a spindle speed [rad/s], by default at the middle of the speeds that it is known at."""
        del speed
        return self

    def at_temperature(self, temperature: float | None) -> TipSource:
        """Return what answers at a temperature near the bearings [°C], by default the warm machine.

        Raises
        ------
        InputError
            If it does not depend on a temperature, or the temperature is not possible.
        """
        if temperature is not None:
            allowed = "nothing: it depends on no temperature; only a machine does whose cuts have `temperature_c`, and that warmed up"
            raise InputError("temperature_c", f"{temperature:g} °C", allowed)
        return self

    def state(self, speed: float | None = None) -> str:
        """Return for which state it answers, as ``warm machine, 14000 rev/min``; empty where it has one state alone.

        `speed` [rad/s]: spindle speed; None where each speed has its own answer
        """
        return "" if speed is None else f"{to_rpm(speed):.0f} rev/min"

    def speed_answered(self, speed: float | None = None) -> float | None:
        """Return the spindle speed [rad/s] of what `at(speed)` answers, by default the middle one; None where it does not change."""
        known = self.speed_range
        return None if known is None else 0.5 * (known[0] + known[1]) if speed is None else speed

    def models(self, speeds: FloatArray) -> Sequence[tuple[TipSource, NDArray[np.intp]]]:
        """Return each model that answers at some of the speeds [rad/s], and the places of those."""
        return [(self, np.arange(speeds.size))]

    @abstractmethod
    def lines(self, beyond: float = 1.0) -> FloatArray:
        """Return the frequencies [rad/s] of its receptances, up to so many times the highest at which it is known."""

    @abstractmethod
    def tip(
        self,
        tooling: Tooling | ToolAssembly,
        omega: FloatArray | None = None,
        spread: bool = True,
        stiffness_spread: float = STIFFNESS_SPREAD,
        directions: Sequence[Coordinate] = TIP,
    ) -> UncertainReceptance | TipModes:
        """Return what the tip of a tooling does, in directions that a machine may be asked for; see `Machine.tip`."""

    def relative_tip(
        self,
        tooling: Tooling | ToolAssembly,
        omega: FloatArray | None = None,
        spread: bool = True,
        stiffness_spread: float = STIFFNESS_SPREAD,
        directions: Sequence[Coordinate] = TIP,
    ) -> UncertainReceptance | TipModes:
        """Return what the tip does relative to the workpiece: what a chip feels, and limits are computed from; parameters as of `tip`."""
        return self.tip(tooling, omega, spread, stiffness_spread, directions)


class Machine(TipSource, Drawn):
    """What stands behind the flange.

    A subclass says what it is by `parts` and `band`, and what else it knows of itself: how it changes with the speed (`at`, `models`,
    `speed_range`), what speaks against it (`remarks`), and what it has learned of toolings (`toolings`) and of the workpiece's side.
    """

    #: What its cuts told of toolings whose drawings are not exact.
    toolings: KnownToolings | None = None
    #: What gives way under the workpiece, where accelerometers showed it; None where it is taken as rigid.
    workpiece_side: WorkpieceSide | None = None
    #: What gives way behind the flange along the spindle's axis, where an axial tap showed it; None where that is taken as rigid.
    axial: AxialFlange | None = None

    @property
    @abstractmethod
    def parts(self) -> tuple[FlangePart, ...]:
        """Directions of the flange that feel each other, group by group."""

    @property
    def turning(self) -> float | None:
        """Spindle speed [rad/s] at which tool-holders on it have their gyroscopic moments, positive from +Y to +X; None: they have none.

        The moments couple the planes: a machine that turns is one part, with translation and slope of X and of Y.
        """
        return None

    @property
    def coupled_planes(self) -> bool:
        """Whether X and Y feel each other."""
        return any(len({c.dof.plane for c in part.coordinates}) > 1 for part in self.parts)

    @property
    def lowest(self) -> float:
        """Frequency [rad/s] at which curves begin unless another is asked for: 100 Hz, or where a measurement begins."""
        assert self.band is not None
        return self.band[0] if self.ends else 2.0 * np.pi * LOWEST

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """Directions of the flange that are known."""
        return tuple(c for part in self.parts for c in part.coordinates)

    @property
    def axes(self) -> tuple[Dof, ...]:
        """Machine axes of the bending planes, along which the tip moves."""
        return tuple(c.dof for c in self.coordinates if c.dof in (Dof.X, Dof.Y))

    @property
    def translations(self) -> tuple[Coordinate, ...]:
        """Axes along which the tip is known to move: X, Y, and Z after an axial tap or on a robot."""
        along = self.axial is not None or any(c.dof is Dof.Z for c in self.coordinates)
        return (*(Coordinate("tip", axis) for axis in self.axes), *((AXIAL_TIP,) if along else ()))

    def lines(self, beyond: float = 1.0) -> FloatArray:
        """Return frequencies [rad/s] 1 Hz apart, from 100 Hz or below up to so many times the highest at which the machine is known."""
        assert self.band is not None
        low, high = (w / (2.0 * np.pi) for w in self.band)
        return 2.0 * np.pi * np.arange(min(LOWEST, low), beyond * high + 0.5 * STEP, STEP)

    def at(self, speed: float | None) -> Machine:
        """Return the machine at a spindle speed [rad/s], by default at the middle of the speeds that it is known at."""
        del speed
        return self

    def kept(self, spread: bool = True) -> Machine:
        """Return the same machine, with what many toolings share worked out, where that saves time; of its spread only if asked."""
        del spread
        return self

    def fitted(self, tooling: Tooling | ToolAssembly) -> FittedDrawing:
        """Return a tooling as it is believed to be, by what its drawing and the machine's cuts say; an assembly is exact."""
        if not isinstance(tooling, Tooling):
            return FittedDrawing(tooling)
        return fitted(tooling.name, tooling.drawing, self.toolings)

    def sides(self, omega: FloatArray) -> tuple[Side, ...]:
        """Return what a tip feels of the machine at some frequencies [rad/s]."""
        omega = frozen(omega)
        return tuple(Side.of(part, omega) for part in self.parts)

    def receptance(self, omega: FloatArray, axes: Sequence[Dof] | None = None) -> UncertainReceptance:
        """Return the receptance at the flange, over all its coordinates.

        Parameters
        ----------
        omega : array, shape (n,) [rad/s]
        axes : sequence of Dof, default all
            Only these machine axes, and what they feel of others.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> machine, tool = ri.read_machine("RESULT.json"), ri.sample_tooling("S3-PG25-long")
        >>> print(machine.receptance(ri.hz(500.0, 4000.0, 5.0)))
        flange.x, flange.x', flange.y, flange.y': 701 frequencies, 500 to 4000 Hz, with its spread
        """
        return respond_over(self._along(axes), frozen(omega), at_flange)

    def coupled(
        self,
        tooling: Tooling | ToolAssembly,
        omega: FloatArray,
        axes: Sequence[Dof] | None = None,
        behind: Mapping[Dof, float] | None = None,
    ) -> UncertainReceptance:
        """Return the receptances of a tooling on the machine between tip and spindle, translations and slopes.

        Parameters
        ----------
        tooling : Tooling or ToolAssembly
        omega : array, shape (n,) [rad/s]
        axes : sequence of Dof, default all
            Only these machine axes, and what they feel of others.
        behind : mapping of Dof to float, optional [m]
            How far behind the joint sensors look at the spindle, along each axis; negative: at the tool-holder in front of it. By default
            the spindle's translations are those at the joint.

        Returns
        -------
        UncertainReceptance
            Points ``tip`` and ``spindle``; the tool-holder is taken for exactly as it is believed to be.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> machine, tool = ri.read_machine("RESULT.json"), ri.sample_tooling("S3-PG25-long")
        >>> print(machine.coupled(tool, ri.hz(500.0, 4000.0, 5.0)))
        tip.x, tip.x', spindle.x, spindle.x', tip.y, tip.y', spindle.y, spindle.y': 701 frequencies, 500 to 4000 Hz, with its spread
        """
        assembly, omega = self.fitted(tooling).assembly, frozen(omega)
        turning = self.turning
        holder = tool_holder_receptance(assembly, omega) if turning is None else turning_receptance(assembly, omega, turning)
        return respond_over(self._along(axes), omega, partial(at_ends, behind=behind), holder)

    def tip(
        self,
        tooling: Tooling | ToolAssembly,
        omega: FloatArray | None = None,
        spread: bool = True,
        stiffness_spread: float = STIFFNESS_SPREAD,
        directions: Sequence[Coordinate] = TIP,
    ) -> UncertainReceptance:
        """Return the tip's receptance of a tooling on the machine, over ``tip.x`` and ``tip.y`` with their cross terms.

        Parameters
        ----------
        tooling : Tooling or ToolAssembly
        omega : array, shape (n,) [rad/s], default the machine's `lines`
            Ascending.
        spread : bool
            With what is not known of the machine, where something is; it is computed where it is asked for.
        stiffness_spread : float
            Standard deviation of the tool-holder's stiffness, as a share: the mesh alone by default; 0.01 for a modulus from a handbook.
        directions : sequence of Coordinate, default ``tip.x`` and ``tip.y``
            Of the tip; those beyond the default are asked for by cutters whose edges are no wall. Slopes of both planes, or none;
            ``tip.z`` is rigid unless an axial tap has told what stands behind the tool-holder along its axis.

        Returns
        -------
        UncertainReceptance
            Over the directions that the machine knows; over all that were asked for where these are X, Y and more.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> machine, tool = ri.read_machine("RESULT.json"), ri.sample_tooling("S3-PG25-long")
        >>> tip = machine.tip(tool, ri.hz(500.0, 4000.0, 5.0))
        >>> print(tip)
        tip.x, tip.y: 701 frequencies, 500 to 4000 Hz, with its spread
        >>> tip.between("tip.x", "tip.x").shape
        (701,)
        """
        sides = self.sides(self.lines() if omega is None else omega)
        drawing, turning = self.fitted(tooling), self.turning
        slopes = any(c.dof.is_slope for c in directions)
        if self.axial is not None and AXIAL_TIP in directions:
            sides = (*sides, Side.of(self.axial.part, sides[0].omega))
        tip = tip_over(Behind(sides, turning, slopes), drawing, stiffness_spread)
        if len(sides) == 1:
            highest = float(tip.omega[-1])
            tip = replace(tip, poles=partial(poles_of, drawing.assembly, sides[0].part.believed, highest, turning, slopes))
        if set(directions) > set(TIP) or not set(tip.rows) <= set(directions):
            tip = tip.among(directions)
        return tip if spread else replace(tip, variation=None)

    def relative_tip(
        self,
        tooling: Tooling | ToolAssembly,
        omega: FloatArray | None = None,
        spread: bool = True,
        stiffness_spread: float = STIFFNESS_SPREAD,
        directions: Sequence[Coordinate] = TIP,
    ) -> UncertainReceptance:
        """Return the receptance between the tip and the workpiece, C11 + G_w: the tip's own where nothing else gives way.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> machine, tool = ri.read_machine("RESULT.json"), ri.sample_tooling("S3-PG25-long")
        >>> print(machine.relative_tip(tool, ri.hz(500.0, 4000.0, 5.0)))
        tip.x, tip.y: 701 frequencies, 500 to 4000 Hz, with its spread
        """
        tip = self.tip(tooling, omega, spread, stiffness_spread, directions)
        if self.workpiece_side is None:
            return tip
        relative = self.workpiece_side.beside(tip)
        return relative if spread else replace(relative, variation=None)

    def check_behind_joint(self, axes: Sequence[Dof] | None = None) -> None:
        """Refuse a machine that does not tell the spindle's own motion behind the joint, where a sensor at the flange looks.

        A tip feels flange and joint only together, W = B33 + K^-1. Coupled rigidly, a flange that holds K^-1 moves as the tool-holder
        does in front of the joint; the sensor sees the spindle move, which is less by the force through the joint times K^-1.

        Parameters
        ----------
        axes : sequence of Dof, default all

        Raises
        ------
        InputError
            If the flange along one of these axes holds the joint's compliance, as far as it is known.
        """
        held = [c.dof.upper() for part in self._along(axes) if part.believed.joint is None for c in part.coordinates if not c.dof.is_slope]
        if held:
            found = f"a flange that holds the compliance of its joint, as a decoupled one does ({', '.join(held)})"
            allowed = "an identified machine, or a bare flange with its joint: the sensor looks at the spindle behind the joint"
            raise InputError("machine", found, allowed)

    def _along(self, axes: Sequence[Dof] | None) -> list[FlangePart]:
        """The parts that some axes feel."""
        return [part for part in self.parts if axes is None or any(c.dof in axes for c in part.coordinates)]
