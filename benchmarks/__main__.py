"""``python -m benchmarks [--json] [claim ...]``: run the claims and print {claim, ours, peer, ratio, unit, accuracy}.

``study --help``, ``search_trace --help``, ``lobes_truth --help``, ``recommendation --help`` and ``tested_cuts --help`` tell of the
studies, which have options of their own.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import sys

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

#: Each is a module with ``run() -> list of rows``.
CLAIMS = (
    "candidate",
    "forces",
    "lobes",
    "stability",
    "cylinder_error",
    "shape_cost",
    "observer",
    "real_files",
    "service",
    "uploads",
    "published_modes",
    "bad_input",
    "robot",
    "urdf",
    "compensation",
    "paths",
    "removal",
)
#: Each is a module with ``main(arguments)``.
STUDIES = (
    "study",
    "identification",
    "ideals",
    "listening",
    "limits",
    "search_trace",
    "lobes_truth",
    "slow_spindle",
    "tested_cuts",
    "first_page",
    "streaming",
    "live_chart",
    "durability",
    "soak",
    "recommendation",
    "reading",
    "hostile",
    "dependencies",
    "recordings",
    "dynamometer",
    "real_machine",
    "hammer",
    "measured_tips",
    "rough",
    "rough_recommendation",
    "validation",
    "all",
    "labelled_cuts",
    "labelled_cuts_hurco",
    "learn",
    "ring",
    "workpiece_side",
    "corner_radius",
    "robot_cuts",
    "robot_milling",
    "formats",
    "format_examples",
    "fuzz",
    "first_reader",
    "page_outputs",
    "one_answer",
    "fuzz_api",
    "mutation",
    "physics_pictures",
    "compile",
    "frozen",
    "walks",
    "program",
    "page_waits",
)


def main() -> None:
    """Run the named claims, by default all of them, or a study."""
    if sys.argv[1:2] and sys.argv[1] in STUDIES:
        importlib.import_module(f"benchmarks.{sys.argv[1]}").main(sys.argv[2:])
        return
    parser = argparse.ArgumentParser(prog="benchmarks", description=__doc__)
    parser.add_argument("claims", nargs="*", choices=[*CLAIMS, []], metavar="claim", help=f"some of {', '.join(CLAIMS)}")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    rows = []
    for name in arguments.claims or CLAIMS:
        rows += importlib.import_module(f"benchmarks.{name}").run()
    if arguments.json:
        print(json.dumps(rows, indent=1))
        return
    for row in rows:
        peer = "-" if row["peer"] is None else f"{row['peer']:.4g}"
        ratio = f"{row['ratio']:.3g}" if row["ratio"] is not None else "-"
        print(f"{row['claim']:<72} ours {row['ours']:<10.4g} peer {peer:<10} ratio {ratio:<8} {row['unit']:<10} {row['accuracy']}")


if __name__ == "__main__":
    main()
