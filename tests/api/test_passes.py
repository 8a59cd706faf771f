"""A pass whose speed changes, as a cut of a campaign of the service."""

import tomllib

import pytest

from api.reading.campaign_text import campaign_of_text, declare
from rcsa_ident.base.errors import InputError
from rcsa_ident.io.recordings.hdf5 import write_hdf5
from rcsa_ident.io.settings.machines import read_machine
from tests.api.recordings import declared
from tests.fixtures.paths import MACHINES, TOOLINGS
from tests.fixtures.virtual_pass import RPM, SPEEDS, Pass


def campaign(**changed):
    data = declared(1)
    data["toolings"] = {"T1": tomllib.loads((TOOLINGS / "S1-ER32.toml").read_text("utf-8"))}
    suite = read_machine(MACHINES / "hpm.toml").sensors
    for name, sensor in data["sensors"].items():
        sensor["sensitivity"] = suite.gap_sensitivity if name.startswith("flange") else suite.acceleration_sensitivity
    speeds = {"spindle_speed_rpm": SPEEDS[0] / RPM, "spindle_speed_to_rpm": SPEEDS[1] / RPM}
    data["cuts"][0] |= speeds | changed
    return data


@pytest.mark.slow
def test_a_pass_is_declared_read_and_judged(client, tmp_path):
    made = Pass()
    machine = client.make_machine("m").id
    id = client.make_campaign(machine, campaign()).id
    for kind in ("air", "cut"):
        path = tmp_path / f"c0_{kind}.h5"
        write_hdf5(path, made.cut.rate, made.moving.records[kind].channels)
        client.upload(id, path)
    (cut,) = client.campaign(id).cuts
    assert (cut.spindle_speed_rpm, cut.spindle_speed_to_rpm) == pytest.approx((11500.0, 12500.0))
    assert cut.verdict.usable
    assert cut.verdict.notes == []
    assert cut.verdict.lines > 40
    assert cut.verdict.windows == 5
    assert cut.verdict.spindle_speed_rpm == pytest.approx(12000.0, rel=1e-3)


def test_a_last_speed_that_cannot_be_is_refused():
    with pytest.raises(InputError, match=r"cuts\[0\].spindle_speed_to_rpm"):
        declare(campaign(spindle_speed_to_rpm=SPEEDS[0] / RPM), lambda name: None)


def test_the_kept_text_tells_the_pass():
    _, text, _ = declare(campaign(), lambda name: None)
    assert campaign_of_text(text).cuts[0].last_speed == pytest.approx(SPEEDS[1])
