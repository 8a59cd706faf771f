"""Options that say what stands around a cutter, as far as the process that they make."""

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from rcsa_ident.cli.conditions import cut_of
from rcsa_ident.cli.options import CutOptions, takes_groups
from rcsa_ident.cutting.conditions import Block, Engagement, Stepover
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.profile import Profile

KNOWN = ("--ktc-mpa", 900, "--krc", 0.3)


@pytest.mark.parametrize(
    ("more", "engagement"),
    [
        ((), Stepover(0.006, "down")),
        (("--immersion", 0.25, "--strategy", "up"), Stepover(0.003, "up")),
        (("--immersion", 1), Engagement(0.0, np.pi)),
        (("--stock", "block", "--y-from-mm", -6, "--y-to-mm", -2), Block(-0.006, -0.002)),
        (("--entry-deg", 90, "--exit-deg", 180), Engagement(0.5 * np.pi, np.pi)),
    ],
)
def test_what_stands_around_a_shape_reaches_the_process(more, engagement):
    seen = []
    app = typer.Typer()

    @app.command()
    @takes_groups
    def ask(cut: CutOptions) -> None:
        seen.append(cut_of(cut).process(Cutter(2, 0.012, profile=Profile.ball(0.012))))

    assert CliRunner().invoke(app, [str(word) for word in (*KNOWN, "--kac", 0.2, *more)]).exit_code == 0
    assert seen[0].engagement == engagement
    assert seen[0].coefficients.axial_ratio == 0.2


def test_a_map_reaches_the_process(tmp_path):
    (tmp_path / "M.csv").write_text("z_mm,entry_angle_deg,exit_angle_deg\n0,10,40\n1,20,60\n", encoding="utf-8")
    spec = cut_of(CutOptions(ktc_mpa=900.0, krc=0.3, engagement=tmp_path / "M.csv", lead_deg=10.0))
    found = spec.process(Cutter(2, 0.012, profile=Profile.ball(0.012))).engagement
    assert np.degrees(found.end).round(9).tolist() == [40.0, 60.0]
    assert np.degrees(found.feed_rise) == pytest.approx(10.0)
