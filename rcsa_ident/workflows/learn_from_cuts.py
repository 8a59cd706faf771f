"""Labelled cuts teach a tip: from modes, a tap test or an identification, and from labels that were learnt before."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.scaleout import Map
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.uncertain import UncertainReceptance
from rcsa_ident.machine.learnt_tip import LearntTip
from rcsa_ident.machine.machine import TipSource
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.stability.labels.cut_margins import CutMargins, DrawnMargins
from rcsa_ident.stability.labels.label_posterior import Effort, LabelModel, learn_labels
from rcsa_ident.stability.labels.label_process import LabelProcess
from rcsa_ident.stability.labels.next_test import most_telling
from rcsa_ident.stability.labels.tested_cuts import OwnConditions, TestedCuts, Verdict
from rcsa_ident.stability.labels.uncertain_tip import UncertainTip
from rcsa_ident.stability.lobes import both_directions
from rcsa_ident.stability.methods import StabilityMethod
from rcsa_ident.stability.tip_modes import TipModes, fitted_modes

#: Standard deviations of what a tap test shows of each mode, over the values: frequency, damping ratio, stiffness. A turning spindle and
#: another clamping differ by that much from what was tapped.
TAPPED = (0.02, 0.2, 0.15)
#: Modes below this share of the strongest one's peak are taken as they were tapped.
_STRONG = 0.05
#: Draws of one task.
_TASK = 20
#: Speeds and depths among which tests are proposed where no table names them.
_MOST_SPEEDS, _DEPTHS = 40, 12
#: Share of the posterior's spread that its modes may miss without a word.
_MISSED = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Believed:
    """What is believed of a tip and of the coefficients before labels.

    `coefficients`: their means
    `remarks`: what the user should know of them
    """

    prior: UncertainTip
    coefficients: CuttingCoefficients
    remarks: tuple[str, ...] = ()


def believed_of_tap_test(tip: Receptance, coefficients: CuttingCoefficients) -> Believed:
    """Return what a tap test says, with the spreads `TAPPED` of what differs while it cuts, and the coefficients' own."""
    modes, _ = fitted_modes(both_directions(tip))
    strong = modes.strength >= _STRONG * modes.strength.max()
    spreads = np.outer(TAPPED, strong)
    told = (
        f"of the tapped modes natural frequencies are taken to be known to {100.0 * TAPPED[0]:g} %, damping ratios to "
        f"{100.0 * TAPPED[1]:g} %, stiffnesses to {100.0 * TAPPED[2]:g} %: MODES.toml tells other spreads"
    )
    return Believed(UncertainTip.independent(modes, spreads, _independent(coefficients)), coefficients, (told,))


def believed_of_machine(machine: TipSource, tooling: Tooling, coefficients: CuttingCoefficients, stiffness_spread: float) -> Believed:
    """Return what an identification says of a tooling's tip, in the middle of its speeds, its posterior told as that of the tip's modes."""
    tip = machine.at(None).relative_tip(tooling, None, True, stiffness_spread)
    if isinstance(tip, TipModes) or not isinstance(tip, UncertainReceptance) or not tip.complete:
        raise InputError("result", "a machine without a posterior", "an identification, modes with their spreads, or tap tests of the tip")
    t, r = coefficients.tangential_spread, coefficients.ratio_spread
    prior, missed = UncertainTip.of_receptance(tip, np.array([[t, 0.0], [t, r]]))
    remarks = list(machine.remarks)
    if missed > _MISSED:
        remarks.append(f"changes of the tip's modes tell {100.0 * (1.0 - missed):.0f} % of what the identification leaves open")
    if machine.speed_range is not None:
        remarks.append(
            "this machine changes with its speed: labels are learnt by the tip in the middle of its speeds, the rest is smooth error"
        )
    return Believed(prior, coefficients, tuple(remarks))


def believed_of_learnt(learnt: LearntTip) -> Believed:
    """Return what was believed before the labels of a learnt tip."""
    return Believed(learnt.prior, learnt.coefficients)


def _independent(c: CuttingCoefficients) -> tuple[float, float]:
    return c.tangential_spread, float(np.hypot(c.tangential_spread, c.ratio_spread))


def learn_from_cuts(
    believed: Believed,
    tooling: Tooling,
    cut: CutSpec,
    cuts: TestedCuts,
    method: StabilityMethod,
    model: LabelModel | None = None,
    seed: int = 1,
    effort: Effort | None = None,
    map: Map = map,
) -> LearntTip:
    """Return what is believed of a tip after labelled cuts.

    `cut`: that all cuts share
    `cuts`: may be none: the answer is then drawn from what was believed before
    `method`: computes how each draw's cuts die away; a draw costs one multiplier for every cut that differs
    `seed`: the same one, the same answer, on any number of processes
    `map`: maps a function over some draws at a time, as the built-in does
    """
    model = model or LabelModel()
    # the mean of the coefficients is that which was believed; spreads that a cut names for itself belong to it
    process = _process(believed, tooling, cut)
    margins, rng = CutMargins(believed.prior, process, method, cuts), np.random.default_rng(seed)
    posterior = learn_labels(_Mapped(margins, map), believed.prior.size, cuts, margins.points, model, rng, effort)
    without = LabelProcess.learnt(cuts, process, rng) if cuts.verdict else None
    return LearntTip(believed.prior, process.coefficients, method, model, cuts, posterior, without)


def _process(believed: Believed, tooling: Tooling, cut: CutSpec) -> MillingProcess:
    c = believed.coefficients
    named = {"tangential": c.tangential, "radial_ratio": c.radial_ratio, **cut.coefficients}
    return replace(cut, coefficients=named).process(tooling.cutter)


@dataclass(frozen=True, slots=True, eq=False)
class _Mapped:
    """Margins of many draws, some at a time wherever the map computes them."""

    margins: CutMargins
    map: Map

    def __call__(self, z: FloatArray) -> DrawnMargins:
        parts = list(self.map(self.margins, np.array_split(z, max(1, len(z) // _TASK))))
        return DrawnMargins(*(np.concatenate([getattr(part, name) for part in parts]) for name in ("margin", "chatter")))


@dataclass(frozen=True, slots=True)
class NextTest:
    """A cut that is worth a test.

    `spindle_speed` [rad/s]; `axial_depth` [m]
    `probability_stable` [-]: as it is believed now
    `own`: its other conditions, where a table of candidates has them
    """

    spindle_speed: float
    axial_depth: float
    probability_stable: float
    own: OwnConditions = OwnConditions()  # noqa: RUF009 - frozen


def next_tests(
    learnt: LearntTip, process: MillingProcess, count: int, among: TestedCuts | None, speeds: FloatArray, max_depth: float, seed: int = 1
) -> list[NextTest]:
    """Return the cuts whose labels, taken together, tell most, the most telling first.

    `among`: candidates, whatever their verdicts; None proposes cuts at some of the speeds, up to the largest depth
    `speeds` [rad/s], shape (n,); `max_depth` [m]
    """
    if among is None:
        few = speeds[np.unique(np.linspace(0, speeds.size - 1, min(speeds.size, _MOST_SPEEDS)).astype(int))]
        depth = max_depth * np.geomspace(0.05, 1.0, _DEPTHS)
        grid = np.meshgrid(few, depth, indexing="ij")
        among = TestedCuts(grid[0].ravel(), grid[1].ravel(), (Verdict.MARGINAL,) * grid[0].size)
    each = learnt.stable_by_draw(process, among)
    chosen = most_telling(each, count, np.random.default_rng(seed))
    asked = among.at_places(np.array(chosen, dtype=np.intp))
    rows = zip(asked.spindle_speed, asked.axial_depth, learnt.answers(process, asked).stable, asked.own, strict=True)
    return [NextTest(float(speed), float(depth), float(stable), own) for speed, depth, stable, own in rows]
