"""The script that the front door was made for."""

from __future__ import annotations

import rcsa_ident as ri

SCRIPT = """
import rcsa_ident as ri

campaign = ri.read_campaign("data/sample_runs")
found = ri.identify(campaign, seed=1)
machine = found.machine
tool = ri.read_tooling("data/machines/toolings/S3-PG25-long.toml")

tip = machine.tip(tool)
cut = ri.MillingProcess(tool.cutter, machine.workpiece.coefficients, ri.Engagement.from_immersion(0.5, "down"))
lobes = ri.stability_lobes(tip, cut, ri.rpm(4000, 20_000, 50), max_depth=10e-3, method=ri.ZeroOrder())

print(lobes.best_speeds()[0])
ri.plot_lobes(lobes).savefig("lobes.svg")
forces = ri.estimate_forces(machine, tool, ri.read_recording("cut.h5", campaign.sensors))
"""


def test_it_runs_line_by_line(nouns, tmp_path, monkeypatch, capsys):
    """With a machine that was identified before; scripts that identify run in `tests/docs/test_page_outputs.py`."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(ri, "identify", lambda campaign, seed: nouns.read, raising=False)
    monkeypatch.setattr(ri, "read_campaign", lambda folder: nouns.campaign, raising=False)
    monkeypatch.setattr(ri, "read_tooling", lambda path: nouns.tooling, raising=False)
    monkeypatch.setattr(ri, "read_recording", lambda path, sensors: nouns.recording, raising=False)
    monkeypatch.setattr(ri, "estimate_forces", lambda machine, tool, recording: nouns.forces, raising=False)
    exec(compile(SCRIPT, "script.py", "exec"), {})
    assert "rev/min: stability limit" in capsys.readouterr().out
    assert (tmp_path / "lobes.svg").exists()
