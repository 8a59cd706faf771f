"""A dynamometer's files that nobody here made, its channels told as on its housing: what comes out beside what was published of them."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from benchmarks.dynamometer import FILES, campaign
from rcsa_ident.io.recordings.readers import read_cut
from rcsa_ident.io.settings.setups import read_campaign
from rcsa_ident.workflows.calibrate import calibrate

pytestmark = pytest.mark.skipif(not (FILES / "dynamometer").is_dir(), reason="the real recordings are not there")


@pytest.fixture(scope="module")
def slots(tmp_path_factory):
    setup = read_campaign(campaign(tmp_path_factory.mktemp("slots")))
    return setup, partial(read_cut, setup.sensors, setup.sampling_rate)


def test_mean_forces_of_three_feeds(slots):
    """K_tc of 959 MPa from five feeds, the feed along the dynamometer's Y, its axes left-handed: known beforehand, not told."""
    told = calibrate(*slots)
    assert told.forces.of("K_tc")[0] < 0.0
    assert "sign or axes of the sensors" in told.forces.reasons[0]
    found = calibrate(*slots, any_axes=True)
    assert found.choices[0].shown() == ("+Y", "+X", "+Z")
    assert found.choices[1].unexplained > 2.0 * found.choices[0].unexplained
    assert found.forces.of("K_tc")[0] == pytest.approx(959e6, rel=0.05)
    assert not found.forces.reasons
    assert any("Fx shows +Y, Fy shows +X, Fz shows +Z" in note for note in found.notes)
    # also of sensors that the campaign tells in another order
    setup = slots[0]
    turned = calibrate(
        replace(setup, sensors=setup.sensors[::-1]), partial(read_cut, setup.sensors[::-1], setup.sampling_rate), any_axes=True
    )
    assert turned.notes == found.notes
    # whatever the feed: run-out
    once = np.array([m.once_per_revolution[1] for m in found.used])
    assert np.all((once > 76.0) & (once < 93.0))


def test_a_choice_that_is_not_clear_is_doubted(slots, monkeypatch):
    """Were the second choice as near as that, the answer would not pass for settled."""
    monkeypatch.setattr("rcsa_ident.workflows.calibrate.CLEAR", 10.0)
    assert "two choices" in calibrate(*slots, any_axes=True).forces.reasons[-1]


@pytest.mark.slow
def test_the_whole_force_over_time(slots):
    """Within a tenth, with the resonances that the dynamometer shows; what stays unexplained is in the intervals."""
    found = calibrate(*slots, signal=True, any_axes=True)
    tangential, width = found.forces.of("K_tc")
    assert tangential == pytest.approx(959e6, rel=0.1)
    assert found.signal is not None
    assert found.signal.sensor.shape == (2, 2)
    assert width >= found.forces.misfit * tangential
    assert any("remains unexplained" in reason for reason in found.forces.reasons)
