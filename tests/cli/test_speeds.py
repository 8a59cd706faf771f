"""tooltip and lobes of machines that change with the spindle's speed, and the options that go with it."""

from __future__ import annotations

import inspect
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from rcsa_ident.cli import app, lobes
from rcsa_ident.io.curves.tips import read_frf_csv, read_lobes_csv
from rcsa_ident.io.results.identifications import machine_from_json, speed_band_to_json
from rcsa_ident.io.results.parts import read_result
from rcsa_ident.machine.machine import STIFFNESS_SPREAD
from tests.fixtures import by_hand

RPM = 30.0 / np.pi
SPEEDS = ("--speed-from", 6000, "--speed-to", 13000, "--speed-step", 500)


def run(*arguments, code=0):
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    assert result.exit_code == code, result.output + repr(result.exception)
    return result


def tip(path, folder, *more):
    run("tooltip", path, folder / "T1.toml", "--out", folder / "F.csv", "--from", 600, "--to", 2600, "--step", 10, *more)
    return read_frf_csv(folder / "F.csv")


@pytest.mark.slow
def test_a_speed_gives_the_machine_at_that_speed(tmp_path, softening_file):
    curves = tip(softening_file, tmp_path, "--speed", 6500)
    machine = machine_from_json(read_result(softening_file), "")
    response = machine.at(6500.0 / RPM).tip(by_hand.campaign(tmp_path).toolings["T1"], 2.0 * np.pi * curves.frequency)
    for row in response.rows:
        axis = row.dof.upper()
        np.testing.assert_allclose(curves.values[axis], response.between(str(row), str(row)), rtol=1e-10)
        np.testing.assert_allclose(curves.bands[f"{axis}_re_std"], response.deviation()[row, row][0], rtol=1e-8)
    middle = tip(softening_file, tmp_path)
    assert np.linalg.norm(curves.values["X"] - middle.values["X"]) > 0.01 * np.linalg.norm(middle.values["X"])


@pytest.mark.slow
def test_a_machine_that_stays_says_the_same_at_every_speed(tmp_path, result_file):
    one, two = tip(result_file, tmp_path), tip(result_file, tmp_path, "--speed", 50000)
    np.testing.assert_array_equal(one.values["X"], two.values["X"])


@pytest.mark.slow
def test_speeds_beyond_the_campaigns_are_warned_of(tmp_path, softening_file):
    known = f"from {600 * RPM:.0f} to {1400 * RPM:.0f} rev/min"
    for arguments in (("tooltip", "--speed", 20000, "--step", 100), ("lobes", *SPEEDS, "--speed-to", 20000)):
        command, *options = arguments
        result = run(command, softening_file, tmp_path / "T1.toml", "--out", tmp_path / "O.csv", "--no-bands", *options)
        assert known in result.stderr
    result = run("lobes", softening_file, tmp_path / "T1.toml", "--out", tmp_path / "O.csv", "--no-bands", *SPEEDS)
    assert "outside it stays" not in result.stderr


@pytest.mark.slow
def test_lobes_follow_the_machine_over_its_speeds(tmp_path, softening_file):
    out = tmp_path / "L.csv"
    told = json.loads(run("lobes", softening_file, tmp_path / "T1.toml", "--out", out, *SPEEDS, "--json").stdout)
    curves = read_lobes_csv(out)
    assert list(curves.speed) == [*range(6000, 13001, 500)]
    for rpm in (6000, 9500, 13000):
        run("lobes", softening_file, tmp_path / "T1.toml", "--out", out, "--speed-from", rpm, "--speed-to", rpm)
        alone = read_lobes_csv(out)
        k = list(curves.speed).index(rpm)
        assert curves.limit[k] == pytest.approx(alone.limit[0], rel=1e-9)
    for around in told["around"]:
        assert np.all(np.array(around["limit_depth_low_mm"]) < np.array(around["limit_depth_high_mm"]))


@pytest.mark.slow
def test_a_speed_band_answers_with_its_own_model(tmp_path, result_file):
    data = json.loads(result_file.read_text(encoding="utf-8"))
    other = by_hand.identification(softening=True)
    data["speed_bands"] = [speed_band_to_json((600.0, 1000.0), by_hand.identification()), speed_band_to_json((1000.0, 1400.0), other)]
    path = tmp_path / "BANDS.json"
    path.write_text(json.dumps(data), encoding="utf-8")
    whole = tip(path, tmp_path).values["X"]
    np.testing.assert_array_equal(tip(path, tmp_path, "--speed", 7000).values["X"], whole)
    assert np.linalg.norm(tip(path, tmp_path, "--speed", 13000).values["X"] - whole) > 0.01 * np.linalg.norm(whole)


@pytest.mark.slow
def test_a_stiffness_known_less_well_widens_the_bands(tmp_path, result_file):
    exact, usual, ten = (tip(result_file, tmp_path, "--stiffness-spread", percent).bands["X_re_std"] for percent in (0.0, 0.05, 0.5))
    own = [np.sqrt(wide**2 - exact**2) for wide in (usual, ten)]
    assert np.linalg.norm(own[1]) == pytest.approx(10.0 * np.linalg.norm(own[0]), rel=0.03)
    data = json.loads(result_file.read_text(encoding="utf-8"))
    for axis in data["axes"].values():
        axis["rivals"] = []
    # coefficients that are known exactly leave the band to the tip
    del data["coefficients"]
    data["workpiece"] |= {"tangential_coefficient_spread_percent": 0.0, "radial_ratio_spread_percent": 0.0}
    result_file.write_text(json.dumps(data), encoding="utf-8")
    widths = []
    for percent in (0, 5):
        command = (
            "lobes",
            result_file,
            tmp_path / "T1.toml",
            "--out",
            tmp_path / "L.csv",
            *SPEEDS,
            "--stiffness-spread",
            percent,
            "--json",
        )
        around = json.loads(run(*command).stdout)["around"][0]
        widths.append(np.mean(np.array(around["limit_depth_high_mm"]) - around["limit_depth_low_mm"]))
    assert widths[1] > 1.5 * widths[0]


@pytest.mark.parametrize("command", [lobes.tooltip, lobes.lobes])
def test_the_default_spread_is_that_of_the_physics(command):
    assert inspect.signature(command).parameters["stiffness_spread"].default == 100.0 * STIFFNESS_SPREAD


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["tooltip", "--speed", "-5"], "--speed: found -5.0"),
        (["tooltip", "--speed", "0"], "--speed: found 0.0"),
        (["tooltip", "--speed", "nan"], "--speed: found nan"),
        (["tooltip", "--stiffness-spread", "-1"], "--stiffness-spread: found -1.0, allowed is a number from 0 to 50 [%]"),
        (["tooltip", "--stiffness-spread", "nan"], "--stiffness-spread"),
        (["lobes", "--stiffness-spread", "51"], "--stiffness-spread"),
    ],
)
def test_bad_speeds_and_spreads_are_refused(tmp_path, result_file, arguments, words):
    command, *options = arguments
    result = run(command, result_file, tmp_path / "T1.toml", "--out", tmp_path / "O.csv", *options, code=2)
    assert words in result.stderr
    assert not (tmp_path / "O.csv").exists()


@pytest.fixture
def warming_file(tmp_path):
    path = tmp_path / "W.json"
    path.write_text(by_hand.warming_text(tmp_path), encoding="utf-8")
    return path


def test_a_temperature_gives_the_machine_at_that_temperature(tmp_path, warming_file):
    curves, warm = (tip(warming_file, tmp_path, "--speed", 6500, *more) for more in (("--temperature-c", 25), ()))
    machine = machine_from_json(read_result(warming_file), "").at_temperature(25.0)
    response = machine.at(6500.0 / RPM).tip(by_hand.campaign(tmp_path).toolings["T1"], 2.0 * np.pi * curves.frequency)
    for row in response.rows:
        axis = row.dof.upper()
        np.testing.assert_allclose(curves.values[axis], response.between(str(row), str(row)), rtol=1e-10)
        np.testing.assert_allclose(curves.bands[f"{axis}_re_std"], response.deviation()[row, row][0], rtol=1e-8)
        assert np.linalg.norm(curves.values[axis] - warm.values[axis]) > 0.01 * np.linalg.norm(warm.values[axis])


@pytest.mark.parametrize(
    ("more", "told", "swept"),
    [
        (("--temperature-c", 25), "at 25 °C, 9549 rev/min, the middle of the speeds that were cut", "at 25 °C"),
        ((), "warm machine, 9549 rev/min, the middle of the speeds that were cut", "warm machine"),
    ],
)
def test_every_answer_says_for_which_state_it_holds(tmp_path, warming_file, more, told, swept):
    asked = (warming_file, tmp_path / "T1.toml")
    fast = ("--no-bands", *SPEEDS)
    tooltip = ("tooltip", *asked, "--out", tmp_path / "F.csv", "--step", 100, *more)
    over = ("lobes", *asked, "--out", tmp_path / "O.csv", *fast, *more)
    assert told in run(*tooltip).stdout.splitlines()
    assert json.loads(run(*tooltip, "--json").stdout)["state"] == told.partition(", the")[0]
    assert swept in run(*over).stdout.splitlines()
    assert json.loads(run(*over, "--json").stdout)["state"] == swept
    advised = json.loads(run("advise", *asked, "--feed-per-tooth-mm", 0.1, *fast, *more, "--json").stdout)
    assert [each["state"] for each in advised["toolings"]] == [swept]


@pytest.mark.parametrize("command", ["tooltip", "lobes", "advise"])
def test_a_temperature_that_changes_nothing_is_refused(tmp_path, result_file, command):
    more = ("--feed-per-tooth-mm", 0.1) if command == "advise" else ("--out", tmp_path / "O.csv")
    said = run(command, result_file, tmp_path / "T1.toml", *more, "--temperature-c", 24, code=2).stderr
    assert "--temperature-c: found 24 °C, allowed is nothing: it depends on no temperature" in said
    assert len(said.strip().splitlines()) == 1
