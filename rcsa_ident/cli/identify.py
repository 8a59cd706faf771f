"""check and identify: from a campaign's folder to verdicts and modes."""

from __future__ import annotations

from dataclasses import asdict
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import to_hz, to_rpm
from rcsa_ident.cli.common import (
    BAD_INPUT,
    NOT_CONVERGED,
    Json,
    Seed,
    Stages,
    answers,
    emit,
    say,
    warn,
    writable,
)
from rcsa_ident.cli.processes import Dask, Processes, workers_or_cluster
from rcsa_ident.front.processes import Workers
from rcsa_ident.identification.status import Status

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rcsa_ident.base.arrays import FloatArray
    from rcsa_ident.dynamics.coordinates import Dof
    from rcsa_ident.identification.hammer_lines import HammerLines
    from rcsa_ident.identification.method import Method as IdentificationMethod
    from rcsa_ident.identification.posterior import PlaneUnknowns, Posterior
    from rcsa_ident.identification.result import Identification
    from rcsa_ident.setup.campaign import Campaign
    from rcsa_ident.signals.measurement import Reading
    from rcsa_ident.workflows.speed_bands import SpeedBand

CampaignFolder = Annotated[Path, typer.Argument(help="Folder with campaign.toml, toolings and recordings.", show_default=False)]


class Method(StrEnum):
    """Identification methods by the names that they have in a result file."""

    default = "default"
    paper = "paper"


@answers
def check(campaign_dir: CampaignFolder, processes: Processes = None, dask: Dask = None, json_: Json = False) -> None:
    """Read everything and give a verdict on every recording; nothing is identified."""
    from rcsa_ident.identification.status import too_few
    from rcsa_ident.report.summaries import recording_rows
    from rcsa_ident.workflows.coverage import left_open
    from rcsa_ident.workflows.cut_times import time_remarks

    stages = Stages(quiet=json_)
    with workers_or_cluster(processes, dask) as pool:
        campaign, readings = read_and_judge(campaign_dir, pool, stages)
    tests = read_tests(campaign)
    rows, open_, remarks = recording_rows(readings), left_open(campaign, readings), (*campaign.remarks, *time_remarks(campaign, readings))
    usable = sum(row.usable for row in rows)
    # each window of a pass is a cut of its own
    of_flange = not any(measurement.housing for each in readings for measurement in each.measurements)
    judges = {cut.id for cut in campaign.cuts if cut.validation}
    few = too_few((each.tooling for each in readings if each.cut_id not in judges for _ in each.measurements), of_flange)
    if json_:
        told = {"campaign": campaign.name, "cuts": len(rows), "usable": usable, "too_few": few}
        told |= {"left_open": list(open_), "warnings": list(remarks)}
        told |= {"hammer_tests": [_about(test) for test in tests]} if tests else {}
        emit(told | {"recordings": [asdict(row) for row in rows]})
    else:
        from rcsa_ident.cli.tables import show_recordings

        if rows:
            show_recordings(rows)
        for test in tests:
            seen = _about(test)
            lines = "{} lines from {:.0f} to {:.0f} Hz".format(seen["lines"], *seen["band_hz"])
            say(f"hammer test {test.id}: {lines} are used, each known to {seen['deviation_percent']:.2g} % (median)")
        for sentence in open_:
            say(f"note: {sentence}")
        for remark in remarks:
            warn(remark)
        if rows:
            say(f"{usable} of {len(rows)} recordings usable, {stages.seconds['recordings']:.1f} s")
        if few is not None and not tests:
            warn(few)
    if not usable and not tests:
        raise typer.Exit(BAD_INPUT)


def _about(test: HammerLines) -> dict[str, Any]:
    """What is said of a hammer test before anything is identified."""
    import numpy as np

    deviation = float(np.median(np.sqrt(2.0 * test.variance) / np.abs(test.value)))
    band = [float(to_hz(w)) for w in test.omega[[0, -1]]]
    return {"id": test.id, "lines": test.omega.size, "band_hz": band, "deviation_percent": 100.0 * deviation}


@answers
def identify(
    campaign_dir: CampaignFolder,
    out: Annotated[Path, typer.Option(help="RESULT.json to write.", show_default=False)],
    method: Annotated[Method, typer.Option(help="paper: the published genetic algorithm, a baseline that takes longer.")] = Method.default,
    seed: Seed = 1,
    processes: Processes = None,
    dask: Dask = None,
    start: Annotated[
        Path | None,
        typer.Option(
            help="RESULT.json of the same machine to start from: its modes are refined with this campaign's cuts.", show_default=False
        ),
    ] = None,
    speed_bands: Annotated[
        int, typer.Option(min=1, max=50, help="Number of equal spindle speed ranges that also get a model of their own, if above 1.")
    ] = 1,
    report: Annotated[Path | None, typer.Option(help="Also write an HTML report.", show_default=False)] = None,
    json_: Json = False,
) -> None:
    """Find modes and joint of a machine from a campaign of ordinary stable cuts.

    The result is written whatever its status. The exit code is 0 where it has converged or is not validated, else 3, suspect or failed:
    its reasons say why.
    """
    from rcsa_ident.io.files import write_text
    from rcsa_ident.io.results.parts import write_result

    writable(out)
    if report is not None:
        writable(report, "--report")
    if method is Method.paper and (start is not None or speed_bands > 1):
        raise InputError("--start" if start is not None else "--speed-bands", "--method paper", "the default method, which has a posterior")
    stages = Stages(quiet=json_)
    with workers_or_cluster(processes, dask) as pool:
        known = None if start is None else read_start(start)
        campaign, readings = read_and_judge(campaign_dir, pool, stages)
        tests = read_tests(campaign)
        if speed_bands > 1:
            from rcsa_ident.workflows.speed_bands import split_by_speed

            split_by_speed(readings, speed_bands)
        found = search(campaign, readings, method, seed, pool, stages, known, tests)
        bands = search_bands(campaign, readings, speed_bands, found, seed, pool, stages)
    from rcsa_ident.workflows.identify import mode_deviations

    deviations = mode_deviations(found)
    data = result_of(found, campaign, readings, deviations, bands)
    if start is not None:
        data["started_from"] = start.name
    write_result(out, data)
    if report is not None:
        from rcsa_ident.report.html import report_html

        write_text(report, report_html(found, campaign, readings, deviations=deviations))
    if json_:
        summary = {key: data[key] for key in ("status", "reasons", "seed", "method", "campaign", "band_hz")}
        summary |= {key: data[key] for key in ("notes", "coefficients")}
        axes = {name: {k: axis[k] for k in ("modes", "joint", "misfit", "model_error")} for name, axis in data["axes"].items()}
        summary |= {"toolings": data["toolings"].get("learned", [])} if "toolings" in data else {}
        summary |= {"workpiece_side": data["workpiece_side"]} if "workpiece_side" in data else {}
        emit(summary | {"axes": axes, "seconds": stages.seconds, "result": str(out)})
    else:
        from rcsa_ident.cli.tables import show_identification

        show_identification(found, deviations)
        for band in bands:
            low, high = (to_rpm(speed) for speed in band.speeds)
            say(f"{low:.0f} to {high:.0f} rev/min: {band.found.status}, {len(band.found.cut_ids)} cuts")
        warn_left_out(data)
        say(", ".join(f"{name} {seconds:.1f} s" for name, seconds in stages.seconds.items()))
        say(f"written: {out}" + (f", {report}" if report else ""))
    exit_by_status(found)


def read_and_judge(folder: Path, pool: Workers, stages: Stages) -> tuple[Campaign, list[Reading]]:
    """Return a campaign with the verdict on each of its recordings."""
    from rcsa_ident.io.recordings.readers import read_cut
    from rcsa_ident.io.settings.setups import read_campaign
    from rcsa_ident.workflows.identify import judge

    # a worker elsewhere stands in another folder
    campaign = read_campaign(folder if pool.cluster is None else folder.resolve())
    with stages.stage("recordings") as progress:
        readings = judge(campaign, partial(read_cut, campaign.sensors, campaign.sampling_rate), pool.map_many, progress)
    return campaign, readings


def read_tests(campaign: Campaign) -> tuple[HammerLines, ...]:
    """Return the lines of a campaign's hammer tests."""
    from rcsa_ident.io.curves.hammer import read_hammer_test
    from rcsa_ident.workflows.identify import hammer_lines

    return hammer_lines(campaign, read_hammer_test)


def read_start(path: Path) -> Mapping[Dof, Posterior | PlaneUnknowns]:
    """Return what an earlier answer gives to start from. Raises `InputError` if the file holds none, as with the published method."""
    from rcsa_ident.io.results.identifications import machine_from_json
    from rcsa_ident.io.results.parts import read_result

    try:
        return machine_from_json(read_result(path), str(path)).starts()
    except InputError as error:
        raise error if error.where else error.at(str(path)) from None


def search(
    campaign: Campaign,
    readings: list[Reading],
    method: Method,
    seed: int,
    pool: Workers,
    stages: Stages,
    start: Mapping[Dof, Posterior | PlaneUnknowns] | None = None,
    tests: Sequence[HammerLines] = (),
) -> Identification:
    """Return the identification by the method of that name; the default one may start from an earlier answer and takes tests."""
    from rcsa_ident.workflows import identify as workflow

    chosen: IdentificationMethod
    if method is Method.paper:
        from rcsa_ident.identification.genetic_algorithm import PaperGeneticAlgorithm

        chosen = PaperGeneticAlgorithm()
    else:
        from rcsa_ident.identification.evidence import EvidenceSelection

        chosen = EvidenceSelection(start=start)
    with stages.stage("identification") as line, pool.listening(line.tell) as progress:
        return workflow.identify(campaign, readings, chosen, seed, pool.map, progress if stages.visible else None, tests)


def search_bands(
    campaign: Campaign, readings: list[Reading], count: int, whole: Identification, seed: int, pool: Workers, stages: Stages
) -> list[SpeedBand]:
    """Return a model for each of `count` ranges of spindle speed, from the whole campaign's on; none where only one is wanted."""
    from rcsa_ident.identification.evidence import EvidenceSelection
    from rcsa_ident.workflows.speed_bands import speed_bands

    if count == 1 or not whole.axes:
        return []
    start = whole.machine.starts()
    with stages.stage("speed bands"):
        return speed_bands(campaign, readings, count, EvidenceSelection(start=start), seed, pool.map)


def result_of(
    found: Identification,
    campaign: Campaign,
    readings: list[Reading],
    deviations: Mapping[Dof, tuple[FloatArray, FloatArray]],
    bands: Sequence[SpeedBand] = (),
) -> dict[str, Any]:
    """Return the content of RESULT.json."""
    from rcsa_ident.io.results.identifications import identification_to_json, speed_band_to_json
    from rcsa_ident.workflows.identify import left_out, mode_deviations

    data = identification_to_json(found, campaign, left_out(readings), deviations)
    if bands:
        data["speed_bands"] = [speed_band_to_json(band.speeds, band.found, mode_deviations(band.found)) for band in bands]
    return data


def warn_left_out(data: dict[str, Any]) -> None:
    """Print which recordings were left out and why."""
    for cut in data["campaign"]["cuts_left_out"]:
        warn(f"{cut['id']} left out: {cut['reason']}")


def exit_by_status(found: Identification) -> None:
    """End with exit code 3 where something speaks against the answer."""
    if found.status not in (Status.CONVERGED, Status.NOT_VALIDATED):
        warn(f"the result is {found.status}: " + "; ".join(found.reasons))
        raise typer.Exit(NOT_CONVERGED)
