"""check and identify: from a campaign's folder to verdicts and modes."""

from __future__ import annotations

from dataclasses import asdict
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rcsa_ident.cli.common import (
    BAD_INPUT,
    NOT_CONVERGED,
    Json,
    Processes,
    Seed,
    Stages,
    Workers,
    answers,
    emit,
    say,
    warn,
    workers,
    writable,
)

if TYPE_CHECKING:
    from rcsa_ident.identification.result import Identification
    from rcsa_ident.machining_setup import Campaign
    from rcsa_ident.workflows.identify import JudgedCut

CampaignFolder = Annotated[Path, typer.Argument(help="Folder with campaign.toml, toolings and recordings.", show_default=False)]


class Method(StrEnum):
    """Identification methods by the names that they have in a result file."""

    default = "default"
    paper = "paper"


@answers
def check(campaign_dir: CampaignFolder, processes: Processes = None, json_: Json = False) -> None:
    """Read everything and give a verdict on every recording; nothing is identified."""
    from rcsa_ident.report.rows import recording_rows

    stages = Stages(quiet=json_)
    with workers(processes) as pool:
        campaign, judged = read_and_judge(campaign_dir, pool, stages)
    rows = recording_rows((j.cut, j.reading) for j in judged)
    usable = sum(row.usable for row in rows)
    if json_:
        emit({"campaign": campaign.name, "cuts": len(rows), "usable": usable, "recordings": [asdict(row) for row in rows]})
    else:
        from rcsa_ident.cli.tables import show_recordings

        show_recordings(rows)
        say(f"{usable} of {len(rows)} recordings usable, {stages.seconds['recordings']:.1f} s")
    if not usable:
        raise typer.Exit(BAD_INPUT)


@answers
def identify(
    campaign_dir: CampaignFolder,
    out: Annotated[Path, typer.Option(help="RESULT.json to write.", show_default=False)],
    method: Annotated[Method, typer.Option(help="paper: the published genetic algorithm, a baseline that takes longer.")] = Method.default,
    seed: Seed = 1,
    processes: Processes = None,
    report: Annotated[Path | None, typer.Option(help="Also write an HTML report.", show_default=False)] = None,
    json_: Json = False,
) -> None:
    """Find modes and joint of a machine from a campaign of ordinary stable cuts.

    A suspect result is written with its reasons and a warning, exit code 0; one that has not converged or has failed is
    written, too, with exit code 3.
    """
    from rcsa_ident.io.files import write_text
    from rcsa_ident.io.results import write_result

    writable(out)
    if report is not None:
        writable(report, "--report")
    stages = Stages(quiet=json_)
    with workers(processes) as pool:
        campaign, judged = read_and_judge(campaign_dir, pool, stages)
        found = search(campaign, judged, method, seed, pool, stages)
    data = result_of(found, campaign, judged)
    write_result(out, data)
    if report is not None:
        from rcsa_ident.report.html import report_html

        write_text(report, report_html(found, campaign, [(j.cut, j.reading) for j in judged]))
    if json_:
        summary = {key: data[key] for key in ("status", "reasons", "seed", "method", "campaign", "band_hz")}
        axes = {name: {k: axis[k] for k in ("modes", "joint", "misfit", "model_error")} for name, axis in data["axes"].items()}
        emit(summary | {"axes": axes, "seconds": stages.seconds, "result": str(out)})
    else:
        from rcsa_ident.cli.tables import show_identification

        show_identification(found)
        warn_left_out(data)
        say(", ".join(f"{name} {seconds:.1f} s" for name, seconds in stages.seconds.items()))
        say(f"written: {out}" + (f", {report}" if report else ""))
    leave(found)


def read_and_judge(folder: Path, pool: Workers, stages: Stages) -> tuple[Campaign, list[JudgedCut]]:
    """Return a campaign with the verdict on each of its recordings."""
    from rcsa_ident.io.recordings import read_cut
    from rcsa_ident.io.setups import read_campaign
    from rcsa_ident.workflows.identify import judge

    campaign = read_campaign(folder)
    with stages.stage("recordings") as progress:
        judged = judge(campaign, partial(read_cut, campaign.sensors, campaign.sampling_rate), pool.map_many, progress)
    return campaign, judged


def search(campaign: Campaign, judged: list[JudgedCut], method: Method, seed: int, pool: Workers, stages: Stages) -> Identification:
    """Return the identification by the method of that name."""
    from rcsa_ident.workflows import identify as workflow

    chosen: workflow.Method
    if method is Method.paper:
        from rcsa_ident.identification.paper import PaperGeneticAlgorithm

        chosen = PaperGeneticAlgorithm()
    else:
        from rcsa_ident.identification.default import DefaultMethod

        chosen = DefaultMethod()
    with stages.stage("identification"):
        return workflow.identify(campaign, judged, chosen, seed, pool.map)


def result_of(found: Identification, campaign: Campaign, judged: list[JudgedCut]) -> dict[str, Any]:
    """Return the content of RESULT.json."""
    from rcsa_ident.io.identifications import identification_to_json

    left_out = [(j.cut.id, "; ".join(j.reading.verdict.reasons)) for j in judged if not j.reading.verdict.usable]
    return identification_to_json(found, campaign, left_out)


def warn_left_out(data: dict[str, Any]) -> None:
    """Print which recordings were left out and why."""
    for cut in data["campaign"]["cuts_left_out"]:
        warn(f"{cut['id']} left out: {cut['reason']}")


def leave(found: Identification) -> None:
    """End with exit code 3 unless there is an answer that may be used."""
    if str(found.status) == "failed" or any(reason.startswith("not converged") for reason in found.reasons):
        raise typer.Exit(NOT_CONVERGED)
    if str(found.status) == "suspect":
        warn("the result is suspect: " + "; ".join(found.reasons))
