"""Where the seconds of an identification go, beside what this machine can do.

``python -m benchmarks limits [--campaign NAME FOLDER] ... [--seed 1] [--page]``. First the machine, one thread: double precision in a
matrix product and in rows that fit the nearest cache, bandwidth, and what a call costs. Then each campaign is identified in this process,
and every call of what a search is made of is counted: with its unknowns and lines its operations follow, and with its seconds how near it
comes to the machine. Operations are additions and multiplications of real numbers; of a symmetric matrix product half are counted.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numba
import numpy as np

from benchmarks.page import DOCS, write_block
from benchmarks.study import read_data
from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.identification import levenberg_marquardt
from rcsa_ident.identification.coupled.misfit import CoupledMisfit
from rcsa_ident.identification.evidence import EvidenceSelection
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.unknowns import Unknowns

SAMPLE = DOCS.parent / "data" / "sample_runs"
BLOCK = "limits"
#: Operations of a product of complex numbers that is added to a third one, of one line of a gradient, and rows that a sheet has here.
COMPLEX, LINE, ROWS = 8, 14, 24


def _modes(layout: Unknowns) -> list[tuple[int, int]]:
    """(modes, columns of their shapes) of each machine that a layout has."""
    return [(block.modes, block.directions + block.places) for _, block in layout.modal]


def _lines(misfit: Misfit) -> list[tuple[int, int]]:
    """(points, outputs) of each axis."""
    return [(axis.omega.size, axis.outputs) for axis in misfit.data.axes]


def answers(misfit: Misfit, _: FloatArray, layout: Unknowns) -> float:
    """Return the operations of the model's lines: a factorisation and a solution at each point."""
    if isinstance(misfit, CoupledMisfit):
        (m, sides), points = _modes(layout)[0], misfit.points_data.omega.size
        return COMPLEX * points * (m**3 / 3 + 2 * sides * m**2)
    pairs = zip(_modes(layout), _lines(misfit), strict=True)
    return COMPLEX * sum(n * (m**3 / 6 + sides * m**2) for (m, sides), (n, _) in pairs)


def linearisation(misfit: Misfit, _: FloatArray, layout: Unknowns, *further: Any) -> float:
    """Return the operations of gradient and normal equations: a line for each unknown, and half a matrix product."""
    del further
    found = 2.0 * len(misfit.data.cut_ids) * layout.size**2
    for i, (n, o) in enumerate(_lines(misfit)):
        place = layout.axis(i)
        unknowns = place.stop - place.start + layout.force.stop - layout.tail
        found += n * o * unknowns * (LINE + 2 * unknowns)
    return found


def factorisation(matrix: FloatArray, **named: Any) -> float:
    """Return the operations of a damped step: those of a Cholesky factorisation."""
    del named
    return matrix.shape[0] ** 3 / 3


#: Name in the table, where it stands, and the operations of a call with its arguments.
STAGES: tuple[tuple[str, Any, str, Callable[..., float]], ...] = (
    ("lines of the model", Misfit, "_answers", answers),
    ("lines of the model", CoupledMisfit, "_answers", answers),
    ("gradient and normal equations", Misfit, "_linearise", linearisation),
    ("factorisation of a step", levenberg_marquardt, "dpotrf", factorisation),
)


@numba.njit(error_model="numpy")
def _rows(sheet: FloatArray, repeats: int) -> None:
    for _ in range(repeats):
        for k in range(2, sheet.shape[0]):
            for f in range(sheet.shape[2]):
                sheet[k, 0, f] -= sheet[k - 1, 0, f] * sheet[k - 2, 0, f] - sheet[k - 1, 1, f] * sheet[k - 2, 1, f]
            for f in range(sheet.shape[2]):
                sheet[k, 1, f] -= sheet[k - 1, 0, f] * sheet[k - 2, 1, f] + sheet[k - 1, 1, f] * sheet[k - 2, 0, f]


@numba.njit(error_model="numpy")
def _nothing(a: FloatArray, b: FloatArray, c: FloatArray) -> int:
    return a.size + b.size + c.size


def best(call: Callable[[], Any], rounds: int = 7) -> float:
    """Return the least seconds of a call."""
    call()
    found = []
    for _ in range(rounds):
        start = time.perf_counter()
        call()
        found.append(time.perf_counter() - start)
    return min(found)


def machine() -> dict[str, float]:
    """Return the machine's limits: Gflop/s of a matrix product and of rows in the cache, GB/s of a copy, and a call's microseconds."""
    a = np.random.default_rng(1).standard_normal((1200, 1200))
    sheet = 1e-3 * np.random.default_rng(2).standard_normal((ROWS, 2, 64))
    large, other = np.ones(1 << 24), np.empty(1 << 24)
    small = np.ones(3)
    repeats = 2000

    def calls() -> None:
        for _ in range(1000):
            _nothing(small, small, small)

    return {
        "product": 2e-9 * 1200**3 / best(lambda: a @ a),
        "rows": 1e-9 * COMPLEX * 64 * (ROWS - 2) * repeats / best(lambda: _rows(sheet, repeats)),
        "copy": 2e-9 * large.nbytes / best(lambda: np.copyto(other, large)),
        "call": 1e3 * best(calls),
    }


@contextmanager
def counted() -> Iterator[dict[str, list[float]]]:
    """Count each stage's calls, operations and seconds while it lasts."""
    told: dict[str, list[float]] = {name: [0, 0.0, 0.0] for name, *_ in STAGES}

    def watched(name: str, function: Callable[..., Any], operations: Callable[..., float]) -> Callable[..., Any]:
        def call(*given: Any, **named: Any) -> Any:
            count = operations(*given, **named)
            start = time.perf_counter()
            found = function(*given, **named)
            told[name] = [a + b for a, b in zip(told[name], (1, count, time.perf_counter() - start), strict=True)]
            return found

        return call

    with ExitStack() as changed:
        for name, owner, function, operations in STAGES:
            before = getattr(owner, function)
            changed.callback(setattr, owner, function, before)
            setattr(owner, function, watched(name, before, operations))
        yield told


def rows_of(name: str, campaign: Path, seed: int, limit: dict[str, float]) -> list[str]:
    """Return the table's rows of a campaign: calls, operations, share of the time, Gflop/s and share of the limit."""
    data = read_data(campaign)[2]
    EvidenceSelection().run(data, 77)
    with counted() as told:
        start = time.perf_counter()
        EvidenceSelection().run(data, seed)
        whole = time.perf_counter() - start
    rows = []
    for stage, (calls, operations, seconds) in told.items():
        speed, peak = 1e-9 * operations / seconds, limit["rows"] if stage.startswith("lines") else limit["product"]
        rows.append(
            f"| {name} | {stage} | {calls:.0f} | {1e-9 * operations:.1f} | {seconds / whole:.0%} | {speed:.1f} | {speed / peak:.0%} |"
        )
    rest = 1.0 - sum(seconds for _, _, seconds in told.values()) / whole
    return [*rows, f"| {name} | all else | | | {rest:.0%} | | |"]


def main(arguments: Sequence[str]) -> None:
    """Print the machine's limits and the table."""
    parser = argparse.ArgumentParser(prog="benchmarks limits", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    known = "name in the table and folder; default: the sample runs"
    parser.add_argument("--campaign", nargs=2, action="append", metavar=("NAME", "FOLDER"), help=known)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--page", action="store_true", help="write the tables into docs/performance.md")
    given = parser.parse_args(arguments)
    warnings.simplefilter("ignore")
    limit = machine()
    text = (
        f"One core: {limit['product']:.0f} Gflop/s in a matrix product, {limit['rows']:.0f} Gflop/s in rows of the nearest cache, "
        f"{limit['copy']:.0f} GB/s of a copy, {limit['call']:.1f} us for a call of a kernel from Python.\n\n"
        "| campaign | stage | calls | Gflop | share of the time | Gflop/s | of the limit |\n|---|---|---|---|---|---|---|\n"
    )
    campaigns = given.campaign or [("sample runs", SAMPLE)]
    text += "\n".join(row for name, folder in campaigns for row in rows_of(name, Path(folder), given.seed, limit))
    print(text)
    if given.page:
        write_block(BLOCK, text, DOCS / "performance.md")
