"""What real recordings say, of which nobody here knows more than their names: they stay outside the project."""

from __future__ import annotations

import re

import numpy as np
import pytest

from rcsa_ident.base.units import from_rpm, to_rpm
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.io.recordings.open_recording import open_recording
from rcsa_ident.signals.listening import Heard, Listening
from rcsa_ident.signals.measurement import measure_cut
from rcsa_ident.signals.recording import Quantity, Recording, Sensor
from rcsa_ident.signals.tap import tap
from rcsa_ident.signals.verdict import RecordCode
from rcsa_ident.workflows.listen import listen_to
from tests.fixtures.paths import SHARED

pytestmark = pytest.mark.skipif(not SHARED.is_dir(), reason="the real recordings are not there")

#: Part of the file's name: speed [rev/min] of its windows, found by least squares one by one, teeth, and least explained share.
CUTS = {
    "4140SteelCutsAlongX__EBI_F20IN_T100_D0p05IN_4000RPM": (3997.3, 4, 0.74),
    "4140SteelCutsAlongX__EBI_F20IN_T25_D0p125IN_4000RPM": (3997.4, 4, 0.99),
    "4140SteelCutsAlongX__EBI_F20IN_T50_D0p125IN_4000RPM": (3999.2, 4, 0.99),
    "AluminumCutsAlongX__EBI_T100_0p375IN_12000RPM": (11997.4, 3, 0.79),
    "AluminumCutsAlongX__EBI_T50_0p125IN_12000RPM": (11995.3, 3, 0.85),
    "CutsAlongX__EBI_T25_0p25IN_6900RPM": (6896.8, 4, 0.98),
    "EBI_F18IN_T25_D0p125IN_3000RPM_5A_SKF_ON_TABLE": (2998.4, 4, 0.90),
    "SKF_F18IN_T25_D0p125IN_3000RPM_5A_EBI_ON_TABLE": (2999.8, 4, 0.94),
}


def heard(part: str, **told: object) -> Listening:
    (path,) = [each for each in SHARED.rglob("*") if part in each.name]
    opened = open_recording(path)
    quantity, channels, _ = opened.of()
    return listen_to(opened.rate, [each.samples for each in channels], quantity, **told)


@pytest.mark.parametrize("part", CUTS)
def test_stable_cuts_tell_speed_and_teeth(part):
    rpm, teeth, share = CUTS[part]
    answer = heard(part)
    assert answer.verdict is Heard.STABLE
    assert to_rpm(answer.spindle_speed) == pytest.approx(rpm, rel=2e-4)
    assert answer.teeth == teeth
    assert answer.explained_share > share


def test_orders_of_a_recorder_without_a_filter_stand_folded():
    assert heard("CutsAlongX__EBI_T25_0p25IN_6900RPM").folded


@pytest.mark.parametrize("part", [*CUTS, "EBI_T50_0p25IN_6900RPM", "PCB_6000RPM_AirCut"])
def test_accelerometers_alone_are_cuts_of_a_campaign(part):
    """What a campaign makes of them, speed and teeth as they are told."""
    (path,) = [each for each in SHARED.rglob("*") if part in each.name]
    opened = open_recording(path)
    _, channels, _ = opened.of()
    axes = [Dof(next(word for word in each.name.lower().split() if word in "xyz")) for each in channels]
    chosen = [(each, axis) for each, axis in zip(channels, axes, strict=True) if axis is not Dof.Z]
    samples = np.stack([each.samples for each, _ in chosen], axis=1)
    recording = Recording(opened.rate, samples, tuple(Sensor(each.name, Quantity.ACCELERATION, axis) for each, axis in chosen))
    rpm = float(re.search(r"(\d+)RPM", path.name)[1])
    conditions = CuttingConditions(from_rpm(rpm), 3e-3, 5e-5, Engagement(0.0, 0.5 * np.pi))
    teeth = CUTS[part][1] if part in CUTS else 4
    reading = measure_cut(part, "tool", recording, None, Cutter(teeth, 12.7e-3), conditions, CuttingCoefficients(9e8, 0.3))
    if "AirCut" in part:
        assert [reason.code for reason in reading.verdict.reasons] == [RecordCode.NO_CUTTING]
    elif part in CUTS:
        assert reading.verdict.usable, reading.verdict
        assert to_rpm(reading.spindle_speed) == pytest.approx(CUTS[part][0], rel=1e-3)
    else:
        assert [reason.code for reason in reading.verdict.reasons] == [RecordCode.CHATTER]
        assert "at 275 Hz" in reading.verdict.reasons[0]


def test_chatter_of_a_cut_is_named_with_its_aliases():
    answer = heard("EBI_T50_0p25IN_6900RPM")
    assert answer.verdict is Heard.CHATTER
    assert answer.chatter[0] == pytest.approx(275.0, abs=1.0)
    assert any(line == pytest.approx(735.0, abs=1.0) for line in answer.lines)
    assert [round(alias, -1) for alias in answer.aliases[:3]] == [270.0, 1380.0, 1920.0]
    assert answer.suggested_speeds == ()


def test_the_ramp_is_told_as_one():
    answer = heard("7000RPMto6000RPM")
    assert answer.ramp is not None
    assert answer.ramp[1] < answer.ramp[0]
    assert answer.explained_share > 0.8


def test_the_loudest_recording_is_an_air_cut():
    answer = heard("PCB_6000RPM_AirCut")
    assert answer.verdict is Heard.IDLE
    assert to_rpm(answer.spindle_speed) == pytest.approx(5999.6, rel=2e-4)


def test_the_sound_of_chatter_advises_the_speed_that_ran_stably():
    answer = heard("Chatter.wav", teeth=6)
    assert answer.verdict is Heard.CHATTER
    assert to_rpm(answer.spindle_speed) == pytest.approx(1656.0, rel=1e-3)
    assert answer.chatter[0] == pytest.approx(898.8, abs=0.5)
    np.testing.assert_allclose(min(abs(to_rpm(speed) - 4494.0) for speed in answer.suggested_speeds), 0.0, atol=2.0)


def test_the_sound_of_that_speed_is_stable():
    answer = heard("Stable.wav")
    assert answer.verdict is Heard.STABLE
    assert to_rpm(answer.spindle_speed) == pytest.approx(4488.8, rel=3e-4)
    assert to_rpm(heard("Stable.wav", spindle_speed=from_rpm(4494.0)).spindle_speed) == pytest.approx(4488.8, rel=3e-4)


def test_a_real_hit_gives_its_analysers_receptance():
    opened = open_recording(SHARED / "hammer" / "raw_tap_tip_tip.txt")
    force, response = (each.samples for each in opened.channels)
    found = tap(opened.rate, [(force, response)])
    near = (found.omega > 2.0 * np.pi * 300.0) & (found.omega < 2.0 * np.pi * 3000.0)
    peak = int(np.argmax(np.abs(found.receptance[near])))
    assert np.abs(found.receptance[near])[peak] == pytest.approx(6.76e-7, rel=0.01)
    assert found.omega[near][peak] / (2.0 * np.pi) == pytest.approx(1056.0, abs=1.0)
