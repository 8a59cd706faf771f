"""Does one question get one recommended cut, whichever door it is asked at?

``python -m benchmarks one_answer``. Each case draws a machine, a tooling and a cut: 2 to 6 teeth, evenly spaced or not, a contact that is
known or uncertain, 5 % immersion to a slot, up or down, any feed direction, speeds of their own; every fourth with machines drawn from
the posterior. It is asked of `lobes` by a drawn method, of `advise` beside a planned cut and a depth, of both in the service, of a job,
of `advise` in Python, and read from tool card and console. Speeds, depths, limits and reasons have to be equal to the last digit.
"""

from __future__ import annotations

import argparse
import json
import re
import tempfile
import time
import tomllib
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from typer.testing import CliRunner

from api.client import Client
from rcsa_ident.base.units import from_rpm
from rcsa_ident.cli import app
from rcsa_ident.cutting.stock import Immersion
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.io.results.identifications import identification_to_json, machine_from_json
from rcsa_ident.io.results.parts import layout, plain, read_result
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.report.summaries import advice_summary
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.workflows.advise import advise
from rcsa_ident.workflows.tool_change import ToolChange
from tests.api.identifying import carried
from tests.api.in_process import embedded, service
from tests.fixtures import by_hand

CASES, FIRST_SEED = 200, 20_001
METHODS = ("zero-order", "multi-frequency", "semi-discretisation", "full-discretisation")
#: What has to be equal, and what console and tool card show.
NAMES = ("spindle_speed_rpm", "recommended_depth_mm", "limit_depth_mm", "bound", "why")
Cuts = list[dict[str, Any]]


def drawn(rng: np.random.Generator, folder: Path) -> dict[str, Any]:
    """Write RESULT.json and T1.toml of a drawn machine, and return a drawn question in the words of the service."""
    shift, seed = float(np.exp(rng.uniform(-0.3, 0.3))), int(rng.integers(1000))
    known = {Dof.X: by_hand.posterior(shift, False, seed), Dof.Y: by_hand.posterior(shift * rng.uniform(0.85, 1.1), False, seed + 1)}
    found = replace(by_hand.identification(), axes={axis: by_hand.axis_result(axis, each) for axis, each in known.items()})
    (folder / "RESULT.json").write_text(layout(plain(identification_to_json(found, by_hand.campaign(folder), []))), encoding="utf-8")
    teeth, stickout = int(rng.integers(2, 7)), float(rng.uniform(40.0, 75.0))
    text = by_hand.TOOLING.replace("teeth = 4", f"teeth = {teeth}\nhelix_deg = {rng.choice([0.0, 30.0, 38.0])}")
    text = text.replace("stickout_mm = 60.0", f"stickout_mm = {stickout:.1f}").replace(
        "length_mm = 100.0", f"length_mm = {stickout + 40.0:.1f}"
    )
    if rng.random() < 0.3:
        pitch = np.full(teeth, 360.0 / teeth) + rng.permutation(np.linspace(-8.0, 8.0, teeth))
        text = text.replace("diameter_mm = 12.0\n", f"diameter_mm = 12.0\npitch_deg = {np.round(pitch, 3).tolist()}\n", 1)
    if rng.random() < 0.5:
        text += "[spread]\ncontact_stiffness_percent = 70.0\ncontact_damping_percent = 100.0\n"
    (folder / "T1.toml").write_text(text, encoding="utf-8")
    low = float(np.round(rng.uniform(3000.0, 14_000.0)))
    return {
        "toolings": ["T1"],
        "cut": {
            "immersion": round(1.0 if rng.random() < 0.15 else float(np.exp(rng.uniform(np.log(0.05), 0.0))), 3),
            "strategy": str(rng.choice(["up", "down"])),
            "feed_direction": round(float(rng.uniform(0.0, 360.0)), 1),
            "feed_per_tooth_mm": round(float(rng.uniform(0.03, 0.15)), 3),
        },
        "speeds": {"from_rpm": low, "to_rpm": low + 100.0 * int(rng.integers(20, 80)), "step_rpm": 100.0},
        "max_depth_mm": float(rng.choice([3.0, 10.0, 20.0])),
        "method": str(rng.choice(METHODS)),
        "bands": bool(rng.random() < 0.25),
    }


def run(*words: object) -> str:
    """Return what a command prints."""
    found = CliRunner().invoke(app, [str(word) for word in words], env={"COLUMNS": "200"})
    if found.exit_code:
        raise RuntimeError(f"{words[0]}: {found.output} {found.exception!r}")
    return found.stdout


def by_command(folder: Path, question: dict[str, Any]) -> tuple[dict[str, Cuts], list[str]]:
    """Return the cuts that the command line recommends, and its texts for people."""
    cut, speeds = question["cut"], question["speeds"]
    words = [folder / "RESULT.json", folder / "T1.toml", "--max-depth-mm", question["max_depth_mm"]]
    words += [word for name, value in cut.items() for word in (f"--{name.replace('_', '-')}", value)]
    words += [word for name in ("from", "to", "step") for word in (f"--speed-{name}", speeds[f"{name}_rpm"])]
    words += [] if question["bands"] else ["--no-bands"]
    middle = 0.5 * (speeds["from_rpm"] + speeds["to_rpm"])
    further = ["--cut", f"{middle}:0.2", "--depth-mm", 0.3, "--card", folder / "CARD.html"]
    lobes = json.loads(run("lobes", *words, "--method", question["method"], "--out", folder / "L.csv", "--json"))
    advice = json.loads(run("advise", *words, *further, "--json"))["toolings"][0]
    console = run("lobes", *words, "--out", folder / "L.csv")
    return {"lobes": lobes["recommended"], "advise": advice["highest_removal"]}, [console, (folder / "CARD.html").read_text("utf-8")]


def content(answer: Any) -> Any:
    """Return the JSON of an answer that is none of a refusal."""
    if answer.status_code not in (200, 202):
        raise RuntimeError(answer.text)
    return answer.json()


def by_service(folder: Path, question: dict[str, Any]) -> dict[str, Cuts]:
    """Return the cuts that the service recommends at once and as a job."""
    store = embedded(folder)
    with service(store, folder, work_seconds=1000.0, query_seconds=2000.0) as http:
        client = Client(http=http)
        machine = client.make_machine("m").id
        client.identify(machine, (folder / "RESULT.json").read_text(encoding="utf-8"))
        client.write_tooling("T1", tomllib.loads((folder / "T1.toml").read_text(encoding="utf-8")) | {"name": "T1"})
        asked = question | {"machine": machine}

        def answered(path: str, body: dict[str, Any], **headers: str) -> Any:
            answer = http.post(path, json=body, headers=headers)
            if answer.status_code == 202:
                # a job, asked for or because it takes long
                carried(store, folder)
                return content(http.get(f"/v1/lobes/{content(answer)['id']}"))["answer"]["toolings"][0]
            return content(answer)["toolings"][0]

        found = {
            "/v1/lobes": answered("/v1/lobes", asked | {"method": "zero-order"})["recommended"],
            "/v1/advice": answered("/v1/advice", asked | {"method": "zero-order", "depth_mm": 0.25})["highest_removal"],
            "job": answered("/v1/lobes", asked, Prefer="respond-async")["recommended"],
        }
    store.close()
    return found


def in_python(folder: Path, question: dict[str, Any]) -> Cuts:
    """Return the cuts that `advise` recommends."""
    cut, speeds = question["cut"], question["speeds"]
    spec = CutSpec(
        Immersion(cut["immersion"], cut["strategy"]), float(np.radians(cut["feed_direction"])), cut["feed_per_tooth_mm"] * 1e-3, None, {}
    )
    rpm = np.arange(speeds["from_rpm"], speeds["to_rpm"] + 1.0, speeds["step_rpm"])
    machine = machine_from_json(read_result(folder / "RESULT.json"), "")
    own = {} if question["bands"] else {"draws": 0}
    change = ToolChange(machine, read_tooling(folder / "T1.toml"), spec, from_rpm(rpm), question["max_depth_mm"] * 1e-3, **own)
    return plain(advice_summary(advise(change))["highest_removal"])


def differences(folder: Path, question: dict[str, Any]) -> list[str]:
    """Return which doors say something else than the first, and what."""
    found, texts = by_command(folder, question)
    found |= by_service(folder, question) | {"Python": in_python(folder, question)}
    cuts = {door: [[point[name] for name in NAMES] for point in points] for door, points in found.items()}
    first = cuts["lobes"]
    told = [f"{door}: {points} for {first}" for door, points in cuts.items() if points != first]
    for name, text in zip(("console", "card"), texts, strict=True):
        shown = re.sub(r"<[^>]*>|\s+", " ", text.replace("\u202f", ""))
        for speed, depth, limit, *_ in first:
            numbers = [f"{speed:.0f}"] + [f"{each:.2f}" for each in (depth, limit) if each is not None]
            if depth is not None and not re.search(r"\b" + r"\D+".join(map(re.escape, numbers)), shown):
                told.append(f"{name}: not {' '.join(numbers)}")
    return told


def main(arguments: Sequence[str]) -> None:
    """Ask the questions and print what differs."""
    parser = argparse.ArgumentParser(
        prog="benchmarks one_answer", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=CASES)
    parser.add_argument("--first", type=int, default=0, help="the number of the first case, for a run in parts")
    given = parser.parse_args(arguments)
    count = Counter[str]()
    began = time.process_time()
    for number in range(given.first, given.first + given.cases):
        with tempfile.TemporaryDirectory(prefix="rcsa-ident-") as name:
            question = drawn(np.random.default_rng(FIRST_SEED + number), Path(name))
            told = differences(Path(name), question)
        count.update([question["method"], "with bands" if question["bands"] else "without bands", "differ" if told else "equal"])
        for line in told:
            print(f"case {number}: {line}", flush=True)
        if number % 20 == 19:
            print(f"case {number}: {dict(count)}", flush=True)
    print(f"{given.cases} questions at 8 doors: {dict(count)}, {time.process_time() - began:.0f} s of processor")
