"""A tooling learned from how it rings: lines heard are matched to its free modes, and what its drawing does not tell gets a posterior.

Unknowns are those of `Alteration` and the density of the tool, with the drawing's `Spread` as priors. The match is the assignment of
lines to modes with the largest evidence under the linearised prior; then Gauss-Newton finds the maximum of the posterior. The finite
elements' own error (nuts, grooves, slots) is part of the likelihood.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.stats

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.shown import Shown
from rcsa_ident.base.units import from_hz, to_hz
from rcsa_ident.identification.ring.line_matching import Heard, Match, Predicted, gathered, matched
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.signals.sound.ring_down import RingDown
from rcsa_ident.tool_holder.alteration import ALTERATIONS, Alteration, altered, fluted_segments
from rcsa_ident.tool_holder.free_modes import FreeMode, Motion, bare, bending_modes, denser, rod_modes
from rcsa_ident.tool_holder.geometry import BeamSegment, ToolAssembly
from rcsa_ident.tool_holder.spread import Spread
from rcsa_ident.tool_holder.taper import hung

#: Unknowns: those of an alteration, and the logarithm of the tool's density over the drawn one.
UNKNOWNS = (*ALTERATIONS, "density")
#: Standard deviation of the density of carbide, 14.0 to 14.9 g/cm^3 from grade to grade, of a drawing that is not exact in its modulus.
DENSITY = 0.02
#: Own error of the finite elements in a frequency, of the first mode of a tool-holder and of higher ones, and of a tool alone.
MODEL, MODEL_HIGHER, MODEL_BARE = 0.005, 0.01, 0.0015
#: Own error in a damping ratio, as a share; what string and air add to it [-].
DAMPING, HUNG = 0.1, 2e-4
#: A weighed mass: of the balance; of a fluted part's area that is drawn as an equivalent diameter.
WEIGHED, FLUTES = 1e-3, 0.03
#: A tool alone that decays faster than so is held by something.
FREE = 4e-3
#: A mass is refused beyond so many standard deviations; a fit below the first probability is another tool's, below the second suspect.
_MASS_STD, ANOTHER, SUSPECT = 5.0, 1e-4, 0.02
#: Bending modes that are looked for, and steps of Gauss-Newton.
_MODES, _STEPS = 5, 8
#: Frequencies up to which lines are matched [Hz]: above, a chuck's modes are dead, and its drawing is too coarse.
_HIGHEST, _HIGHEST_BARE = 12e3, 25e3
#: Modes are computed so many times farther: those below move with the unknowns.
_MARGIN = 1.5
_STEP = 0.05
_PER_GROUP = {
    "stickout": "stickout", "fluted_length": "segment_length", "fluted_diameter": "fluted_diameter", "youngs_modulus": "youngs_modulus",
    "translational_stiffness": "contact_stiffness", "rotational_stiffness": "contact_stiffness",
    "translational_damping": "contact_damping", "rotational_damping": "contact_damping", "holder_diameter": "holder_diameter",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class RungLine:
    """A line that was heard, and what it is.

    `bare`: of the tool alone
    `mode`: as drawn; None where it is none of the modes
    `after` [rad/s]: the same mode's frequency after learning
    `damping_after` [-]
    """

    bare: bool
    heard: Heard
    mode: FreeMode | None
    after: float | None = None
    damping_after: float | None = None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RungTooling(Shown):
    """What rings tell of a tooling.

    Parameters
    ----------
    before, after : Tooling
        With the spread that was believed, and the one that is left.
    lines : tuple of RungLine
    mean : array, shape (11,)
        Of `UNKNOWNS`, in their units.
    prior_std : array, shape (11,)
    covariance : array, shape (11, 11)
    probability : float [-]
        Of a misfit as large as this or larger, were drawing and spread as told.
    remarks : tuple of str

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> rung = ri.ring("DRAWN.toml", "whole.wav")
    >>> fluted = [each.assembly.tool[0].diameter for each in (rung.before, rung.after)]
    >>> [round(1e3 * diameter, 2) for diameter in fluted]
    [9.6, 9.73]
    """

    before: Tooling
    after: Tooling
    lines: tuple[RungLine, ...]
    mean: FloatArray
    prior_std: FloatArray
    covariance: FloatArray
    probability: float
    remarks: tuple[str, ...] = ()

    @property
    def suspect(self) -> bool:
        """Whether drawing, spread and rings hardly go together."""
        return self.probability < SUSPECT

    @property
    def std(self) -> FloatArray:
        """Standard deviations of `UNKNOWNS` after the rings, shape (11,)."""
        return np.sqrt(np.diag(self.covariance))

    def drawn(self, rng: np.random.Generator, count: int) -> list[ToolAssembly]:
        """Return assemblies drawn from the posterior.

        Parameters
        ----------
        rng : Generator
        count : int
        """
        draws = rng.multivariate_normal(self.mean, self.covariance, count, method="eigh")
        return [_assembly(self.before.assembly, each) for each in draws]

    def __str__(self) -> str:
        known = [str(line.mode) for line in self.lines if line.mode is not None]
        return f"{self.after.name}: {', '.join(known)} of {len(self.lines)} lines; {'suspect' if self.suspect else 'good'}"


@dataclass(frozen=True, slots=True, eq=False)
class _Observed:
    """Numbers that were observed, as a function of the unknowns predicts them: logarithms of frequencies, damping ratios, a mass."""

    value: FloatArray
    std: FloatArray
    predict: Callable[[FloatArray], FloatArray]


def learned(tooling: Tooling, heard: RingDown | None, bare_tool: RingDown | None = None, mass: float | None = None) -> RungTooling:
    """Return what rings of a tooling, of its tool alone and the tool's mass tell together.

    `tooling`: as drawn; one without a spread is taken as an honest drawing
    `heard`: of the tool in its holder, hanging free
    `bare_tool`: of the tool alone
    `mass` [kg]: of the tool alone
    Raises `InputError`: nothing was heard of it, it is another tool that rings, or the mass is another tool's.
    """
    remarks = []
    if tooling.spread.exact:
        tooling = replace(tooling, spread=Spread())
        remarks.append("the drawing has no [spread]: that of an honest drawing is taken")
    if heard is not None and not tooling.taper:
        remarks.append("the holder has no taper told: it is taken to end at its flange")
    prior = prior_std(tooling)
    free = np.flatnonzero(prior)
    if not free.size:
        raise InputError("spread", "0 of everything", "a drawing that leaves something to be learned")
    observed: list[_Observed] = []
    if mass is not None:
        observed.append(_weighed(tooling, mass, prior))
    lines: list[RungLine] = []
    # the tool alone comes first: what it tells sharpens what is expected of the whole
    if bare_tool is not None:
        doubt = [line for line in bare_tool.modes if line.damping > FREE]
        if doubt and len(doubt) == len(bare_tool.modes):
            remarks.append(
                f"the tool alone decays with {100.0 * doubt[0].damping:.2g} %, more than {100.0 * FREE:g} %: something holds it, or the "
                "recording is of another thing"
            )
        body = _Body(tooling, True)
        found, seen = _match(body, bare_tool, prior, free, observed)
        lines += found
        observed.append(seen)
    if heard is not None:
        if heard.damping_doubt:
            remarks.append(f"{heard.damping_doubt}: frequencies are used, damping is not")
        body = _Body(tooling, False)
        found, seen = _match(body, heard, prior, free, observed)
        lines += found
        observed.append(seen)
    mean, covariance, misfit = _posterior(observed, prior, free)
    probability = float(scipy.stats.chi2.sf(misfit, sum(each.value.size for each in observed)))
    if probability < ANOTHER:
        names = ", ".join(
            f"{to_hz(line.heard.omega):.0f} Hz" for line in lines if line.mode is not None and line.mode.motion is Motion.BENDING
        )
        raise InputError(
            "recording", f"{names or 'a mass'}, which this drawing within its spread does not give", "the ring of this very tooling"
        )
    lines = [_after(line, tooling, mean) for line in lines]
    after = _after_ring(tooling, mean, prior, covariance)
    return RungTooling(tooling, after, tuple(lines), frozen(mean), frozen(prior), frozen(covariance), probability, tuple(remarks))


def prior_std(tooling: Tooling) -> FloatArray:
    """Return the standard deviations of `UNKNOWNS` as the drawing's spread tells them, shape (11,); 0 of what is exact or not there."""
    spread, assembly = tooling.spread, tooling.assembly
    std = dict.fromkeys(UNKNOWNS, 0.0) | {name: getattr(spread, group) for name, group in _PER_GROUP.items()}
    contact = assembly.contact
    for name in ("translational_stiffness", "rotational_stiffness", "translational_damping", "rotational_damping"):
        # this very clamping is heard
        told = contact is not None and getattr(contact, name) > 0.0 and std[name] > 0.0
        std[name] = float(np.hypot(std[name], spread.reclamping)) if told else 0.0
    if not fluted_segments(assembly.tool):
        std["fluted_diameter"] = std["fluted_length"] = 0.0
    std["density"] = DENSITY if spread.youngs_modulus else 0.0
    return np.array([std[name] for name in UNKNOWNS])


def _assembly(assembly: ToolAssembly, unknowns: FloatArray) -> ToolAssembly:
    by = Alteration(**dict(zip(ALTERATIONS, (float(v) for v in unknowns[:-1]), strict=True)))
    assembly = altered(assembly, by)
    return replace(assembly, tool=denser(assembly.tool, float(unknowns[-1])))


def _whole_tool(tooling: Tooling, unknowns: FloatArray) -> tuple[BeamSegment, ...]:
    """The tool alone; how far it stands out does not alter it."""
    inside = unknowns.copy()
    inside[UNKNOWNS.index("stickout")] = 0.0
    modulus = float(np.exp(unknowns[UNKNOWNS.index("youngs_modulus")]))
    rear = [replace(s, material=replace(s.material, youngs_modulus=s.material.youngs_modulus * modulus)) for s in tooling.tool_behind]
    front = _assembly(tooling.assembly, inside).tool
    *whole, last = (*front, *denser(rear, float(unknowns[-1])))
    if len(rear) == 1 and rear[0].diameter == front[-1].end == rear[0].end:
        # one shank that the insertion divides
        return (*front[:-1], replace(last, length=front[-1].length + last.length))
    return (*whole, last)


@dataclass(frozen=True, slots=True)
class _Body:
    """What rings: the tooling with its taper, or the tool alone."""

    tooling: Tooling
    bare: bool

    def at(self, unknowns: FloatArray) -> ToolAssembly:
        if self.bare:
            return bare(_whole_tool(self.tooling, unknowns))
        return hung(_assembly(self.tooling.assembly, unknowns), self.tooling.taper)

    def modes(self, unknowns: FloatArray, count: int, highest: float) -> tuple[FreeMode, ...]:
        return bending_modes(self.at(unknowns), count, _MARGIN * highest)


def _match(
    body: _Body, heard: RingDown, prior: FloatArray, free: np.ndarray, known: Sequence[_Observed]
) -> tuple[list[RungLine], _Observed]:
    """What each line is, and those that are bending modes as observations."""
    mean, covariance, _ = _posterior(known, prior, free)
    highest = min(to_hz(heard.highest), _HIGHEST_BARE if body.bare else _HIGHEST)
    drawn = [mode for mode in body.modes(mean, _MODES, highest) if mode.omega < from_hz(highest)]
    what = "the tool alone" if body.bare else "this tooling"
    if not drawn:
        lowest = to_hz(body.modes(mean, 1, 20e3)[0].omega)
        raise InputError(
            "sampling_rate_hz", f"{to_hz(heard.highest) / 0.45:.0f}", f"at least {lowest / 0.4:.0f} [Hz]: {what} rings at {lowest:.0f} Hz"
        )
    predict = _frequencies_and_damping(body, len(drawn), highest)
    jacobian = _jacobian(predict, mean, prior, free)
    spread = jacobian @ covariance[np.ix_(free, free)] @ jacobian.T
    count = len(drawn)
    use_damping = not body.bare and not heard.damping_doubt and all(mode.damping is not None for mode in drawn)
    model = np.array([MODEL_BARE] * count if body.bare else [MODEL] + [MODEL_HIGHER] * (count - 1))
    predicted = Predicted(predict(mean), spread, model, use_damping)
    rods = [mode for motion in (Motion.AXIAL, Motion.TORSION) for mode in rod_modes(body.at(mean), motion, highest)]
    groups = gathered([line for line in heard.modes if line.omega < from_hz(highest)], body.tooling.cutter.teeth)
    match = matched(predicted, groups, rods, 0.03 if body.bare else 0.1)
    if match is None or not any(place is not None for place in match.bending):
        first = drawn[0]
        band = to_hz(first.omega) * np.sqrt(spread[0, 0] + model[0] ** 2)
        found = ", ".join(f"{to_hz(group.omega):.0f}" for group in groups)
        raise InputError(
            "recording",
            f"a ring of {found} Hz",
            f"one of {what}, which the drawing expects at {to_hz(first.omega):.0f} ± {band:.0f} Hz first: it is another one that rings",
        )
    return _lines(body.bare, groups, match, drawn, rods), _observed(predict, groups, match, predicted, count)


def _lines(bare_: bool, groups: Sequence[Heard], match: Match, drawn: Sequence[FreeMode], rods: Sequence[FreeMode]) -> list[RungLine]:
    lines = []
    for i, group in enumerate(groups):
        place, rod = match.bending[i], match.rods[i]
        lines.append(RungLine(bare_, group, drawn[place] if place is not None else rods[rod] if rod is not None else None))
    return lines


def _observed(
    predict: Callable[[FloatArray], FloatArray], groups: Sequence[Heard], match: Match, predicted: Predicted, count: int
) -> _Observed:
    pairs = [(i, place) for i, place in enumerate(match.bending) if place is not None]
    value = [float(np.log(groups[i].omega)) for i, _ in pairs]
    std = [float(np.hypot(predicted.model[place], groups[i].omega_std / groups[i].omega)) for i, place in pairs]
    rows = [place for _, place in pairs]
    if predicted.damping:
        value += [float(np.log(groups[i].damping)) for i, _ in pairs]
        std += [damping_std(groups[i]) for i, _ in pairs]
        rows += [count + place for _, place in pairs]
    return _Observed(np.array(value), np.array(std), lambda unknowns: predict(unknowns)[rows])


def damping_std(heard: Heard) -> float:
    """Return the standard deviation of the logarithm of a damping ratio that was heard, model and hanging included [-]."""
    return float(np.sqrt(DAMPING**2 + (heard.damping_std / heard.damping) ** 2 + (HUNG / heard.damping) ** 2))


def _frequencies_and_damping(body: _Body, count: int, highest: float) -> Callable[[FloatArray], FloatArray]:
    def predict(unknowns: FloatArray) -> FloatArray:
        modes = body.modes(unknowns, count, highest)
        return np.log([*(mode.omega for mode in modes), *(max(mode.damping or 0.0, 1e-6) for mode in modes)])

    return predict


def _weighed(tooling: Tooling, mass: float, prior: FloatArray) -> _Observed:
    """The tool's mass as an observation."""

    def predict(unknowns: FloatArray) -> FloatArray:
        return np.log([sum(s.mass for s in _whole_tool(tooling, unknowns))])

    drawn = _whole_tool(tooling, np.zeros(len(UNKNOWNS)))
    computed = sum(s.mass for s in drawn)
    flutes = drawn[: fluted_segments(tooling.assembly.tool)]
    std = float(np.hypot(WEIGHED, FLUTES * sum(s.mass for s in flutes if s.area is None) / computed))
    width = np.hypot(std, float(np.hypot(prior[UNKNOWNS.index("density")], 2.0 * prior[UNKNOWNS.index("fluted_diameter")])))
    if not mass > 0.0 or abs(np.log(mass / computed)) > _MASS_STD * width:
        raise InputError("mass", f"{1e3 * mass:.4g} g", f"near {1e3 * computed:.4g} g, what the drawing gives for the tool alone")
    return _Observed(np.log([mass]), np.array([std]), predict)


def _jacobian(predict: Callable[[FloatArray], FloatArray], at: FloatArray, prior: FloatArray, free: np.ndarray) -> FloatArray:
    """Derivatives for the free unknowns, differences over a part of their standard deviation, shape (m, f)."""
    here, columns = predict(at), []
    for i in free:
        moved = at.copy()
        moved[i] += _STEP * prior[i]
        columns.append((predict(moved) - here) / (moved[i] - at[i]))
    return np.stack(columns, axis=1)


def _posterior(observed: Sequence[_Observed], prior: FloatArray, free: np.ndarray) -> tuple[FloatArray, FloatArray, float]:
    """Maximum of the posterior, its covariance, shape (11, 11), and twice the negative logarithm at it."""
    mean = np.zeros(prior.size)
    covariance = np.diag(prior**2)
    if not observed:
        return mean, covariance, 0.0
    sizes = prior[free]

    def residual(unknowns: FloatArray) -> FloatArray:
        parts = [(each.predict(unknowns) - each.value) / each.std for each in observed]
        return np.concatenate([*parts, unknowns[free] / sizes])

    def slope(unknowns: FloatArray) -> FloatArray:
        parts = [_jacobian(each.predict, unknowns, prior, free) / each.std[:, None] for each in observed]
        return np.vstack([*parts, np.diag(1.0 / sizes)])

    rest = residual(mean)
    for _ in range(_STEPS):
        jacobian = slope(mean)
        step = -np.linalg.lstsq(jacobian * sizes, rest, rcond=None)[0] * sizes
        for share in (1.0, 0.5, 0.25, 0.1):
            moved = mean.copy()
            moved[free] += share * step
            tried = residual(moved)
            if tried @ tried <= rest @ rest:
                break
        else:
            break
        small = np.max(np.abs(moved - mean)[free] / sizes) < 0.01
        mean, rest = moved, tried
        if small:
            break
    jacobian = slope(mean)
    inner = np.linalg.inv((jacobian * sizes).T @ (jacobian * sizes))
    covariance = np.zeros((prior.size, prior.size))
    covariance[np.ix_(free, free)] = inner * np.outer(sizes, sizes)
    return mean, covariance, float(rest @ rest)


def _after(line: RungLine, tooling: Tooling, mean: FloatArray) -> RungLine:
    if line.mode is None or line.mode.motion is not Motion.BENDING:
        return line
    mode = _Body(tooling, line.bare).modes(mean, line.mode.order, to_hz(line.mode.omega))[-1]
    return replace(line, after=mode.omega, damping_after=mode.damping)


def _after_ring(tooling: Tooling, mean: FloatArray, prior: FloatArray, covariance: FloatArray) -> Tooling:
    """The tooling with what was learned written into its drawing."""
    assembly = _assembly(tooling.assembly, mean)
    whole = _whole_tool(tooling, mean)
    stays = sum(s.length for s in whole) - assembly.tool_length
    rear = tuple(_rear(whole, stays)) if tooling.tool_behind and stays > 1e-9 else ()
    std = dict(zip(UNKNOWNS, np.sqrt(np.diag(covariance)), strict=True))
    spread = tooling.spread
    values = {group: getattr(spread, group) for group in _PER_GROUP.values()}
    for group in values:
        names = [name for name in _PER_GROUP if _PER_GROUP[name] == group and prior[UNKNOWNS.index(name)] > 0.0]
        if names:
            values[group] = float(np.sqrt(np.mean([std[name] ** 2 for name in names])))
    heard_contact = any(prior[UNKNOWNS.index(name)] > 0.0 for name in ("translational_stiffness", "translational_damping"))
    values["reclamping"] = 0.0 if heard_contact else spread.reclamping
    # its models are as drawn: what cuts have told of them would be added to what the ring has told
    return replace(tooling, assembly=assembly, tool_behind=rear, spread=replace(spread, **values), tool_model="", holder_model="")


def _rear(tool: Sequence[BeamSegment], length: float) -> list[BeamSegment]:
    """The last piece of a tool."""
    found: list[BeamSegment] = []
    for segment in reversed(tool):
        if length <= 1e-9:
            break
        found.insert(0, segment if segment.length <= length + 1e-9 else segment.part(segment.length - length, segment.length))
        length -= segment.length
    return found
