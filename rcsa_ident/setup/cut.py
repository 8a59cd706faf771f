"""A cut that was made, or that somebody asks about, and what it is made in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import AXIAL_DEPTH, FEED_ANGLE, FEED_PER_TOOTH, IMMERSION, RUNOUT, SPINDLE_SPEED, TEMPERATURE, remarks_of
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.shown import Shown
from rcsa_ident.base.units import to_rpm
from rcsa_ident.cutting.coefficients import CuttingCoefficients, ForceLaw, checked_coefficient
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement, feed_direction
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.materials import material
from rcsa_ident.cutting.process import MillingProcess, ProcessDamping, SpeedVariation
from rcsa_ident.cutting.stock import AskedEngagement, Immersion, engagement_with
from rcsa_ident.setup.fields import ASKED_CUT, COEFFICIENTS, told_in_si


@dataclass(frozen=True, slots=True, repr=False)
class Workpiece(Shown):
    """A material and its cutting coefficients with the campaign's cutters.

    `edge_force_spread` [N/m]: how large edge forces of which nothing is told may be: they are positive, and as normally distributed. It
        counts where something of the campaign's drawings is not exact, too.
    `law`: what cuts have shown of their forces beyond these coefficients; None where they have shown nothing
    """

    name: str
    coefficients: CuttingCoefficients
    edge_force_spread: float = 10e3
    law: ForceLaw | None = None

    def at(self, feed: float | None) -> CuttingCoefficients:
        """Return the coefficients at a feed per tooth [m]."""
        return self.coefficients if self.law is None else self.law.line(self.coefficients, feed)

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
            return replace(workpiece.at(self.feed_per_tooth), **self.coefficients)
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

    `tooling`: key of the campaign's toolings
    `conditions`: as programmed; the true speed comes from the record
    `air`: the same speed without cutting
    `last_speed` [rad/s]: at which a pass ends whose speed changes evenly in time from that of `conditions`; None where the speed is kept.
        The feed per tooth is kept in either case.
    `posture`: tuple of float [rad], of a robot's joints; empty on any other machine
    `started`: datetime or None, when its recording began
    `temperature` [°C]: near the spindle's bearings
    `validation`: it is predicted, and nothing is learned from it
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
                    *((("temperature_c", TEMPERATURE, self.temperature),) if self.temperature is not None else ()),
                    *((("radial immersion", IMMERSION, c.engagement.immersion),) if isinstance(c.engagement, Engagement) else ()),
                )
            )
        )

    def __str__(self) -> str:
        last = "" if self.last_speed is None else f", to {to_rpm(self.last_speed):.0f} rev/min"
        return f"{self.id}: {self.tooling}, {self.conditions}{last}{'' if self.air else ', no air cut'}"
