"""What labels of real cuts teach: accuracy, log score and calibration over the number of labels, taken at random and chosen.

``python -m benchmarks labelled_cuts --scratch FOLDER [--page]``. The cuts lie beside the project (118 of them, and the 40 of the published
training set, 39 of which are among the 118: 79 are unseen). The numbers of the label model were chosen on the 40 alone, by leaving out
one speed after the other (``--choose``). What is computed once, limits of draws of the prior by full discretisation at all tested
speeds, is kept in the scratch folder.
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
from rcsa_ident.stability.labels.label_noise import LabelNoise
from rcsa_ident.stability.labels.label_posterior import Effort, LabelModel, LabelPosterior, learn_labels
from rcsa_ident.stability.labels.limit_discrepancy import LimitDiscrepancy
from rcsa_ident.stability.labels.next_test import most_telling
from rcsa_ident.stability.labels.tested_cuts import TestedCuts, Verdict
from rcsa_ident.stability.labels.uncertain_tip import DrawnLimits, TipLimits, UncertainTip
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


def limits_of(softening: float = 0.0) -> TipLimits:
    """Limits of the prior's draws in the cut of all 118."""
    process = MillingProcess(Cutter(2, 12e-3), CuttingCoefficients(COEFFICIENTS[0], COEFFICIENTS[1] / COEFFICIENTS[0]), DOWN)
    return TipLimits(prior(softening), process, FullDiscretisation(tolerance=1e-2), 12e-3)


@dataclass(frozen=True, eq=False)
class Pool:
    """Draws of the prior with their limits at all tested speeds; a draw that is new is computed.

    `z`, shape (d, size); `speeds` [rad/s], shape (n,); `log_limit`, shape (d, n); `softening` [s/rad]
    """

    z: FloatArray
    speeds: FloatArray
    log_limit: FloatArray
    softening: float = 0.0
    places: dict[bytes, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.places.update({row.tobytes(): k for k, row in enumerate(np.ascontiguousarray(self.z))})

    @classmethod
    def kept(cls, scratch: Path, speeds: FloatArray, softening: float = 0.0) -> Pool:
        """What the scratch folder holds, or what is computed now and kept there."""
        path = scratch / f"labelled_cuts_pool{'_softening' if softening else ''}.npz"
        limits = limits_of(softening)
        z = np.random.default_rng(SEED).standard_normal((SOFT_POOL if softening else POOL, limits.tip.size))
        if path.exists():
            return cls(z, speeds, np.load(path)["log_limit"], softening)
        with workers(2) as pool:
            parts = list(pool.map_many(partial(limits, speeds=speeds), np.array_split(z, len(z) // 20)))
        log_limit = np.concatenate([part.log_limit for part in parts])
        np.savez(path, log_limit=log_limit)
        return cls(z, speeds, log_limit, softening)

    def __call__(self, z: FloatArray, speeds: FloatArray) -> DrawnLimits:
        """Limits of draws at some of the speeds."""
        rows = [self.places.get(row.tobytes()) for row in np.ascontiguousarray(z)]
        columns = np.searchsorted(self.speeds, speeds * (1.0 - 1e-9))
        if None in rows:
            return limits_of(self.softening)(z, speeds)
        found = self.log_limit[np.array(rows)[:, None], columns]
        return DrawnLimits(found, np.full(found.shape, np.nan))

    def learnt(self, cuts: TestedCuts, model: LabelModel, seed: int = 1, effort: Effort | None = None) -> LabelPosterior:
        """What labels teach: by default from the pool's draws alone, which costs no limit."""
        effort = effort or Effort(further=0, rounds=0, kept=KEPT)
        first = self.z if effort.rounds == 0 else self.z[: effort.first]
        return learn_labels(self, self.z.shape[1], cuts, model, np.random.default_rng(seed), effort, first)

    def stable(self, found: LabelPosterior, model: LabelModel, cuts: TestedCuts) -> FloatArray:
        """Probability of each draw that each cut is called stable, shape (r, n)."""
        speeds, place = np.unique(cuts.spindle_speed, return_inverse=True)
        drawn = self(found.z, speeds).log_limit + found.errors(model.discrepancy, speeds)
        return model.noise.stable(drawn[:, place] - np.log(cuts.axial_depth))


def chosen_on(pool: Pool, training: TestedCuts) -> list[tuple[float, float, float, float]]:
    """(log score, deviation, length, width), the best first: each speed of the 40 told from the others, no other cut looked at."""
    speeds, place = np.unique(training.spindle_speed, return_inverse=True)
    number = np.random.default_rng(5).standard_normal((40, speeds.size))
    tips = pool(pool.z, speeds)
    found = []
    for deviation, length, width in itertools.product(*GRID):
        error = number @ LimitDiscrepancy(deviation, length).root(speeds).T
        noise = LabelNoise(width=width, wrong=WRONG)
        each = np.empty((len(training.verdict), len(tips.log_limit), len(error)), dtype=np.float32)
        for k, at in enumerate(place):
            margin = tips.log_limit[:, at, None] + error[:, at] - np.log(training.axial_depth[k])
            each[k] = np.log(noise.stable(margin if training.verdict[k] is Verdict.STABLE else -margin))
        total, told = each.sum(axis=0), []
        for at in range(speeds.size):
            left = total - each[place == at].sum(axis=0)
            told += [float(logsumexp(left + own) - logsumexp(left)) for own in each[place == at]]
        found.append((float(np.mean(told)), deviation, length, width))
    return sorted(found, reverse=True)


def random_orders(pool: Pool, cuts: TestedCuts, model: LabelModel) -> dict[int, tuple[Score, Score]]:
    """Scores over all cuts, and over those that were not learnt from, by the number of labels in ten random orders."""
    found: dict[int, list[tuple[Score, Score]]] = {n: [] for n in LABELS}
    for seed in range(ORDERS):
        order = np.random.default_rng(100 + seed).permutation(len(cuts.verdict))
        for n in LABELS:
            found[n].append(scores_after(pool, cuts, order[:n], model))
    return {n: (Score.mean([a for a, _ in each]), Score.mean([b for _, b in each])) for n, each in found.items()}


def scores_after(pool: Pool, cuts: TestedCuts, learnt: FloatArray, model: LabelModel) -> tuple[Score, Score]:
    """Score over all cuts and over those that were not learnt from."""
    probability = pool.stable(pool.learnt(cuts.at_places(np.array(learnt, dtype=np.intp)), model), model, cuts).mean(axis=0)
    left = np.setdiff1d(np.arange(len(cuts.verdict)), learnt)
    return Score.of(probability, cuts), Score.of(probability[left], cuts.at_places(left))


def chosen_by_program(pool: Pool, cuts: TestedCuts, model: LabelModel, most: int = 40) -> dict[int, tuple[Score, Score]]:
    """The same where each next cut is the one among all that tells most after the labels so far."""
    chosen: list[int] = []
    found = {}
    while True:
        if len(chosen) in LABELS:
            found[len(chosen)] = scores_after(pool, cuts, np.array(chosen, dtype=np.intp), model)
        if len(chosen) == most:
            return found
        posterior = pool.learnt(cuts.at_places(np.array(chosen, dtype=np.intp)), model)
        left = np.setdiff1d(np.arange(len(cuts.verdict)), chosen)
        stable = pool.stable(posterior, model, cuts.at_places(left))
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
    cuts, training, model = read(CUTS), read(TRAINING), LabelModel()
    pool = Pool.kept(given.scratch, np.unique(cuts.spindle_speed))
    if given.choose:
        for score, deviation, length, width in chosen_on(pool, training)[:12]:
            print(f"log score {score:.3f}: deviation {deviation:g}, length {length:g}, width {width:g}")
        return
    aside, start = unseen(cuts, training), time.process_time()
    found = pool.learnt(training, model, effort=Effort())
    seconds = time.process_time() - start
    probability = pool.stable(found, model, cuts).mean(axis=0)
    before = pool.stable(pool.learnt(TestedCuts.none(), model), model, cuts).mean(axis=0)
    rest = cuts.at_places(np.flatnonzero(aside))
    told: Mapping[str, Any] = {
        "before": (Score.of(before, cuts), Score.of(before[aside], rest)),
        "training": (Score.of(probability, cuts), Score.of(probability[aside], rest)),
    }
    for name, (whole, part) in told.items():
        print(f"{name}: all {whole}; unseen {part}")
    print(f"effective draws {found.effective:.0f}, {seconds:.0f} s of one core")
    orders = random_orders(pool, cuts, model)
    for n, (whole, part) in orders.items():
        print(f"{n} random labels: all {whole}; not learnt {part}")
    chosen = chosen_by_program(pool, cuts, model)
    for n, (whole, part) in chosen.items():
        print(f"{n} chosen labels: all {whole}; not learnt {part}")
    soft = Pool.kept(given.scratch, pool.speeds, SOFTENING)
    softened = soft.learnt(training, model)
    plain = pool.learnt(training, model)
    share = soft.stable(softened, model, cuts).mean(axis=0)
    unsoftened = pool.stable(plain, model, cuts).mean(axis=0)
    softening = {
        "without": (plain.log_evidence, Score.of(unsoftened, cuts), Score.of(unsoftened[aside], rest)),
        "with": (softened.log_evidence, Score.of(share, cuts), Score.of(share[aside], rest)),
    }
    everything = {"without": pool.learnt(cuts, model).log_evidence, "with": soft.learnt(cuts, model).log_evidence}
    for name, (evidence, whole, part) in softening.items():
        print(f"softening {name}: log evidence of the 40 {evidence:.2f}, of the 118 {everything[name]:.2f}; all {whole}; unseen {part}")
    if given.page:
        curves = (calibration(probability, cuts), calibration(probability[aside], rest))
        write_page(PAGE, Findings(told, orders, chosen, softening, everything, curves, found.effective, seconds, model))
