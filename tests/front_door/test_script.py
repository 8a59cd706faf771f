"""The script that the front door was made for."""

from __future__ import annotations

import subprocess
import sys

import pytest

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


@pytest.mark.slow(40)
def test_as_it_stands(triggered):
    """No guard, from any folder; the result is the command's, byte for byte."""
    folder = triggered.folder.parents[1]
    code = SCRIPT + "print(found)\nprint(forces)\nfound.save('RESULT.json')\n"
    (folder / "script.py").write_text(code)
    done = subprocess.run([sys.executable, "script.py"], cwd=folder, capture_output=True, text=True, check=True)
    pocket, answer, forces = done.stdout.splitlines()
    assert pocket == "14550 rev/min: stability limit 2.03 mm, recommended 1.68 mm"
    assert answer.startswith("converged, 16 cuts, X ")
    assert "N rms" in forces
    assert done.stderr == ""
    assert (folder / "lobes.svg").read_text().startswith("<?xml")
    command = [sys.executable, "-m", "rcsa_ident.cli", "identify", "data/sample_runs", "--out", "COMMAND.json"]
    subprocess.run(command, cwd=folder, capture_output=True, check=True)
    assert (folder / "RESULT.json").read_bytes() == (folder / "COMMAND.json").read_bytes()


def test_the_same_without_the_search(nouns, tmp_path, monkeypatch, capsys):
    """Line by line, with a machine that was identified before."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(ri, "identify", lambda campaign, seed: nouns.read, raising=False)
    monkeypatch.setattr(ri, "read_campaign", lambda folder: nouns.campaign, raising=False)
    monkeypatch.setattr(ri, "read_tooling", lambda path: nouns.tooling, raising=False)
    monkeypatch.setattr(ri, "read_recording", lambda path, sensors: nouns.recording, raising=False)
    monkeypatch.setattr(ri, "estimate_forces", lambda machine, tool, recording: nouns.forces, raising=False)
    exec(compile(SCRIPT, "script.py", "exec"), {})
    assert "rev/min: stability limit" in capsys.readouterr().out
    assert (tmp_path / "lobes.svg").exists()
