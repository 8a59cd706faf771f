"""Cuts that the virtual machine tries: far from the limit nobody disputes them."""

from __future__ import annotations

import numpy as np

from benchmarks import tested_cuts as cuts
from rcsa_ident.io.settings.cases import read_cases
from rcsa_ident.stability.labels.tested_cuts import Verdict


def test_a_case_is_written_as_the_command_reads_it(tmp_path, monkeypatch):
    monkeypatch.setattr(cuts, "SPEEDS", 2)
    monkeypatch.setattr(cuts, "CUTS", 4)
    (tmp_path / "CASES.toml").write_text(cuts._case(tmp_path, 2, *cuts.CASES[2]), encoding="utf-8")
    (case,) = read_cases(tmp_path / "CASES.toml")
    assert case.tooling.name == "S3-PG25-long"
    # 70 % of the diameter, up
    assert (case.engagement.entry, round(float(np.cos(case.engagement.exit)), 9)) == (0.0, -0.4)
    assert case.cuts is not None
    assert len(case.cuts.verdict) == 8
    seen = {verdict: case.cuts.axial_depth[case.cuts.seen(verdict)] for verdict in Verdict}
    assert seen[Verdict.STABLE].size
    assert seen[Verdict.CHATTER].size
    for speed in np.unique(case.cuts.spindle_speed):
        here = case.cuts.spindle_speed == speed
        stable, chatter = (case.cuts.axial_depth[here & case.cuts.seen(v)] for v in (Verdict.STABLE, Verdict.CHATTER))
        # at one speed no cut is stable that is deeper than one that chatters
        assert stable.max(initial=0.0) < chatter.min(initial=1.0)
