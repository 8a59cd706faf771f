"""An identified machine: modes and joint with what the records leave open, at any spindle speed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import TEMPERATURE
from rcsa_ident.base.units import to_hz
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.dynamics.turning_modes import TurningModes
from rcsa_ident.identification.coupled.posterior import CoupledPosterior
from rcsa_ident.identification.learned_changes import LearnedWarming
from rcsa_ident.identification.posterior import MachineAxis, PlaneUnknowns, Posterior
from rcsa_ident.identification.status import Status
from rcsa_ident.machine.axial_flange import AxialFlange
from rcsa_ident.machine.flange_part import FlangePart
from rcsa_ident.machine.machine import Machine
from rcsa_ident.machine.tip import Side
from rcsa_ident.machine.workpiece_side import WorkpieceSide
from rcsa_ident.setup.cut import Workpiece
from rcsa_ident.signals.recording import Sensor
from rcsa_ident.tool_holder.drawings import KnownToolings

#: Of the range of temperatures of its cuts, by which a machine is extrapolated to colder and to warmer ones.
BEYOND = 0.5
#: Unknowns times frequencies up to which the machine's side of the coupling is kept: 100 bytes each, 512 where planes feel each other.
MOST_KEPT, MOST_KEPT_OF_BOTH = 1_000_000, 200_000


class SpeedModel(NamedTuple):
    """What the cuts of a single range of spindle speeds say for themselves.

    `speeds`: (float, float) [rad/s]; lowest and highest
    `whole`: as in `IdentifiedMachine`
    """

    speeds: tuple[float, float]
    axes: Mapping[Dof, MachineAxis]
    whole: CoupledPosterior | None = None

    @property
    def unknowns(self) -> int:
        """Directions of the posterior."""
        if self.whole is not None:
            return self.whole.best.theta.size
        return sum(0 if part.posterior is None else part.posterior.theta.size for part in self.axes.values())


@dataclass(frozen=True, eq=False, repr=False)
class IdentifiedMachine(Machine):
    """A machine as its cuts have shown it.

    Parameters
    ----------
    identified : mapping of Dof to MachineAxis
        From all cuts.
    identified_band : (float, float) [rad/s]
        Lowest and highest identified line.
    speed_models : tuple of SpeedModel
        Single ranges of spindle speed, each with what its cuts say for themselves.
    speed : float or None [rad/s]
        At which it stands; None is the middle of the campaign's speeds.
    status : Status
    reasons : tuple of str
        Why it is not simply converged.
    identified_workpiece : Workpiece or None
        That the campaign cut.
    sensors : tuple of Sensor
        That it was recorded with.
    name : str
        The campaign's.
    whole : CoupledPosterior or None
        Of a machine whose planes feel each other; `identified` then is each plane at standstill, without the other one.
    toolings : KnownToolings or None
        What its cuts told of toolings whose drawings are not exact.
    workpiece_side : WorkpieceSide or None
        What accelerometers on table or workpiece showed.
    axial : AxialFlange or None
        What an axial tap showed.
    warming : LearnedWarming or None
        How it changes as it warms up: it is the warm machine then.
    temperature : float or None [°C]
        At which it stands, of a machine that follows a thermometer; None is warm.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> machine, tool = ri.read_machine("RESULT.json"), ri.sample_tooling("S3-PG25-long")
    >>> print(machine)  # doctest: +ELLIPSIS
    HPM sample machine: X ... modes, Y ... modes, 533 to 4266 Hz, converged
    >>> tip = machine.tip(tool)
    >>> lobes = ri.stability_lobes(tip, ri.CutSpec().process(tool.cutter, machine.workpiece), ri.rpm(12_000, 16_000, 50), 5e-3)
    >>> print(lobes.best_speeds()[0])  # doctest: +ELLIPSIS
    14550 rev/min: stability limit 2.0... mm, recommended 1.6... mm
    """

    identified: Mapping[Dof, MachineAxis]
    identified_band: tuple[float, float]
    speed_models: tuple[SpeedModel, ...] = ()
    speed: float | None = None
    status: Status = Status.CONVERGED
    reasons: tuple[str, ...] = ()
    identified_workpiece: Workpiece | None = None
    sensors: tuple[Sensor, ...] = ()
    name: str = ""
    whole: CoupledPosterior | None = None
    toolings: KnownToolings | None = None
    workpiece_side: WorkpieceSide | None = None
    axial: AxialFlange | None = None
    warming: LearnedWarming | None = None
    temperature: float | None = None
    kept_sides: tuple[Side, ...] = field(default=(), repr=False)

    @cached_property
    def parts(self) -> tuple[FlangePart, ...]:
        """The bending planes of X and Y, as one where they feel each other."""
        if self.whole is not None:
            return (self.whole.part(self.speed),)
        return tuple(part.part(axis, self.speed) for axis, part in self.identified.items())

    @property
    def coupled_planes(self) -> bool:
        """Whether X and Y feel each other."""
        return self.whole is not None

    @property
    def standing(self) -> ModalModel:
        """Modes of both planes that feel each other, of the spindle that does not turn; softened as at the speed at which it stands.

        Raises
        ------
        InputError
            If the planes do not feel each other: each has its own.
        """
        if self.whole is None:
            raise InputError("both_planes", "planes that do not feel each other", "a machine whose planes do")
        return self.whole.best.standing(self.whole.relative(self.speed))

    @property
    def band(self) -> tuple[float, float]:
        """Lowest and highest identified frequency [rad/s]."""
        return self.identified_band

    @property
    def turning(self) -> float | None:
        """Spindle speed [rad/s] at which tool-holders on it have their gyroscopic moments; None where the cuts show none."""
        if self.whole is None or not self.whole.turns:
            return None
        flange = self.whole.candidate(self.whole.best, self.speed).flange
        assert isinstance(flange, TurningModes)
        return flange.speed

    @property
    def softening_range(self) -> tuple[float, float] | None:
        """Lowest and highest spindle speed [rad/s] between which this one model changes; None where it does not."""
        if self.whole is not None:
            middle, half = self.whole.speed_range
            return (middle - half, middle + half) if self.whole.turns or self.whole.best.layout.softening else None
        return next((r for r in (part.softening_range for part in self.identified.values()) if r is not None), None)

    @property
    def speed_range(self) -> tuple[float, float] | None:
        """Lowest and highest spindle speed [rad/s] between which it is known how it changes; None where it does not change."""
        known = [each for each in (self.softening_range, *(model.speeds for model in self.speed_models)) if each is not None]
        return (min(low for low, _ in known), max(high for _, high in known)) if known else None

    @property
    def unknowns(self) -> int:
        """Directions of the posterior of all axes, of the model that has most of them."""
        return max(model.unknowns for model in (SpeedModel((0.0, 0.0), self.identified, self.whole), *self.speed_models))

    @property
    def prepared(self) -> bool:
        """Whether a further tooling costs milliseconds, its spread included."""
        return bool(self.kept_sides) and all(side.part.doubt is None or side.ends is not None for side in self.kept_sides)

    @property
    def workpiece(self) -> Workpiece | None:
        """That the campaign cut."""
        return self.identified_workpiece

    @property
    def remarks(self) -> tuple[str, ...]:
        """What speaks against everything that is computed with it."""
        fine = self.status in (Status.CONVERGED, Status.NOT_VALIDATED)
        doubts = () if fine else (f"the identification is {self.status}: {'; '.join(self.reasons)}",)
        words = "" if self.workpiece_side is None else self.workpiece_side.words
        along = () if self.axial is None else self.axial.remarks(self.band)
        return (*doubts, *([words] if words else []), *along, *self._beyond_temperatures)

    @property
    def thermometer(self) -> tuple[float, float] | None:
        """Lowest and highest temperature [°C] of its cuts, where it changes with that; planes that feel each other are known warm alone."""
        return None if self.warming is None or self.whole is not None else self.warming.thermometer

    @property
    def _beyond_temperatures(self) -> tuple[str, ...]:
        """That the cuts showed nothing of a temperature."""
        known = self.thermometer
        if known is None or self.temperature is None or known[0] <= self.temperature <= known[1]:
            return ()
        low, high = known
        straight = f"the cuts were made at {low:.3g} to {high:.3g} °C: the straight line through them is extrapolated"
        here = low + (1.0 + self._warmth(self.temperature)) * (high - low)
        if abs(here - self.temperature) < 1e-9:
            return (f"{straight} to {self.temperature:g} °C",)
        return (f"{straight} to {here:.3g} °C alone, and at {self.temperature:g} °C the machine is taken as there",)

    def _warmth(self, temperature: float) -> float:
        """From -1 at the coldest cut to 0 at the warmest one, and no more than half of that beyond."""
        assert self.thermometer is not None
        low, high = self.thermometer
        return float(np.clip((temperature - high) / (high - low), -1.0 - BEYOND, BEYOND))

    def posteriors(self) -> dict[Dof, Posterior]:
        """Return what is known of each axis by itself.

        Raises
        ------
        InputError
            An axis has none, as after the published method, or both planes feel each other.
        """
        if self.whole is not None:
            allowed = "a machine whose planes do not feel each other: what is known of this one belongs to both planes together"
            raise InputError("both_planes", "X and Y that feel each other", allowed)
        found = {axis: part.posterior for axis, part in self.identified.items() if part.posterior is not None}
        for axis in self.identified:
            if axis not in found:
                allowed = "a result of the default method, with unknowns and covariance of each axis"
                raise InputError(f"axes.{axis.upper()}", "no covariance", allowed)
        return found

    def starts(self) -> dict[Dof, Posterior | PlaneUnknowns]:
        """Return what a further identification may start from, axis by axis; of planes that feel each other, the modes that move each.

        Raises
        ------
        InputError
            An axis has no unknowns, as after the published method.
        """
        if self.whole is not None:
            return {axis: self.whole.best.seen_along(axis) for axis in self.identified}
        return dict(self.posteriors())

    def at(self, speed: float | None) -> IdentifiedMachine:
        """Return the machine at a spindle speed [rad/s]; the nearest model answers, and outside its speeds it stays as it is there."""
        if speed is None:
            return self
        model = self._model(speed)
        return model if model.softening_range is None else replace(model, speed=speed, kept_sides=())

    def at_temperature(self, temperature: float | None) -> IdentifiedMachine:
        """Return the machine at a temperature near the bearings [°C], by default warm; far beyond its cuts it stays as it is there."""
        if temperature is None or self.thermometer is None or self.temperature is not None:
            return cast(IdentifiedMachine, super().at_temperature(temperature))
        TEMPERATURE.checked("temperature_c", temperature)
        if self.speed_models:
            raise InputError(
                "temperature_c", f"{temperature:g} °C", "nothing: the models of single ranges of speeds are those of the warm machine"
            )
        axes = {axis: part.at_warmth(axis, self._warmth(temperature)) for axis, part in self.identified.items()}
        return replace(self, identified=axes, temperature=temperature, kept_sides=())

    def state(self, speed: float | None = None) -> str:
        """Return for which state it answers, as ``warm machine, 14000 rev/min``; empty where it has one state alone."""
        if self.warming is None:
            return super().state(speed)
        parts = [self.warming.state if self.temperature is None else f"at {self.temperature:g} °C", super().state(speed)]
        return ", ".join(part for part in parts if part)

    def speed_answered(self, speed: float | None = None) -> float | None:
        """Return the spindle speed [rad/s] of what `at(speed)` answers; None where it does not change."""
        return super().speed_answered(self.speed if speed is None else speed)

    def models(self, speeds: FloatArray) -> list[tuple[IdentifiedMachine, NDArray[np.intp]]]:
        """Return each model that answers at some of the speeds [rad/s], and the places of those."""
        if not self.speed_models:
            return [(self, np.arange(speeds.size))]
        number = np.array([self._number(speed) for speed in speeds.tolist()])
        # in the order in which the speeds ask for them
        return [(self._single(k), np.flatnonzero(number == k)) for k in dict.fromkeys(number.tolist())]

    def sides(self, omega: FloatArray) -> tuple[Side, ...]:
        """Return what a tip feels of the machine at some frequencies [rad/s]: what is kept, where these are the same."""
        if self.kept_sides and np.array_equal(omega, self.kept_sides[0].omega):
            return self.kept_sides
        return super().sides(omega)

    def kept(self, spread: bool = True) -> IdentifiedMachine:
        """Return the same machine with what a tip feels of it at `lines` worked out: a new tooling then costs milliseconds.

        A machine that changes with the speed, or with too many unknowns to keep them all, is returned as it is.

        Parameters
        ----------
        spread : bool
            Also what the records leave open.
        """
        if self.prepared or (self.kept_sides and not spread):
            return self
        omega = self.lines()
        most = MOST_KEPT if self.whole is None else MOST_KEPT_OF_BOTH
        if self.speed_range is not None or self.unknowns * omega.size > most:
            return self
        sides = self.sides(omega)
        return replace(self, kept_sides=tuple(side.kept() for side in sides) if spread else sides)

    def __getstate__(self) -> dict[str, Any]:
        # what is kept for speed would cost more on its way to another process than to work out there
        return {name: value for name, value in self.__dict__.items() if name != "parts"} | {"kept_sides": ()}

    def _number(self, speed: float) -> int:
        ranges = [model.speeds for model in self.speed_models]
        return min(range(len(ranges)), key=lambda k: max(ranges[k][0] - speed, speed - ranges[k][1], 0.0))

    def _single(self, number: int) -> IdentifiedMachine:
        own = self.speed_models[number]
        return replace(self, identified=own.axes, whole=own.whole, speed_models=(), kept_sides=())

    def _model(self, speed: float) -> IdentifiedMachine:
        return self._single(self._number(speed)) if self.speed_models else self

    def __str__(self) -> str:
        modes = [f"{axis.upper()} {part.spindle.modes.omega_n.size} modes" for axis, part in self.identified.items()]
        if self.whole is not None:
            modes = [f"X and Y together {self.whole.best.layout.modes} modes"]
        low, high = (to_hz(w) for w in self.identified_band)
        changes = "" if self.speed_range is None else ", changes with speed"
        return f"{self.name or 'machine'}: {', '.join(modes)}, {low:.0f} to {high:.0f} Hz, {self.status}{changes}"
