"""FRFs of a tip that no tip can have: turned where that is certain or asked for, and said in every answer."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import rcsa_ident as ri
from rcsa_ident.base.errors import InputError
from rcsa_ident.cli import app
from rcsa_ident.io.curves.frf_files import Source, read_tap_tests
from rcsa_ident.io.curves.hammer import read_hammer
from rcsa_ident.io.curves.tips import read_lobes_csv
from tests.cli.test_tap import told

FREQUENCY = np.arange(200.0, 2000.0, 5.0)
RATIO = FREQUENCY / 900.0
H = 1.0 / (2e7 * (1.0 - RATIO**2 + 0.06j * RATIO))
TOOL = 'name = "T"\n[cutter]\nteeth = 4\ndiameter_mm = 16.0\nhelix_deg = 30.0\n'
CUT = ("--ktc-mpa", 700, "--krc", 0.3, "--speed-from", 4000, "--speed-to", 6000, "--speed-step", 500)


def written(path, values, head="Frequency (Hz)\tReal (m/N)\tImag (m/N)"):
    np.savetxt(path, np.stack([FREQUENCY, values.real, values.imag], axis=1), fmt="%.12e", delimiter="\t", header=head, comments="")
    return path


@pytest.fixture
def shop(tmp_path):
    (tmp_path / "T.toml").write_text(TOOL)
    for name, values in {"ok": H, "conjugated": np.conj(H), "reversed": -H}.items():
        written(tmp_path / f"{name}.txt", values)
    written(tmp_path / "untold.txt", -((2.0 * np.pi * FREQUENCY) ** 2) * H, "f Re Im")
    return tmp_path


def lobes(shop, *options, code=0):
    found = CliRunner().invoke(app, [str(each) for each in ("lobes", *options, shop / "T.toml", *CUT, "--out", shop / "L.csv", "--json")])
    assert found.exit_code == code, found.stderr
    if code:
        return found.stderr, None
    return json.loads(found.stdout)["warnings"], read_lobes_csv(shop / "L.csv").limit


def test_a_conjugated_or_reversed_frf_has_the_limits_of_the_right_one(shop):
    warnings, limits = lobes(shop, "--frf", f"X={shop}/ok.txt")
    assert not any("FRF X" in warning for warning in warnings)
    for name, words in (("conjugated", "time as e^(-iωt)"), ("reversed", "a reversed sensor or hammer")):
        warnings, found = lobes(shop, "--frf", f"X={shop}/{name}.txt")
        np.testing.assert_allclose(found, limits, rtol=1e-9)
        (warning,) = [each for each in warnings if each.startswith("FRF X: Im > 0 at 900 Hz")]
        assert f"{words} explains it, and the FRF was turned" in warning


def test_what_is_not_certain_is_named_and_turned_where_that_is_asked(shop):
    expected = lobes(shop, "--frf", f"X={shop}/ok.txt")[1]
    warnings, _ = lobes(shop, "--frf", f"X={shop}/untold.txt")
    assert any("an accelerance whose unit nobody told or a reversed sensor" in each for each in warnings)
    warnings, found = lobes(shop, "--frf", f"X={shop}/untold.txt", "--frf-units", "m/s^2/N")
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    assert not any("Im > 0" in each for each in warnings)
    both = ("--frf", f"X={shop}/ok.txt", "--frf", f"Y={shop}/conjugated.txt")
    warnings, kept = lobes(shop, *both, "--frf-correction", "Y=none")
    assert any("FRF Y: Im > 0" in each and "would explain it" in each for each in warnings)
    warnings, asked = lobes(shop, *both, "--frf-correction", "y=conjugate")
    assert not any("Im > 0" in each for each in warnings)
    # what it promises as it stands: no limit up to 10 mm
    assert np.all(np.isnan(kept))
    assert np.all(asked < 10.0)


@pytest.mark.parametrize(
    ("option", "words"), [("Z=reverse", "given as --frf Z=FILE"), ("backwards", "auto, none, reverse"), ("X=", "auto, none, reverse")]
)
def test_corrections_that_are_none(shop, option, words):
    message, _ = lobes(shop, "--frf", f"X={shop}/ok.txt", "--frf-correction", option, code=2)
    assert words in " ".join(message.split())


def test_every_other_reader_of_taps_turns_and_says_it(shop):
    (shop / "conjugated.txt").rename(shop / "tip_x.txt")
    found = read_hammer(shop / "tip_x.txt").values["X"]
    np.testing.assert_allclose(found[1], H, rtol=1e-9)
    assert found.remarks[0].startswith("tip_x.txt: Im > 0 at 900 Hz")
    # a sign of its own has a cross FRF: it turns clockwise, or time runs backwards
    pairs = [Source(shop / "ok.txt", ("X", "X")), Source(shop / "ok.txt", ("Y", "Y")), Source(shop / "reversed.txt", ("X", "Y"))]
    assert read_tap_tests(pairs)["X", "Y"].remarks == ()
    both = read_tap_tests([*pairs, Source(shop / "ok.txt", ("Y", "X"))])
    assert both["X", "Y"].remarks == (
        "XY and YX differ by 200 %, against reciprocity: a reversed sensor or hammer in one of them would explain it",
    )
    turned = read_tap_tests([*pairs[:2], Source(shop / "tip_x.txt", ("X", "Y"))])["X", "Y"]
    np.testing.assert_allclose(turned[1], H, rtol=1e-9)
    with pytest.raises(InputError, match="correction: found backwards"):
        ri.read_tap_tests(x=shop / "ok.txt", correction="backwards")


def test_a_tap_names_a_reversed_sensor_and_turns_it_where_that_is_asked(tmp_path):
    path = told(tmp_path / "hits.csv", "N", "m/s^2", response_factor=-1.0)
    answers = []
    for options in ((), ("--reverse",)):
        arguments = ["tap", path, "--out", tmp_path / "tip.csv", "--json", *options]
        found = CliRunner().invoke(app, [str(each) for each in arguments])
        assert found.exit_code == 0, found.stderr
        answers.append((json.loads(found.stdout)["remarks"], read_tap_tests([Source(tmp_path / "tip.csv")], from_hz=300.0)["X", "X"]))
    (said, before), (nothing, after) = answers
    assert ["a reversed sensor or hammer" in remark for remark in said] == [True]
    assert nothing == []
    # the file is as it was tapped; who reads it as a tip's turns it
    assert "the FRF was turned" in before.remarks[0]
    np.testing.assert_allclose(before[1], after[1], rtol=1e-6)
