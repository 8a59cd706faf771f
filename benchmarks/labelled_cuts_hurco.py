"""Real cuts with two experts' verdicts: what labels teach of cuts, widths, speeds and directions that were left out.

``python -m benchmarks labelled_cuts_hurco [--page]``. The cuts lie beside the project: 337 of a milling machine, of which 187 were made
with one tool, long and worn. A cut counts where the sum of both verdicts (0 stable, 1 between, 2 chatter) is 1 or less, stable, or 3 and
more, chatter. No modal test is known, so that the tip is known vaguely. Beside the answer of `learn`: physics alone, labels without
physics, the share of each direction, and a random forest where scikit-learn is installed, all learnt from the same cuts.
"""

from __future__ import annotations

import argparse
import csv
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.real_files import FILES
from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.units import from_hz, from_rpm, to_rpm
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.front.processes import workers
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.setup.tooling import BareCutter
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.labels.coverage import Covered
from rcsa_ident.stability.labels.tested_cuts import ORDINAL, OwnConditions, TestedCuts
from rcsa_ident.stability.labels.uncertain_tip import UncertainTip
from rcsa_ident.stability.tip_modes import TipModes
from rcsa_ident.workflows.learn_from_cuts import Believed, learn_from_cuts

CUTS = FILES / "labelled_cuts_hurco" / "labels.csv"
PAGE = Path(__file__).resolve().parents[1] / "docs" / "labelled_cuts_votes.md"
INCH = 25.4e-3
#: Half an inch, five teeth; the helix is not told, nor is a modal test: means and their shares of a vague prior, written down before
#: physics was first asked about these cuts; their verdicts had been seen.
TOOLING = BareCutter("half inch", Cutter(5, 0.5 * INCH, np.radians(38.0)))
FREQUENCY, DAMPING, STIFFNESS, SHARES = from_hz(1500.0), 0.03, 8e6, (0.4, 0.5, 0.6)
COEFFICIENTS = CuttingCoefficients(2.1e9, 1.0 / 3.0, tangential_spread=0.2, ratio_spread=0.3)
#: Bounds of the probabilities of a forest and of shares, which know no doubt.
SURE = 0.02
Told = dict[str, FloatArray]


def cuts_of(rows: Sequence[dict[str, str]]) -> TestedCuts:
    """Cuts of the table: speeds in rev/min, feeds in inches per minute, lengths in inches."""
    own = []
    for row in rows:
        teeth = 5 if "5-flute" in row["tool"] else 2
        feed = float(row["ipm"]) * INCH / float(row["rpm"]) / teeth
        width, edges = float(row["woc"]) * INCH, "new" if row["cond"] == "New" else "worn"
        own.append(OwnConditions(width, None, row["dir"].lower(), feed, edges, row["exp"], (ORDINAL[int(row["c2"])],)))
    speed, depth = (np.array([float(row[key]) for row in rows]) for key in ("rpm", "doc"))
    return TestedCuts(from_rpm(speed), depth * INCH, tuple(ORDINAL[int(row["c1"])] for row in rows), own=tuple(own))


def believed() -> Believed:
    """The vague prior."""
    models = {
        axis: normal_modes(
            np.array([FREQUENCY]), np.array([DAMPING]), np.array([[FREQUENCY / np.sqrt(STIFFNESS)]]), (Coordinate("tip", axis),)
        )
        for axis in (Dof.X, Dof.Y)
    }
    prior = UncertainTip.independent(TipModes.of(models), np.repeat(SHARES, 2).reshape(3, 2), (0.2, 0.35))
    return Believed(prior, COEFFICIENTS)


def told(learnt_from: TestedCuts, asked: TestedCuts, seed: int = 1) -> tuple[Told, float, float, FloatArray]:
    """Probabilities that cuts are stable by each way to tell them, weight of physics, seconds, and whether labels cover each cut."""
    spec, start = CutSpec(), time.perf_counter()
    with workers(2) as pool:
        learnt = learn_from_cuts(believed(), TOOLING, spec, learnt_from, FullDiscretisation(tolerance=1e-2), seed=seed, map=pool.map_many)
    seconds = time.perf_counter() - start
    process = spec.process(TOOLING.cutter, learnt.workpiece)
    assert learnt.process is not None
    answers = learnt.answers(process, asked)
    found = {
        "learn": answers.stable,
        "physics alone": learnt.stable_by_draw(process, asked).mean(axis=0),
        "labels without physics": learnt.process.told(learnt.process.features_of(asked, process))[0],
        "share of each direction": _shares(learnt_from, asked),
    }
    forest = _forest(learnt_from, asked)
    cover = np.array([(Covered.YES, Covered.PARTLY, Covered.NO).index(each) for each in answers.covered])
    return found | ({} if forest is None else {"random forest": forest}), learnt.trust, seconds, cover


def _shares(learnt_from: TestedCuts, asked: TestedCuts) -> FloatArray:
    ups, stable = _up(learnt_from), (loudness(learnt_from) <= 1).astype(float)
    return np.array([(stable[ups == up].sum() + 1.0) / (np.sum(ups == up) + 2.0) for up in _up(asked)])


def _forest(learnt_from: TestedCuts, asked: TestedCuts) -> FloatArray | None:
    try:
        from sklearn.ensemble import RandomForestClassifier
    except ImportError:
        return None
    clear = loudness(learnt_from) != 2
    model = RandomForestClassifier(500, min_samples_leaf=2, random_state=1)
    model.fit(_columns(learnt_from)[clear], (loudness(learnt_from) <= 1)[clear])
    share = model.predict_proba(_columns(asked)) @ model.classes_.astype(float)
    return np.asarray(np.clip(share, SURE, 1.0 - SURE))


def _columns(cuts: TestedCuts) -> FloatArray:
    own = np.array([(o.radial_width or 0.0, o.feed_per_tooth or 0.0) for o in cuts.own])
    return np.column_stack([cuts.spindle_speed, cuts.axial_depth, own, _up(cuts)])


def _up(cuts: TestedCuts) -> FloatArray:
    return np.array([float(own.strategy == "up") for own in cuts.own])


def loudness(cuts: TestedCuts) -> FloatArray:
    """Sum of both verdicts of each cut, from 0 to 4."""
    return np.asarray(cuts.counts @ np.array([0.0, 1.0, 2.0]))


@dataclass(frozen=True, slots=True)
class Row:
    """Scores of one way to tell cuts that were left out."""

    right: float
    log_score: float
    expected: float
    calibration: float
    cuts: int

    @classmethod
    def of(cls, probability: FloatArray, cuts: TestedCuts) -> Row:
        """Score cuts on whose verdict the experts are clear."""
        clear = loudness(cuts) != 2
        p, stable = probability[clear], (loudness(cuts) <= 1)[clear]
        seen, sure = np.where(stable, p, 1.0 - p), np.maximum(p, 1.0 - p)
        right, bins = (p > 0.5) == stable, np.minimum((p * 10).astype(int), 9)
        apart = sum(abs(float(np.sum(p[bins == k] - stable[bins == k]))) for k in range(10)) / max(p.size, 1)
        return cls(float(right.mean()), float(np.log(seen).mean()), float(sure.mean()), apart, p.size)

    def __str__(self) -> str:
        return f"{100 * self.right:.1f} % | {self.log_score:.3f} | {100 * self.expected:.1f} % | {self.calibration:.3f}"


@dataclass(frozen=True, slots=True)
class LeftOut:
    """All cuts, each told by those of other groups: probabilities, weights of physics, longest seconds, and how many are covered."""

    told: Told
    trusts: list[float]
    seconds: float
    covered: tuple[int, int, int]

    @classmethod
    def of(cls, cuts: TestedCuts, group: FloatArray) -> LeftOut:
        """Leave out one group after the other."""
        parts: Told = {}
        trusts, longest, cover = [], 0.0, np.zeros(group.size)
        for name in np.unique(group):
            away = np.flatnonzero(group == name)
            found, trust, seconds, cover[away] = told(cuts.at_places(np.flatnonzero(group != name)), cuts.at_places(away))
            trusts.append(trust)
            longest = max(longest, seconds)
            for key, p in found.items():
                parts.setdefault(key, np.empty(group.size))[away] = p
            here = cuts.at_places(away)
            print(f"  {name}: " + "; ".join(f"{key} {Row.of(p[away], here)}" for key, p in parts.items()), flush=True)
        return cls(parts, trusts, longest, (int(np.sum(cover == 0)), int(np.sum(cover == 1)), int(np.sum(cover == 2))))

    def table(self, cuts: TestedCuts) -> str:
        """Scores as rows."""
        rows = [f"| {key} | {Row.of(p, cuts)} |" for key, p in self.told.items()]
        return "\n".join(["| told by | right | log score | expects itself right in | calibration error |", "|---|---|---|---|---|", *rows])

    def __str__(self) -> str:
        yes, partly, no = self.covered
        weights = f"weight of physics {min(self.trusts):.2f} to {max(self.trusts):.2f}"
        return f"{weights}; covered {yes}, partly {partly}, not {no}; learning takes up to {self.seconds:.0f} s on two cores"


def groups() -> dict[str, Callable[[TestedCuts], FloatArray]]:
    """What is left out together."""
    return {
        "one depth and width": lambda c: np.array([f"{d:.5f} {o.radial_width:.6f}" for d, o in zip(c.axial_depth, c.own, strict=True)]),
        "one speed": lambda c: np.round(to_rpm(c.spindle_speed)),
        "one direction": _up,
        "one session": lambda c: np.array([o.session for o in c.own]),
    }


def page(cuts: TestedCuts, found: dict[str, LeftOut]) -> str:
    """The page."""
    clear = Row.of(np.full(len(cuts.verdict), 0.5), cuts).cuts
    parts = [
        f"## {name[0].upper()}{name[1:]} left out\n\n{each.table(cuts)}\n\n{str(each)[0].upper()}{str(each)[1:]}."
        for name, each in found.items()
    ]
    text = "\n\n".join(parts)
    return f"""# What two experts' verdicts teach

{len(cuts.verdict)} real cuts of a milling machine with one long, worn tool of half an inch and five teeth, in steel, 4 to 10 % of the
diameter wide, up and down, at seven speeds, judged by two experts as stable, between or chatter. They lie beside the project, not in it.
No modal test is known: the tip is believed to have one mode in each direction, 1500 Hz ± 40 %, damping ratio 0.03 ± 50 %,
8 N/µm ± 60 %; K_tc 2100 MPa ± 20 %. Scores are over the {clear} cuts on which the experts are clear: the sum of both verdicts (0, 1, 2) is
at most 1, or at least 3. Each group is told by all cuts of the others. Log scores are means of the natural logarithm of the probability of
what was seen; the calibration error is the mean difference between probability and share in ten bins. The priors of the process without
physics were written down after some twenty prototypes had been scored on these cuts: its rows are no blind test.

{text}

`python -m benchmarks labelled_cuts_hurco --page`
"""


def main(arguments: Sequence[str]) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(prog="benchmarks labelled_cuts_hurco", description=__doc__)
    parser.add_argument("--out", choices=list(groups()), nargs="+", default=list(groups()), help="what is left out together")
    parser.add_argument("--page", action="store_true", help="write docs/labelled_cuts_votes.md")
    given = parser.parse_args(arguments)
    if not CUTS.exists():
        print("the labelled cuts are not beside the project")
        return
    with CUTS.open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["setup"] == "Long" and row["cond"] == "Worn" and "5-flute" in row["tool"]]
    cuts, found = cuts_of(rows), dict[str, LeftOut]()
    for name in given.out:
        found[name] = LeftOut.of(cuts, groups()[name](cuts))
        print(f"\n{name} left out: {found[name]}\n\n{found[name].table(cuts)}\n", flush=True)
    if given.page:
        PAGE.write_text(page(cuts, found), encoding="utf-8")
