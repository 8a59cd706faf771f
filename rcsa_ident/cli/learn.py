"""learn: what new cuts teach."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import counted
from rcsa_ident.cli.common import NOT_CONVERGED, Json, Seed, Stages, answers, emit, say, warn, writable
from rcsa_ident.cli.conditions import cut_of, idle_tip, share_of
from rcsa_ident.cli.options import CutOptions, StiffnessSpread, TipOptions, takes_groups
from rcsa_ident.cli.processes import Processes
from rcsa_ident.front.processes import workers
from rcsa_ident.stability.methods import MethodName

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rcsa_ident.machine.learnt_tip import LearntTip
    from rcsa_ident.setup.cut import CutSpec
    from rcsa_ident.setup.tooling import Tooling
    from rcsa_ident.workflows.learn_from_cuts import Believed


_NEW = "Cuts and taps of new toolings"


@answers
@takes_groups
def learn(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="[RESULT.json|MODES.toml|LEARNT.json] TOOLING.toml|CAMPAIGN_DIR",
            help="What is believed before, and the tooling whose labelled cuts --tests tells (with --modes or --frf the tooling alone); "
            "or RESULT.json and a campaign of toolings that are new to the machine (with --taps the tooling alone), written by --toolings.",
            show_default=False,
        ),
    ],
    tip: TipOptions,
    cut: CutOptions,
    tests: Annotated[
        Path | None,
        typer.Option(
            help="CUTS.csv: labelled cuts (spindle_speed_rpm, axial_depth_mm, verdict stable|chatter|marginal; where they are known "
            "chatter_frequency_hz, radial_width_mm, strategy, feed_per_tooth_mm, edge_state, session, verdict_2).",
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="LEARNT.json to write of labelled cuts: lobes, advise and learn take it like a result.")
    ] = None,
    toolings: Annotated[
        Path | None,
        typer.Option(
            help="Folder to write each tooling that is learned to, under its own file name; made if it is not there.",
            rich_help_panel=_NEW,
        ),
    ] = None,
    taps: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[X=]FILE[#RECORD]",
            help="FRF of a hammer test at the tip of TOOLING.toml, response and force there, the spindle at standstill; one per axis. "
            "--frf-units holds for it. A campaign tells its own as tables [[frfs]].",
            show_default=False,
            rich_help_panel=_NEW,
        ),
    ] = None,
    sensor_mass_g: Annotated[
        float, typer.Option(min=0.0, max=1000.0, help="Mass of the sensor that was fixed to the tip [g].", rich_help_panel=_NEW)
    ] = 0.0,
    machine: Annotated[
        Path | None,
        typer.Option(
            help="RESULT.json to write of the machine as these cuts teach it, too: it and the toolings belong together.",
            rich_help_panel=_NEW,
        ),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace files of these names.", rich_help_panel=_NEW)] = False,
    method: Annotated[
        MethodName,
        typer.Option(help="Stability method of every draw's limits; later commands use the same one.", rich_help_panel="Speeds and method"),
    ] = MethodName.FULL_DISCRETISATION,
    stiffness_spread: StiffnessSpread = 0.05,
    seed: Seed = 1,
    processes: Processes = None,
    json_: Json = False,
) -> None:
    """Learn from labelled cuts what modes and limits they leave possible, or from recorded ones what a tooling is that is new to a machine.

    One stable, slow cut of a new tooling is enough, or one hammer test of its tip along X and Y; a tooling that its cuts or taps
    contradict is named and not written, exit code 3.
    """
    from rcsa_ident.cli.learn_toolings import New, learn_from_campaign, learn_from_taps
    from rcsa_ident.io.results.learnt_tips import believed as told
    from rcsa_ident.io.results.learnt_tips import write_learnt_tip
    from rcsa_ident.io.settings.tested_cuts import read_tested_cuts
    from rcsa_ident.stability.lobes import METHODS
    from rcsa_ident.workflows.learn_from_cuts import learn_from_cuts

    if toolings is not None:
        if tests is not None or len(files) != 2:
            found = "--tests, too" if tests is not None else counted(len(files), "file")
            raise InputError("--toolings", found, "RESULT.json and the folder of a campaign, without --tests")
        new = New(toolings, machine, overwrite, json_)
        if taps:
            learn_from_taps(files[0], files[1], taps, tip.frf_units, 1e-3 * sensor_mass_g, new)
        else:
            learn_from_campaign(files[0], files[1], new, processes)
        return
    if taps:
        raise InputError("--taps", "no --toolings", "with --toolings, a folder to write the tooling to that they teach")
    if tests is None or out is None:
        missing = "--tests" if tests is None else "--out"
        raise InputError(missing, "nothing", "--tests and --out for labelled cuts, or --toolings for a campaign of new toolings")
    writable(out)
    spec = cut_of(cut)
    cuts = read_tested_cuts(tests)
    remarks: list[str] = []
    belief, tooling, earlier = believed_of(files, tip, spec, stiffness_spread)
    number = len(cuts.verdict)
    if earlier is not None:
        cuts = earlier.cuts.joined(cuts)
        again = number - (len(cuts.verdict) - len(earlier.cuts.verdict))
        remarks += [f"{again} of the labels are in {files[0]} already and count once"] if again else []
    stages = Stages(quiet=json_)
    with stages.stage("labels"), workers(processes) as pool:
        chosen = METHODS[method]() if earlier is None else earlier.method
        learnt = learn_from_cuts(belief, tooling, spec, cuts, chosen, None if earlier is None else earlier.model, seed, map=pool.map_many)
    write_learnt_tip(out, learnt)
    remarks += [*belief.remarks, *cuts.notes, *learnt.remarks]
    summary = told(learnt)
    if json_:
        status = "suspect" if learnt.remarks else "converged"
        about = {"labels": len(cuts.verdict), "status": status, "effective_draws": learnt.posterior.effective, "believed": summary}
        about |= {"log_evidence": learnt.posterior.log_evidence, "method": learnt.method.name}
        about |= {"weight_of_physics": learnt.trust}
        emit({**about, "warnings": remarks, "seconds": stages.seconds, "out": str(out)})
    else:
        from rcsa_ident.cli.tables import show_believed

        show_believed(summary)
        for remark in remarks:
            warn(remark)
        effective = f"{learnt.posterior.effective:.0f} effective draws"
        if learnt.process is not None:
            physics, without = learnt.posterior.log_evidence, learnt.process.log_evidence
            say(f"log evidence: physics {physics:.1f}, labels without physics {without:.1f}; weight of physics {learnt.trust:.2f}")
        say(f"written: {out} ({len(cuts.verdict)} labels, {effective}, {stages.seconds['labels']:.1f} s)")
    if learnt.remarks:
        raise typer.Exit(NOT_CONVERGED)


def believed_of(
    files: Sequence[Path], tip: TipOptions, cut: CutSpec, stiffness_spread: float
) -> tuple[Believed, Tooling, LearntTip | None]:
    """Return what is believed before further labels, the tooling, and the tip that earlier labels have taught, if there is one."""
    from rcsa_ident.cli.results import read_tip_source
    from rcsa_ident.io.settings.modal_files import read_modes_files
    from rcsa_ident.io.settings.setups import read_tooling
    from rcsa_ident.machine.learnt_tip import LearntTip
    from rcsa_ident.workflows.learn_from_cuts import Believed, believed_of_learnt, believed_of_machine, believed_of_tap_test

    alone = bool(tip.modes or tip.frf)
    if tip.modes and tip.frf:
        raise InputError("--modes and --frf", "both", "one of them")
    if len(files) != (1 if alone else 2):
        wanted = (
            "TOOLING.toml alone"
            if alone
            else "RESULT.json, MODES.toml or LEARNT.json, then TOOLING.toml (or --modes or --frf and TOOLING.toml)"
        )
        raise InputError("files", counted(len(files), "file"), wanted)
    modes = tip.modes or ([str(files[0])] if not alone and files[0].suffix.lower() == ".toml" else [])
    if modes:
        found = read_modes_files(modes)
        tooling = read_tooling(files[-1], tip_known=True)
        own = None if found.coefficients is not None else cut.process(tooling.cutter).coefficients
        return Believed(*found.uncertain_tip(own)), tooling, None
    if alone:
        tooling = read_tooling(files[0], tip_known=True)
        tapped = idle_tip(tip.frf or [], tip.frf_units, tip.frf_from_hz, tip.frf_correction or ())
        return believed_of_tap_test(tapped, cut.process(tooling.cutter).coefficients), tooling, None
    source = read_tip_source(files[0])
    if isinstance(source, LearntTip):
        return believed_of_learnt(source), read_tooling(files[1], tip_known=True), source
    tooling = read_tooling(files[1])
    coefficients = cut.process(tooling.cutter, source.workpiece).coefficients
    return believed_of_machine(source, tooling, coefficients, share_of(stiffness_spread, "--stiffness-spread", 50.0)), tooling, None
