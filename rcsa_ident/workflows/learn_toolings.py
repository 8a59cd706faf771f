"""One cut or one tap of a new tool: what further cuts and hits of a machine that is known tell of the toolings that were clamped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import CONTACT
from rcsa_ident.base.units import to_hz, to_rpm
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.hammer_lines import FEWEST_LINES, HammerLines
from rcsa_ident.identification.machine import IdentifiedMachine
from rcsa_ident.identification.machine_prior import KnownMachine
from rcsa_ident.identification.posterior import MachineAxis
from rcsa_ident.identification.tooling_update import FurtherFit, fit_further
from rcsa_ident.machine.spindle import Spindle
from rcsa_ident.setup.campaign import Campaign, HammerTest
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.signals.measurement import Reading
from rcsa_ident.tool_holder.alteration import ALTERATIONS, Alteration, altered, fluted_segments
from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.tool_holder.spread import SPREAD_FIELDS
from rcsa_ident.workflows.identify import data_to_learn_from

#: Standard deviations by which something drawn may be off before a cut is said to contradict its drawing.
SURPRISING = 4.0
#: Share of a cut's or a hit's lines that is left unexplained beyond which no tooling near its drawing has made it.
UNEXPLAINED = 0.1
#: Field of an alteration to that of a `Spread`, where they have not the same name.
_SPREAD_OF = {
    "fluted_length": "segment_length",
    **{f"{way}_{what}": f"contact_{what}" for way in ("translational", "rotational") for what in ("stiffness", "damping")},
}


_LENGTHS = ("stickout", "fluted_length")
_WORDS = {
    "stickout": ("stickout", "mm"),
    "fluted_length": ("fluted length", "mm"),
    "fluted_diameter": ("fluted diameter", "mm"),
    "youngs_modulus": ("Young's modulus of the tool", "GPa"),
    "holder_diameter": ("holder diameter at its front", "mm"),
    **{name: (f"{name.replace('_', ' ')} of the contact", kind.unit) for name, kind in CONTACT.items()},
}


@dataclass(frozen=True, slots=True)
class Learnt:
    """A number of a drawing before and after cuts, with its standard deviations, in `unit`."""

    what: str
    unit: str
    drawn: float
    drawn_std: float
    found: float
    found_std: float


@dataclass(frozen=True, slots=True)
class LearntTooling:
    """A tooling before and after its cuts and hits.

    `tooling`: with the most probable values and what is left open of them. It belongs to no model any more: what is known of its model is
        in it.
    `by`: how it differs from its drawing
    `deviation`, `before`: standard deviations of that, after the cuts and before; 0 where the drawing is exact
    `contradiction`: what speaks against it; empty where nothing does
    """

    drawn: Tooling
    tooling: Tooling
    by: Alteration
    deviation: Alteration
    before: Alteration
    contradiction: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class LearntToolings:
    """What further cuts have told.

    `keys`: the campaign's for each of them
    `machine`: as these cuts have taught it, too
    `model_error`: tuple of float [-], share of the lines of each axis that is left unexplained
    """

    toolings: tuple[LearntTooling, ...]
    keys: tuple[str, ...]
    machine: IdentifiedMachine
    model_error: tuple[float, ...]
    converged: bool
    notes: tuple[str, ...] = ()

    @property
    def good(self) -> bool:
        """Whether nothing speaks against it."""
        return self.converged and not any(each.contradiction for each in self.toolings)


def learn_toolings(
    machine: IdentifiedMachine, campaign: Campaign, readings: Sequence[Reading], tests: Sequence[HammerLines] = ()
) -> LearntToolings:
    """Return what the usable cuts of a campaign and hits of the tip tell of its toolings, on a machine that earlier cuts have told.

    `machine`: its posterior is what is known of it before
    `campaign`: of toolings that are new to the machine; one stable cut of each, or one hit of its tip along X and Y, is enough
    `readings`: as `rcsa_ident.workflows.identify.judge` returns them
    `tests`: as `rcsa_ident.workflows.identify.hammer_lines` returns those of the campaign
    Raises `InputError` if machine, toolings or cuts do not tell what is needed.
    """
    known = KnownMachine(machine.posteriors(), machine.toolings)
    taps = [tap_lines(test, machine.band) for test in tests]
    used = list(dict.fromkeys([*(each.tooling for each in readings if each.verdict.usable), *(tap.tooling for tap in taps)]))
    for name in used:
        if campaign.toolings[name].spread.exact:
            raise InputError("spread", f"{name}: a drawing that is exact", "a table [spread] in its file, empty for an honest drawing's")
        if machine.toolings is not None and name in machine.toolings.toolings:
            allowed = "a tooling that is new to the machine, under a name of its own; cuts of old ones go into a new identification"
            raise InputError("toolings", f"{name}, which the machine was identified with", allowed)
    data = data_to_learn_from(campaign, readings, taps, machine.toolings)
    if not data.of_flange:
        raise InputError("sensors", "accelerometers on the housing alone", "cuts whose displacement sensors see the flange")
    if data.sweeps:
        raise InputError("cuts", "passes whose speed changes", "cuts at a speed that is kept")
    fit = fit_further(data, known, max(campaign.toolings[name].spread.spindle_joint for name in used))
    assumed = dict.fromkeys(remark for test in tests for remark in test.remarks)
    notes = [*assumed, *_speed_notes(known, data.spindle_speed[: data.cuts].tolist())]
    missing = fit.contradicting()
    notes += [f"{name}: contradicts the cuts and counts as little as it explains" for name in missing if name in data.cut_ids[data.cuts :]]
    out = [name for name in missing if name in data.cut_ids[: data.cuts]]
    if out:
        notes.append(f"{', '.join(out)}: contradicts the other cuts and was left out")
        keep = np.array([k for k, name in enumerate(data.cut_ids) if name not in out], dtype=np.intp)
        fit = fit_further(data.of_cuts(keep), known, max(campaign.toolings[name].spread.spindle_joint for name in used))
    toolings = tuple(_learnt(campaign.toolings[name], fit, k) for k, name in enumerate(data.toolings))
    taught = _taught(machine, fit.machine(known, [each.drawn.name for each in toolings]))
    return LearntToolings(toolings, data.toolings, taught, fit.misfit.model_error, fit.solution.converged, tuple(notes))


def campaign_of_taps(tooling: Tooling, pairs: Sequence[tuple[str, str]], sensor_mass: float = 0.0) -> Campaign:
    """Return a campaign of hits of one tooling's tip, the spindle at standstill.

    `pairs`: sequence of (str, str); axes of response and force of each hit, X or Y
    `sensor_mass` [kg]: of the sensor at the tip
    Raises `InputError` if there are none, or one along other axes or with two.
    """
    for response, force in pairs:
        if response != force or response not in ("X", "Y"):
            raise InputError("taps", f"response {response or '?'} and force {force or '?'}", "FRFs along X or Y, response and force alike")
    if not pairs:
        raise InputError("taps", "no FRF", "one of the tip, along X or Y")
    tests = tuple(
        HammerTest(f"tap {axis}", tooling.name, Dof(axis.lower()), 0.0, 0.0, Path(), sensor_mass=sensor_mass) for axis, _ in pairs
    )
    return Campaign(f"taps of {tooling.name}", None, (), None, {tooling.name: tooling}, (), tests=tests)


def tap_lines(test: HammerLines, band: tuple[float, float]) -> HammerLines:
    """Return the lines of a hit of the tip where the machine is known, without the mass of the sensor at the tip.

    A sensor of mass m at the driven point adds its inertia there, 1/H' = 1/H - w^2 m: so H = H'/(1 + w^2 m H') [ewins2000].

    `band`: (float, float) [rad/s]; lowest and highest frequency at which the machine is known
    Raises `InputError`: force or response is not at the tip, or too few lines lie in the band.
    """
    for name in ("response", "force"):
        z = getattr(test, name)
        if z != 0.0:
            found = "the flange" if z is None else f"{1e3 * z:g} mm from the tip"
            raise InputError(f"frfs.{name}", f"{test.id}: {found}", 'force and response at the tip, "tip" both')
    own = (test.omega >= band[0]) & (test.omega <= band[1])
    count = int(np.sum(own))
    if count < FEWEST_LINES:
        found = f"{test.id}: {count} lines from {to_hz(band[0]):.0f} to {to_hz(band[1]):.0f} Hz"
        raise InputError("frfs", found, f"at least {FEWEST_LINES} where the machine is known")
    omega, value = test.omega[own], test.value[own]
    bare = 1.0 / (1.0 + omega**2 * test.sensor_mass * value)
    return replace(test, omega=omega, value=value * bare, variance=test.variance[own] * np.abs(bare) ** 4, sensor_mass=0.0)


def _learnt(drawn: Tooling, fit: FurtherFit, place: int) -> LearntTooling:
    rough = fit.data.rough
    assert rough is not None
    by = rough.alteration(place, fit.values)
    weights = rough.weights[place] * rough.spread

    def deviations(covariance: FloatArray) -> Alteration:
        return Alteration(*np.sqrt(np.einsum("fu,uv,fv->f", weights, covariance, weights)).tolist())

    after, before = deviations(fit.covariance), deviations(fit.before[1])
    spread = {name: getattr(drawn.spread, name) for name in SPREAD_FIELDS}
    for name in ("stickout", "fluted_diameter", "youngs_modulus", "holder_diameter"):
        spread[name] = getattr(after, name)
    for name in set(_SPREAD_OF.values()):
        # the file has one number for translation and rotation: the larger one is honest
        spread[name] = max(getattr(after, field) for field, of in _SPREAD_OF.items() if of == name)
    assembly = altered(drawn.assembly, by)
    tooling = replace(drawn, assembly=assembly, spread=type(drawn.spread)(**spread), tool_model="", holder_model="")
    return LearntTooling(drawn, tooling, by, after, before, _contradiction(fit, place))


def _contradiction(fit: FurtherFit, place: int) -> str:
    """What speaks against what the cuts and hits of a tooling have told of it."""
    own = [place == tooling for tooling in fit.data.cut_tooling.tolist()]
    cut, hit = any(own[: fit.data.cuts]), any(own[fit.data.cuts :])
    what = "cuts and taps" if cut and hit else "taps" if hit else "cuts"
    unexplained, moved = max(fit.misfit.model_error), fit.surprise(place)
    if unexplained > UNEXPLAINED:
        return f"no tooling near its drawing explains its {what}: {100.0 * unexplained:.0f} % of their lines are left over"
    if moved > SURPRISING:
        return f"its {what} ask for {moved:.1f} standard deviations of what its drawing leaves open: is it the tooling that was clamped?"
    return ""


def _speed_notes(known: KnownMachine, speeds: list[float]) -> list[str]:
    middle, half = known.speed_range
    beyond = [speed for speed in speeds if half and abs(speed - middle) > 1.02 * half]
    if not beyond:
        return []
    low, high = to_rpm(middle - half), to_rpm(middle + half)
    return [f"{to_rpm(beyond[0]):.0f} rev/min lies outside the speeds that the machine was identified at, {low:.0f} to {high:.0f} rev/min"]


def _taught(machine: IdentifiedMachine, known: KnownMachine) -> IdentifiedMachine:
    """The machine with another posterior; what single ranges of speed said for themselves is not in it."""
    axes = {}
    for axis, posterior in known.posteriors.items():
        modes, joint = posterior.machine(axis)
        axes[axis] = MachineAxis(Spindle(modes), joint, posterior)
    return replace(machine, identified=axes, toolings=known.toolings, speed_models=(), kept_sides=())


def told(learnt: LearntTooling) -> list[Learnt]:
    """Return what was learned of each number that a drawing leaves open, in the drawing's terms and units."""
    return [_row(learnt, field) for field in ALTERATIONS if getattr(learnt.before, field) > 0.0]


def learnt_row(found: LearntToolings) -> dict[str, Any]:
    """Return what further cuts have told as commands and service tell it, in the drawings' terms."""
    toolings = [
        {"name": each.drawn.name, "contradiction": each.contradiction, "learned": [asdict(row) for row in told(each)]}
        for each in found.toolings
    ]
    status = "converged" if found.good else "suspect" if found.converged else "not-converged"
    return {"status": status, "toolings": toolings, "model_error": list(found.model_error), "notes": list(found.notes)}


def _row(learnt: LearntTooling, field: str) -> Learnt:
    drawn, found = learnt.drawn.assembly, learnt.tooling.assembly
    flutes = fluted_segments(drawn.tool)

    def value(assembly: ToolAssembly) -> float:
        sizes = {
            "stickout": 1e3 * assembly.stickout,
            "fluted_length": 1e3 * sum(segment.length for segment in assembly.tool[:flutes]),
            "fluted_diameter": 1e3 * assembly.tool[max(flutes - 1, 0)].diameter,
            "youngs_modulus": 1e-9 * assembly.tool[-1].material.youngs_modulus,
            "holder_diameter": 1e3 * assembly.holder[0].diameter,
        }
        return sizes[field] if field in sizes else float(getattr(assembly.contact, field))

    what, unit = _WORDS[field]
    before, after, was, is_ = getattr(learnt.before, field), getattr(learnt.deviation, field), value(drawn), value(found)
    # lengths have a deviation in metres, all else one of its logarithm
    return Learnt(
        what, unit, was, 1e3 * before if field in _LENGTHS else was * before, is_, 1e3 * after if field in _LENGTHS else is_ * after
    )
