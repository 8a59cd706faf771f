"""What labels of real cuts teach: accuracy, log score and calibration over the number of labels, taken at random and chosen.

``python -m benchmarks labelled_cuts --scratch FOLDER [--page]``. The cuts lie beside the project (118 of them, and the 40 of the published
training set, 39 of which are among the 118: 79 are unseen). The numbers of the label model were chosen on the 40 alone, by leaving out
one speed after the other (``--choose``). What is computed once, margins of draws of the prior by full discretisation at all
tested cuts, is kept in the scratch folder.
"""

from __future__ import annotations

import argparse
import itertools
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import logsumexp

from benchmarks.label_scores import ORDERS, POOL, SOFTENING, Score
from benchmarks.labelled_cuts_page import Findings, write_page
from benchmarks.real_files import DOWN, FILES
from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.units import from_hz, from_rpm, to_rpm
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.front.processes import workers
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.labels.averaging import trust_in
from rcsa_ident.stability.labels.cut_margins import CutMargins, DrawnMargins, points_of
from rcsa_ident.stability.labels.label_noise import LabelNoise
from rcsa_ident.stability.labels.label_posterior import Effort, LabelModel, LabelPosterior, learn_labels
from rcsa_ident.stability.labels.label_process import LabelProcess
from rcsa_ident.stability.labels.limit_discrepancy import LimitDiscrepancy
from rcsa_ident.stability.labels.next_test import most_telling
from rcsa_ident.stability.labels.tested_cuts import TestedCuts, Verdict
from rcsa_ident.stability.labels.uncertain_tip import UncertainTip
from rcsa_ident.stability.tip_modes import TipModes

CUTS, TRAINING = (FILES / f"labelled_cuts_{name}.csv" for name in ("118", "training_40"))
PAGE = Path(__file__).resolve().parents[1] / "docs" / "labelled_cuts.md"
#: Natural frequency [Hz], damping ratio, stiffness [N/m] of X and Y, K_tc and K_rc [N/m^2] as published, and their standard deviations.
MODES = {Dof.X: (782.7, 0.0184, 6.5616e6), Dof.Y: (752.8, 0.0186, 4.8852e6)}
SPREADS = (80.0, 0.008, 2e6)
COEFFICIENTS, COEFFICIENT_SPREADS = (10.95e8, 1.76e8), (1.5e8, 0.5e8)
#: Draws of the prior with softening, the seed with which the first trial was made, labels.
SOFT_POOL, SEED, LABELS = 2000, 11, (0, 5, 10, 20, 40)
#: Draws that stand for a posterior.
KEPT = 400
#: What is chosen among on the 40: deviation and length of the discrepancy, width of the boundary; the share of wrong labels is fixed.
GRID = ((0.15, 0.25, 0.35, 0.5), (0.1, 0.2, 0.3, 0.5), (0.1, 0.15, 0.2, 0.3, 0.4))
WRONG = 0.02


def read(path: Path) -> TestedCuts:
    """The cuts of one file: speed / 1e4 rev/min, depth [mm], 0 stable or 1 chatter."""
    speed, depth, chatter = np.loadtxt(path, delimiter=",", encoding="utf-8-sig").T
    verdicts = tuple(Verdict.CHATTER if each else Verdict.STABLE for each in chatter.astype(bool).tolist())
    return TestedCuts(from_rpm(np.round(speed * 1e4, 3)), depth * 1e-3, verdicts)


def unseen(cuts: TestedCuts, training: TestedCuts) -> FloatArray:
    """True for the cuts of the one table that do not stand in the other, shape (n,)."""
    known = {(round(to_rpm(s), 3), round(1e3 * d, 6)) for s, d in zip(training.spindle_speed, training.axial_depth, strict=True)}
    pairs = zip(cuts.spindle_speed, cuts.axial_depth, strict=True)
    return np.array([(round(to_rpm(s), 3), round(1e3 * d, 6)) not in known for s, d in pairs])


def prior(softening: float = 0.0) -> UncertainTip:
    """The published prior."""
    means = {axis: (from_hz(f), z, k) for axis, (f, z, k) in MODES.items()}
    models = {
        axis: normal_modes(np.array([w]), np.array([z]), np.array([[w / np.sqrt(k)]]), (Coordinate("tip", axis),))
        for axis, (w, z, k) in means.items()
    }
    spreads = np.array([[s / m for s, m in zip(SPREADS, each, strict=True)] for each in MODES.values()]).T
    shares = COEFFICIENT_SPREADS[0] / COEFFICIENTS[0], COEFFICIENT_SPREADS[1] / COEFFICIENTS[1]
    return UncertainTip.independent(TipModes.of(models), spreads, shares, softening)


PROCESS = MillingProcess(Cutter(2, 12e-3), CuttingCoefficients(COEFFICIENTS[0], COEFFICIENTS[1] / COEFFICIENTS[0]), DOWN)


def margins_of(cuts: TestedCuts, softening: float = 0.0) -> CutMargins:
    """Margins of the prior's draws at cuts."""
    return CutMargins(prior(softening), PROCESS, FullDiscretisation(tolerance=1e-2), cuts)


@dataclass(frozen=True, eq=False)
class Pool:
    """Draws of the prior with their margins at all cuts; those of a draw that is new are computed.

    `z`, shape (d, size); `cuts`: all, n of them; `margin`, shape (d, n); `softening` [s/rad]
    """

    z: FloatArray
    cuts: TestedCuts
    margin: FloatArray
    softening: float = 0.0
    places: dict[bytes, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.places.update({row.tobytes(): k for k, row in enumerate(np.ascontiguousarray(self.z))})

    @classmethod
    def kept(cls, scratch: Path, cuts: TestedCuts, softening: float = 0.0) -> Pool:
        """What the scratch folder holds, or what is computed now and kept there."""
        path = scratch / f"labelled_cuts_margins{'_softening' if softening else ''}.npz"
        margins = margins_of(cuts, softening)
        z = np.random.default_rng(SEED).standard_normal((SOFT_POOL if softening else POOL, margins.tip.size))
        if path.exists():
            return cls(z, cuts, np.load(path)["margin"], softening)
        with workers(2) as pool:
            margin = np.concatenate([part.margin for part in pool.map_many(margins, np.array_split(z, len(z) // 20))])
        np.savez(path, margin=margin)
        return cls(z, cuts, margin, softening)

    def margins(self, some: FloatArray, z: FloatArray) -> DrawnMargins:
        """Margins of draws at some of the cuts."""
        rows = [self.places.get(row.tobytes()) for row in np.ascontiguousarray(z)]
        if None in rows:
            return margins_of(self.cuts.at_places(some), self.softening)(z)
        found = self.margin[np.array(rows)[:, None], some]
        return DrawnMargins(found, np.full(found.shape, np.nan))

    def learnt(self, some: FloatArray, model: LabelModel, seed: int = 1, effort: Effort | None = None) -> Taught:
        """What the labels of some cuts teach: by default from the pool's draws alone, which costs no margin."""
        effort = effort or Effort(further=0, rounds=0, kept=KEPT)
        first = self.z if effort.rounds == 0 else self.z[: effort.first]
        cuts, rng = self.cuts.at_places(some), np.random.default_rng(seed)
        size = self.z.shape[1]
        found = learn_labels(partial(self.margins, some), size, cuts, points_of(cuts, PROCESS), model, rng, effort, first)
        return Taught(found, LabelProcess.learnt(cuts, PROCESS, rng) if some.size else None)

    def stable(self, found: LabelPosterior, model: LabelModel, some: FloatArray) -> FloatArray:
        """Probability of each draw that some of the cuts are called stable, by physics, shape (r, n)."""
        points, place = np.unique(points_of(self.cuts.at_places(some), PROCESS), axis=0, return_inverse=True)
        return model.noise.stable(self.margins(some, found.z).margin + found.errors(model.discrepancy, points)[:, place])

    def told(self, found: Taught, model: LabelModel, some: FloatArray) -> FloatArray:
        """Probability that some of the cuts are called stable, as `learn` tells it, shape (n,)."""
        physics = self.stable(found.posterior, model, some).mean(axis=0)
        if found.without is None:
            return np.asarray(physics)
        without, _ = found.without.told(found.without.features_of(self.cuts.at_places(some), PROCESS))
        return np.asarray(found.trust * physics + (1.0 - found.trust) * without)


@dataclass(frozen=True, eq=False)
class Taught:
    """What labels taught, with and without physics."""

    posterior: LabelPosterior
    without: LabelProcess | None

    @property
    def trust(self) -> float:
        """Weight of physics."""
        return 1.0 if self.without is None else trust_in(self.posterior.log_evidence - self.without.log_evidence)


def chosen_on(pool: Pool, learnt: FloatArray) -> list[tuple[float, float, float, float]]:
    """(log score, deviation, length, width), the best first: each speed of the 40 told from the others, no other cut looked at."""
    cuts = pool.cuts.at_places(learnt)
    points, place = np.unique(points_of(cuts, PROCESS), axis=0, return_inverse=True)
    number = np.random.default_rng(5).standard_normal((40, len(points)))
    tips = pool.margins(learnt, pool.z).margin
    found = []
    for deviation, length, width in itertools.product(*GRID):
        error = number @ LimitDiscrepancy(deviation, length).root(points).T
        noise = LabelNoise(width=width, wrong=WRONG)
        each = np.empty((learnt.size, len(tips), len(error)), dtype=np.float32)
        for k, at in enumerate(place):
            margin = tips[:, k, None] + error[:, at]
            each[k] = np.log(noise.stable(margin if cuts.verdict[k] is Verdict.STABLE else -margin))
        total, told = each.sum(axis=0), []
        for at in range(len(points)):
            left = total - each[place == at].sum(axis=0)
            told += [float(logsumexp(left + own) - logsumexp(left)) for own in each[place == at]]
        found.append((float(np.mean(told)), deviation, length, width))
    return sorted(found, reverse=True)


def random_orders(pool: Pool, model: LabelModel) -> dict[int, tuple[Score, Score]]:
    """Scores over all cuts, and over those that were not learnt from, by the number of labels in ten random orders."""
    found: dict[int, list[tuple[Score, Score]]] = {n: [] for n in LABELS}
    for seed in range(ORDERS):
        order = np.random.default_rng(100 + seed).permutation(len(pool.cuts.verdict))
        for n in LABELS:
            found[n].append(scores_after(pool, order[:n], model))
    return {n: (Score.mean([a for a, _ in each]), Score.mean([b for _, b in each])) for n, each in found.items()}


def scores_after(pool: Pool, learnt: FloatArray, model: LabelModel) -> tuple[Score, Score]:
    """Score over all cuts and over those that were not learnt from."""
    every = np.arange(len(pool.cuts.verdict))
    probability = pool.told(pool.learnt(np.array(learnt, dtype=np.intp), model), model, every)
    left = np.setdiff1d(every, learnt)
    return Score.of(probability, pool.cuts), Score.of(probability[left], pool.cuts.at_places(left))


def chosen_by_program(pool: Pool, model: LabelModel, most: int = 40) -> dict[int, tuple[Score, Score]]:
    """The same where each next cut is the one among all that tells most after the labels so far."""
    chosen: list[int] = []
    found = {}
    while True:
        so_far = np.array(chosen, dtype=np.intp)
        if len(chosen) in LABELS:
            found[len(chosen)] = scores_after(pool, so_far, model)
        if len(chosen) == most:
            return found
        left = np.setdiff1d(np.arange(len(pool.cuts.verdict)), chosen)
        stable = pool.stable(pool.learnt(so_far, model).posterior, model, left)
        chosen.append(int(left[most_telling(stable, 1, np.random.default_rng(1))[0]]))


def calibration(
    probability: FloatArray, cuts: TestedCuts, edges: Sequence[float] = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0)
) -> list[tuple[float, float, int]]:
    """(mean probability, share that was stable, cuts) of each bin."""
    stable, rows = cuts.seen(Verdict.STABLE), []
    for low, high in itertools.pairwise(edges):
        inside = (probability >= low) & ((probability < high) | (high == 1.0))
        if inside.any():
            rows.append((float(probability[inside].mean()), float(stable[inside].mean()), int(inside.sum())))
    return rows


def _without(found: Taught, cuts: TestedCuts) -> FloatArray:
    assert found.without is not None
    return found.without.told(found.without.features_of(cuts, PROCESS))[0]


def main(arguments: Sequence[str]) -> None:
    """Print all, and write the page."""
    parser = argparse.ArgumentParser(prog="benchmarks labelled_cuts", description=__doc__)
    parser.add_argument("--scratch", type=Path, required=True)
    parser.add_argument("--choose", action="store_true", help="only choose the label model's numbers on the 40")
    parser.add_argument("--page", action="store_true", help="write docs/labelled_cuts.md and its figure")
    given = parser.parse_args(arguments)
    given.scratch.mkdir(parents=True, exist_ok=True)
    if not CUTS.exists():
        print("the labelled cuts are not beside the project")
        return
    # one cut of the training set is not among the 118
    cuts, training, model = read(CUTS), read(TRAINING), LabelModel()
    everywhere = cuts.joined(training)
    pool, every = Pool.kept(given.scratch, everywhere), np.arange(len(cuts.verdict))
    learnt = np.flatnonzero(~unseen(everywhere, training))
    if given.choose:
        for score, deviation, length, width in chosen_on(pool, learnt)[:12]:
            print(f"log score {score:.3f}: deviation {deviation:g}, length {length:g}, width {width:g}")
        return
    aside, start = unseen(cuts, training), time.process_time()
    found = pool.learnt(learnt, model, effort=Effort())
    seconds = time.process_time() - start
    probability = pool.told(found, model, every)
    none = np.zeros(0, dtype=np.intp)
    before = pool.told(pool.learnt(none, model), model, every)
    for name, each in (
        ("physics alone", pool.stable(found.posterior, model, every).mean(axis=0)),
        ("labels without physics", _without(found, cuts)),
    ):
        print(f"{name}: all {Score.of(each, cuts)}; unseen {Score.of(each[aside], cuts.at_places(np.flatnonzero(aside)))}")
    print(f"weight of physics {found.trust:.2f}")
    rest = cuts.at_places(np.flatnonzero(aside))
    told: Mapping[str, Any] = {
        "before": (Score.of(before, cuts), Score.of(before[aside], rest)),
        "training": (Score.of(probability, cuts), Score.of(probability[aside], rest)),
    }
    for name, (whole, part) in told.items():
        print(f"{name}: all {whole}; unseen {part}")
    print(f"effective draws {found.posterior.effective:.0f}, {seconds:.0f} s of one core")
    own = Pool(pool.z, cuts, pool.margin[:, : every.size])
    orders = random_orders(own, model)
    for n, (whole, part) in orders.items():
        print(f"{n} random labels: all {whole}; not learnt {part}")
    chosen = chosen_by_program(own, model)
    for n, (whole, part) in chosen.items():
        print(f"{n} chosen labels: all {whole}; not learnt {part}")
    soft = Pool.kept(given.scratch, everywhere, SOFTENING)
    softening, everything = {}, {}
    for name, each_pool in (("without", pool), ("with", soft)):
        taught = each_pool.learnt(learnt, model).posterior
        share = each_pool.stable(taught, model, every).mean(axis=0)
        softening[name] = (taught.log_evidence, Score.of(share, cuts), Score.of(share[aside], rest))
        everything[name] = each_pool.learnt(every, model).posterior.log_evidence
    for name, (evidence, whole, part) in softening.items():
        print(f"softening {name}: log evidence of the 40 {evidence:.2f}, of the 118 {everything[name]:.2f}; all {whole}; unseen {part}")
    if given.page:
        curves = (calibration(probability, cuts), calibration(probability[aside], rest))
        write_page(PAGE, Findings(told, orders, chosen, softening, everything, curves, found.posterior.effective, seconds, model))
