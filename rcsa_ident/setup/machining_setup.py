"""What is on the machine: toolings, workpiece, sensors, cuts that were made, and a cut that somebody asks about."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import AXIAL_DEPTH, FEED_ANGLE, FEED_PER_TOOTH, IMMERSION, RUNOUT, SPINDLE_SPEED, remarks_of
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.shown import Saved, Shown
from rcsa_ident.base.units import to_rpm
from rcsa_ident.cutting.coefficients import CuttingCoefficients, checked_coefficient
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement, feed_direction
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.materials import material
from rcsa_ident.cutting.process import MillingProcess, ProcessDamping, SpeedVariation
from rcsa_ident.cutting.stock import AskedEngagement, Immersion, engagement_with
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.passivity import Correction
from rcsa_ident.setup.fields import ASKED_CUT, COEFFICIENTS, told_in_si
from rcsa_ident.signals.recording import Recording, Sensor, untold_distances
from rcsa_ident.tool_holder.catalogue import assumption, stated
from rcsa_ident.tool_holder.drawings import Drawing
from rcsa_ident.tool_holder.geometry import BeamSegment, ToolAssembly
from rcsa_ident.tool_holder.proportions import proportions
from rcsa_ident.tool_holder.spread import UNSTATED, Spread

#: Median of the positive half of a normal distribution over its standard deviation, and about the spread of its logarithm.
HALF_NORMAL, HALF_NORMAL_SPREAD = 0.67, 0.95


@dataclass(frozen=True, slots=True, repr=False)
class Tooling(Saved):
    """A cutter, with the tool and holder that carry it.

    Parameters
    ----------
    name : str
    cutter : Cutter
    assembly : ToolAssembly
        As drawn.
    spread : Spread
        How well the drawing is known; by default it counts as exact, and a remark names a contact that only the catalogue assumes.
    tool_model, holder_model : str
        Tools of the same model share what is not known of them, wherever they are clamped; holders of the same model (and bore) share
        their contact. Empty where nothing is shared.
    taper : str
        What the holder has behind its flange, one of `rcsa_ident.tool_holder.taper.tapers()`; empty where it is not told. It joins the
        spindle there, and is part of what hangs on a string.
    tool_behind : tuple of BeamSegment
        What the tool has behind the insertion, from there to its rear end: of no account in the holder, part of the bare tool.

    Raises
    ------
    InputError
        If something about them is impossible, each taken for itself or all together.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> tool = ri.sample_tooling("S3-PG25-long")
    >>> print(tool)
    S3-PG25-long: 4 teeth, Ø12 mm, helix 30°, stickout 65.9 mm, insertion 44 mm, holder 100 mm
    >>> tool.cutter.teeth, round(1e3 * tool.assembly.stickout, 1)
    (4, 65.9)
    """

    name: str
    cutter: Cutter
    assembly: ToolAssembly
    spread: Spread = UNSTATED
    tool_model: str = ""
    holder_model: str = ""
    taper: str = ""
    tool_behind: tuple[BeamSegment, ...] = ()

    def __post_init__(self) -> None:
        proportions(self.assembly, self.cutter)

    @property
    def drawing(self) -> Drawing:
        """What its drawing says, and how well that is known."""
        return Drawing(self.assembly, self.spread, self.tool_model, self.holder_model)

    @property
    def whole_tool(self) -> tuple[BeamSegment, ...]:
        """The tool from its tip to its rear end, as it lies in the drawer."""
        return (*self.assembly.tool, *self.tool_behind)

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """What is unusual about it, as a wrong unit would make it, and what is assumed of it without a word on how well."""
        assumed = assumption(self.assembly, self.spread)
        return (*proportions(self.assembly, self.cutter), *(() if assumed is None else (assumed,)))

    def stated(self, parameter: str) -> str:
        """Return what a parameter of the drawing is and how well it is known, as in ``stickout, whose standard deviation is 0.05 mm``.

        Parameters
        ----------
        parameter : str
            Field of an `Alteration`, `IDENTIFIED` in front where records have told of it.
        """
        return stated(parameter, self.assembly.contact, self.spread)

    def __str__(self) -> str:
        return f"{self.name}: {self.cutter}, {self.assembly}"


class BareCutter(Tooling):
    """A cutter alone, where the tip of the tool that carries it is known by itself: from modes, tap tests or labelled cuts.

    Whoever asks for the tool and its holder is told that there are none.

    Parameters
    ----------
    name : str
    cutter : Cutter
    """

    def __init__(self, name: str, cutter: Cutter) -> None:
        fields: dict[str, Any] = {"name": name, "cutter": cutter, "spread": UNSTATED, "tool_model": "", "holder_model": ""}
        for field_name, value in fields.items():
            object.__setattr__(self, field_name, value)
        tuple(remarks_of(cutter.values))  # an impossible one is refused

    def __reduce__(self) -> tuple[type[BareCutter], tuple[str, Cutter]]:
        """Pickle without the assembly that it has not."""
        return type(self), (self.name, self.cutter)

    @property
    def assembly(self) -> ToolAssembly:
        """Nothing, and a sentence that says so."""
        raise InputError(
            f"tooling {self.name}", "[cutter] alone", "tables [tool] and [holder], too: only modes or FRFs of the tip need neither"
        )

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """What is unusual about the cutter."""
        return tuple(remarks_of(self.cutter.values))

    def __str__(self) -> str:
        return f"{self.name}: {self.cutter}"


@dataclass(frozen=True, slots=True, repr=False)
class Workpiece(Shown):
    """A material and its cutting coefficients with the campaign's cutters.

    Parameters
    ----------
    name : str
    coefficients : CuttingCoefficients
    edge_force_spread : float [N/m]
        How large edge forces of which nothing is told may be: they are positive, and as normally distributed. It counts where something
        of the campaign's drawings is not exact, too.
    """

    name: str
    coefficients: CuttingCoefficients
    edge_force_spread: float = 10e3

    def __str__(self) -> str:
        return f"{self.name}: {self.coefficients}"


@dataclass(frozen=True, slots=True, repr=False)
class CutSpec(Shown):
    """A cut that is asked about: all that a tooling and a workpiece leave open.

    Parameters
    ----------
    engagement : Immersion, Engagement, Block, Stepover or EngagementMap, default half immersion, down-milling
    feed_angle : float [rad], default 0
        Direction of the feed in the machine's X-Y plane, from +X towards +Y.
    feed_per_tooth : float or None [m]
        Power, torque, removal rate and run-out need it.
    material : str or None
        Of the library of materials, in place of the workpiece.
    coefficients : mapping of field of CuttingCoefficients to float [SI]
        Single ones, over those of the material or the workpiece.
    runout : tuple of float or None [m]
        Radial offset of each edge.
    damping : ProcessDamping or None
    speed_variation : SpeedVariation or None

    Examples
    --------
    >>> slot = CutSpec(Engagement.from_immersion(1.0, "down"), coefficients={"tangential": 9e8, "radial_ratio": 0.3})
    >>> slot.process(Cutter(teeth=4, diameter=0.012)).coefficients.tangential
    900000000.0
    """

    engagement: AskedEngagement = Immersion(0.5, "down")  # noqa: RUF009 - frozen
    feed_angle: float = 0.0
    feed_per_tooth: float | None = None
    material: str | None = None
    coefficients: Mapping[str, float] = field(default_factory=dict)
    runout: tuple[float, ...] | None = None
    damping: ProcessDamping | None = None
    speed_variation: SpeedVariation | None = None

    def __post_init__(self) -> None:
        FEED_ANGLE.checked("feed_angle", self.feed_angle)
        if self.feed_per_tooth is not None:
            FEED_PER_TOOTH.checked("feed_per_tooth", self.feed_per_tooth)
        for offset in self.runout or ():
            RUNOUT.checked("runout", offset)
        for name, value in self.coefficients.items():
            checked_coefficient(name, value)

    def process(self, cutter: Cutter, workpiece: Workpiece | None = None) -> MillingProcess:
        """Return the milling process with a cutter, in a workpiece where the cut names no material.

        Raises
        ------
        InputError
            If the cutting coefficients are not known, the run-out does not fit the teeth, or the cutter does not reach the stock.

        Examples
        --------
        >>> import rcsa_ident as ri
        >>> cut = ri.CutSpec(material="EN AW-6082", feed_per_tooth=0.1e-3)
        >>> print(cut.process(ri.sample_tooling("S1-ER32").cutter))
        4 teeth, Ø12 mm, helix 30°; K_tc 902 MPa, k_rc 0.26; 90° to 180°, feed +X, 0.1 mm per tooth
        """
        if self.runout is not None:
            if len(self.runout) != cutter.teeth:
                raise InputError("runout", f"{len(self.runout)} numbers", f"{cutter.teeth}, one for each tooth")
            cutter = replace(cutter, runout=np.array(self.runout))
        return MillingProcess(
            cutter,
            self._coefficients(workpiece),
            engagement_with(self.engagement, cutter),
            self.feed_angle,
            self.feed_per_tooth,
            self.damping,
            self.speed_variation,
        )

    def _coefficients(self, workpiece: Workpiece | None) -> CuttingCoefficients:
        if self.material is not None:
            return replace(material(self.material).coefficients, **self.coefficients)
        if workpiece is not None:
            return replace(workpiece.coefficients, **self.coefficients)
        for key, name in (("tangential", "tangential coefficient"), ("radial_ratio", "radial ratio")):
            if key not in self.coefficients:
                allowed = "the tangential coefficient and the radial ratio, or a material: without a campaign no workpiece is known"
                raise InputError(name, "nothing", allowed)
        return CuttingCoefficients(**self.coefficients)

    def __str__(self) -> str:
        parts = [str(self.engagement), f"feed {feed_direction(self.feed_angle)}"]
        parts += [] if self.feed_per_tooth is None else [f"{1e3 * self.feed_per_tooth:.3g} mm per tooth"]
        parts += [] if self.material is None else [self.material]
        parts += [f"{name} {value:.4g}" for name, value in self.coefficients.items()]
        parts += [] if self.runout is None else [f"run-out {1e6 * (max(self.runout) - min(self.runout)):.2g} µm"]
        return ", ".join([*parts, *(str(each) for each in (self.damping, self.speed_variation) if each is not None)])


def asked_cut(
    engagement: AskedEngagement, feed_angle: float, keys: Mapping[str, Any], speed_variation: SpeedVariation | None = None
) -> CutSpec:
    """Return the cut of keys of `ASKED_CUT`; how its cutter is engaged, and where it goes, each door tells in its own way."""
    told = told_in_si(ASKED_CUT, keys)
    wears = "wear_land" in told and "indentation" in told
    return CutSpec(
        engagement,
        feed_angle,
        told.get("feed_per_tooth"),
        told.get("material"),
        told_in_si(COEFFICIENTS, keys),
        told.get("runout"),
        ProcessDamping(told["indentation"], told["wear_land"], told["friction"]) if wears else None,
        speed_variation,
    )


@dataclass(frozen=True, slots=True, repr=False)
class Cut(Shown):
    """One cut, and the files that it was recorded in.

    Parameters
    ----------
    id : str
    tooling : str
        Key of the campaign's toolings.
    conditions : CuttingConditions
        As programmed; the true speed comes from the record.
    recording : Path
    air : Path or None
        The same speed without cutting.
    last_speed : float or None [rad/s]
        At which a pass ends whose speed changes evenly in time from that of `conditions`; None where the speed is kept. The feed per
        tooth is kept in either case.
    posture : tuple of float [rad]
        Of a robot's joints; empty on any other machine.
    started : datetime or None
        When its recording began.
    temperature : float or None [°C]
        Near the spindle's bearings.
    validation : bool
        It is predicted, and nothing is learned from it.
    """

    id: str
    tooling: str
    conditions: CuttingConditions
    recording: Path
    air: Path | None = None
    last_speed: float | None = None
    posture: tuple[float, ...] = ()
    started: datetime | None = None
    temperature: float | None = None
    validation: bool = False

    @property
    def speeds(self) -> tuple[float, float]:
        """First and last programmed speed [rad/s]."""
        first = self.conditions.spindle_speed
        return first, first if self.last_speed is None else self.last_speed

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """What is unusual about it, as a wrong unit would make it."""
        c = self.conditions
        return tuple(
            remarks_of(
                (
                    ("spindle_speed_rpm", SPINDLE_SPEED, c.spindle_speed),
                    ("axial_depth_mm", AXIAL_DEPTH, c.axial_depth),
                    ("feed_per_tooth_mm", FEED_PER_TOOTH, c.feed_per_tooth),
                    *((("radial immersion", IMMERSION, c.engagement.immersion),) if isinstance(c.engagement, Engagement) else ()),
                )
            )
        )

    def __str__(self) -> str:
        last = "" if self.last_speed is None else f", to {to_rpm(self.last_speed):.0f} rev/min"
        return f"{self.id}: {self.tooling}, {self.conditions}{last}{'' if self.air else ', no air cut'}"


@dataclass(frozen=True, slots=True, repr=False)
class HammerTest(Shown):
    """A receptance that a hammer has shown: of two points of a clamped tool, or of one and the machine's side of the flange.

    Parameters
    ----------
    id : str
    tooling : str
        Key of the campaign's toolings.
    axis : Dof
        X or Y, of response and force.
    response, force : float or None [m]
        Distance of the point from the tip; None is the machine's side of the flange, where the cuts' sensors look.
    file : Path
    record : int or None
        Number of the FRF in the file, from 1, where it holds several.
    units : str or None
        Of a file that does not tell its own, as ``um/N``.
    standstill : bool, default True
        The spindle did not turn.
    sensor_mass : float, default 0 [kg]
        Fixed to the tool-holder where the response is measured.
    band : (float, float) [Hz]
        Lines that are used.
    error : float [-]
        Standard deviation of each line beside its noise, as a share.
    correction : Correction
        Of an FRF that was measured with a reversed sensor, or written conjugated.
    """

    id: str
    tooling: str
    axis: Dof
    response: float | None
    force: float | None
    file: Path
    record: int | None = None
    units: str | None = None
    standstill: bool = True
    sensor_mass: float = 0.0
    band: tuple[float, float] = (0.0, np.inf)
    error: float = 0.02
    correction: Correction = Correction.AUTO

    def __str__(self) -> str:
        points = (
            "the flange" if z is None else "the tip" if z == 0.0 else f"{1e3 * z:g} mm from the tip" for z in (self.response, self.force)
        )
        return f"{self.id}: {self.tooling}, {self.axis.upper()}, {' for a force at '.join(points)}"


@dataclass(frozen=True, slots=True, repr=False)
class Campaign(Shown):
    """Recordings of one machine, hammer tests beside them or in their place.

    Parameters
    ----------
    sampling_rate : float or None [Hz]
        For files that carry none.
    workpiece : Workpiece or None
        None of hammer tests alone.
    clock_error : float, default 0
        By what share the recorder's clock runs fast: it takes that many more samples in a second than its files say.
    tests : tuple of HammerTest
    depth_spread : float [m]
        Standard deviation of the axial depth, the same in all cuts of a tooling. It counts where something of the drawings is not exact.
    softening_spread : float [-]
        Standard deviation of the stiffness' change from the middle to the end of the speeds, as a share.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> campaign = ri.read_campaign("data/sample_runs")
    >>> cut = campaign.cuts[0]
    >>> cut.id, cut.tooling, round(cut.conditions.spindle_speed, 1)
    ('S1-ER32-00', 'S1-ER32', 837.8)
    >>> print(campaign.workpiece)
    EN AW-6082: K_tc 902 MPa, k_rc 0.26
    """

    name: str
    sampling_rate: float | None
    sensors: tuple[Sensor, ...]
    workpiece: Workpiece | None
    toolings: Mapping[str, Tooling]
    cuts: tuple[Cut, ...]
    clock_error: float = 0.0
    tests: tuple[HammerTest, ...] = ()
    depth_spread: float = 0.02e-3
    softening_spread: float = 0.03

    @property
    def coefficients(self) -> CuttingCoefficients:
        """The workpiece's cutting coefficients, with the edge forces that are to be expected where nothing is told of any.

        Raises
        ------
        InputError
            There is no workpiece.
        """
        if self.workpiece is None:
            raise InputError("workpiece", "nothing", "a table [workpiece] in the campaign of cuts")
        told, edge = self.workpiece.coefficients, HALF_NORMAL * self.workpiece.edge_force_spread
        if not self.rough or told.tangential_edge or told.radial_edge or edge == 0.0:
            return told
        return replace(told, tangential_edge=edge, radial_edge=edge, edge_spread=HALF_NORMAL_SPREAD)

    @property
    def rough(self) -> bool:
        """Whether some of its drawings say that they are not exact."""
        return any(not tooling.spread.exact for tooling in self.toolings.values())

    def clocked(self, recording: Recording) -> Recording:
        """Return a recording whose rate is that at which its samples were truly taken."""
        return recording if self.clock_error == 0.0 else replace(recording, rate=recording.rate * (1.0 + self.clock_error))

    def cylinder_remarks(self, used: Collection[str]) -> tuple[Remark, ...]:
        """Return what to make of forces that took cutters for cylinders, for each tooling of the cuts of these ids."""
        found = []
        for name, tooling in self.toolings.items():
            depths = [cut.conditions.axial_depth for cut in self.cuts if cut.tooling == name and cut.id in used]
            if depths:
                found += [remark.of(name) for remark in tooling.cutter.cylinder_remarks(min(depths), forces=True)]
        return tuple(found)

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """What is unusual about its toolings, workpiece, sensors and cuts; of cuts that share a remark it names the first."""
        found = [remark.of(name) for name, tooling in self.toolings.items() for remark in tooling.remarks]
        if self.workpiece is not None:
            found += [remark.of(self.workpiece.name) for remark in self.workpiece.coefficients.remarks]
        found += untold_distances(self.sensors)
        cuts: dict[Remark, list[str]] = {}
        for cut in self.cuts:
            for remark in cut.remarks:
                cuts.setdefault(remark, []).append(cut.id)
        for remark, names in cuts.items():
            found.append(remark.of(names[0] + (f" and {len(names) - 1} more" if len(names) > 1 else "")))
        return tuple(found)

    def __str__(self) -> str:
        speeds = to_rpm(np.array([cut.speeds for cut in self.cuts]))
        counted = [f"{len(self.cuts)} cuts"] * bool(self.cuts or not self.tests) + [f"{len(self.tests)} hammer tests"] * bool(self.tests)
        made = f"{self.name}: {' and '.join(counted)} with {', '.join(self.toolings)}"
        if not speeds.size or self.workpiece is None:
            return made
        return f"{made}, {speeds.min():.0f} to {speeds.max():.0f} rev/min, {self.workpiece.name}"
