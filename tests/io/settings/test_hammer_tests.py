"""Tables ``[[frfs]]`` of a campaign, and the files that they name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.passivity import Correction
from rcsa_ident.io.curves.hammer import read_hammer_test
from rcsa_ident.io.curves.tips import write_frf_csv
from rcsa_ident.io.settings.setups import read_campaign
from tests.fixtures import by_hand

FREQUENCY = np.arange(100.0, 400.0)
TEST = '[[frfs]]\nid = "nut"\ntooling = "T1"\naxis = "X"\nresponse = "tip"\nforce = 80.0\nfile = "x.csv"\n'


def folder(path, *tests, head='[toolings]\nT1 = "T1.toml"\n'):
    """A campaign of hammer tests alone, on T1."""
    (path / "T1.toml").write_text(by_hand.TOOLING)
    write_frf_csv(path / "x.csv", FREQUENCY, {"X": 1e-8 * np.exp(-1j * FREQUENCY / 100.0)})
    both = {"X": np.full(FREQUENCY.size, 1e-8 + 0j), "Y": np.full(FREQUENCY.size, 3e-8 + 0j)}
    write_frf_csv(path / "both.csv", FREQUENCY, both)
    (path / "campaign.toml").write_text(head + "".join(tests))
    return path


def changed(old, new):
    assert old in TEST
    return TEST.replace(old, new)


def test_hammer_tests_alone_are_a_campaign(tmp_path):
    found = read_campaign(folder(tmp_path, TEST, changed('"nut"', '"Y"').replace('axis = "X"', 'axis = "Y"').replace("x.csv", "both.csv")))
    assert found.cuts == ()
    assert found.workpiece is None
    nut, other = found.tests
    assert (nut.id, nut.tooling, nut.axis, nut.response, nut.force) == ("nut", "T1", Dof.X, 0.0, pytest.approx(0.08))
    assert nut.standstill
    assert (nut.band, nut.error, nut.sensor_mass, nut.record, nut.units) == ((0.0, np.inf), 0.02, 0.0, None, None)
    assert str(nut) == "nut: T1, X, the tip for a force at 80 mm from the tip"
    assert "2 hammer tests with T1" in str(found)
    frequency, value = read_hammer_test(nut)
    np.testing.assert_allclose(frequency, FREQUENCY)
    np.testing.assert_allclose(value, 1e-8 * np.exp(-1j * FREQUENCY / 100.0), rtol=1e-6)
    # of a file with both axes its own counts
    np.testing.assert_allclose(read_hammer_test(other)[1], 3e-8, rtol=1e-6)
    with pytest.raises(InputError, match=r"workpiece: found nothing, allowed is a table \[workpiece\]"):
        _ = found.coefficients


def test_all_keys(tmp_path):
    more = 'units = "m/N"\nstandstill = false\nsensor_mass_g = 4\nfrom_hz = 200\nto_hz = 300\nerror_percent = 5\nrecord = 1\n'
    (test,) = read_campaign(folder(tmp_path, changed("force = 80.0", 'force = "flange"') + more)).tests
    assert test.force is None
    assert not test.standstill
    assert (test.band, test.error, test.record) == ((200.0, 300.0), 0.05, 1)
    assert test.sensor_mass == pytest.approx(0.004)
    assert test.correction is Correction.AUTO


def test_a_test_of_one_point_is_turned_where_that_is_certain_or_asked(tmp_path):
    ratio = FREQUENCY / 250.0
    h = 1.0 / (1e7 * (1.0 - ratio**2 + 0.1j * ratio))
    path = folder(tmp_path, changed("force = 80.0", 'force = "tip"'))
    np.savetxt(tmp_path / "turned.frf", np.stack([FREQUENCY, -h.real, -h.imag], axis=1), header="f[Hz] Re[m/N] Im[m/N]", comments="")
    (test,) = read_campaign(path).tests
    test = replace(test, file=tmp_path / "turned.frf")
    found = read_hammer_test(test)
    np.testing.assert_allclose(found[1], h, rtol=1e-9)
    assert "a reversed sensor or hammer explains it" in found.remarks[0]
    # of two points the sign is not known
    elsewhere = replace(test, force=0.08)
    assert read_hammer_test(elsewhere).remarks == ()
    np.testing.assert_allclose(read_hammer_test(elsewhere)[1], -h, rtol=1e-9)
    np.testing.assert_allclose(read_hammer_test(replace(elsewhere, correction=Correction.REVERSE))[1], h, rtol=1e-9)
    (asked,) = read_campaign(folder(tmp_path, changed("force = 80.0", 'force = 80.0\ncorrection = "reverse"'))).tests
    assert asked.correction is Correction.REVERSE


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("force = 80.0", "force = 800.0", r"frfs\[0\].force: found 800\.0, allowed is one of tip, flange, or the distance from the tip"),
        ("force = 80.0", 'force = "nut"', r"frfs\[0\].force: found the text .nut., allowed is one of tip, flange"),
        ('response = "tip"\nforce = 80.0', 'response = "flange"\nforce = "flange"', r"force: found flange, allowed is a point of"),
        ('tooling = "T1"', 'tooling = "T2"', r"frfs\[0\].tooling"),
        ('axis = "X"', 'axis = "Z"', r"frfs\[0\].axis"),
        ('file = "x.csv"', 'file = "z.csv"', r"frfs\[0\].file: found .*which does not exist"),
        ('file = "x.csv"', 'file = "x.csv"\nfrom_hz = 300\nto_hz = 200', r"frfs\[0\].to_hz"),
        ('file = "x.csv"', 'file = "x.csv"\nstandstil = true', "standstil"),
        ('file = "x.csv"', 'file = "x.csv"\ncorrection = "backwards"', r"frfs\[0\].correction: found .*backwards"),
        ('id = "nut"', "id = 3", r"frfs\[0\].id"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, old, new, message):
    with pytest.raises(InputError, match=message):
        read_campaign(folder(tmp_path, changed(old, new)))


def test_ids_are_told_apart(tmp_path):
    with pytest.raises(InputError, match=r"frfs\[1\].id: found .nut., the id of frfs\[0\]"):
        read_campaign(folder(tmp_path, TEST, TEST))


def test_a_campaign_of_nothing_still_asks_for_cuts(tmp_path):
    with pytest.raises(InputError, match="sensors"):
        read_campaign(folder(tmp_path))


def test_one_frf_of_several_is_asked_for_by_its_number(tmp_path):
    campaign = read_campaign(folder(tmp_path, TEST + "record = 7\n"))
    with pytest.raises(InputError, match="record: found no such record, allowed is the number of one FRF of the file"):
        read_hammer_test(campaign.tests[0])


def test_units_that_are_none_are_named(tmp_path):
    campaign = read_campaign(folder(tmp_path, TEST + 'units = "furlong"\n'))
    with pytest.raises(InputError, match=r"units: found furlong, allowed is motion over force"):
        read_hammer_test(campaign.tests[0])
