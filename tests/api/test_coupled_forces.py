"""Forces over REST and as a stream of a machine whose axes feel each other: what the library says of the same record."""

from __future__ import annotations

import numpy as np
import pytest

import api.streams.design
import api.work.forces
from api.codec import decode
from api.streams.design import StreamQuestion, design_replay
from api.work.forces import ForceQuestion, forces
from api.work.requests import MachineText, ToolingSource
from rcsa_ident.signals.recording import Recording
from rcsa_ident.workflows.estimate_forces import observe
from tests.fixtures.force_stream import tooling
from tests.fixtures.oblique_cut import oblique_cut, oblique_machine
from tests.fixtures.virtual_cut import CASE

pytestmark = pytest.mark.slow
MACHINE, TOOL = MachineText("", "{}"), ToolingSource("T1", tooling())


@pytest.fixture(autouse=True)
def known(monkeypatch):
    """A file with cross terms takes an identification of minutes; here the machine is known."""
    for place in (api.work.forces, api.streams.design):
        monkeypatch.setattr(place, "read", lambda _: oblique_machine())


def records(kept=(0, 1, 2, 3)):
    both = (oblique_cut().cut, oblique_cut().air)
    return tuple(Recording(r.rate, r.samples[:, list(kept)], tuple(r.sensors[i] for i in kept)) for r in both)


def test_rest_gives_the_forces_of_both_axes():
    answer = forces(MACHINE, TOOL, ForceQuestion(CASE.spindle_speed), records)
    for i, axis in enumerate("XY"):
        assert answer["axes"][axis]["rms_n"] == pytest.approx(np.std(oblique_cut().force[:, i]), rel=0.05)
    assert not any("feel each other" in note for note in answer["notes"])


def test_one_sensor_axis_is_said_over_rest_and_before_a_stream():
    one = forces(MACHINE, TOOL, ForceQuestion(CASE.spindle_speed), lambda: records((0, 2)))
    assert list(one["axes"]) == ["X"]
    question = StreamQuestion(oblique_cut().cut.rate, CASE.spindle_speed, records((0, 2))[0].sensors, ("X",), "cut", "resonators")
    _, ready = design_replay(MACHINE, TOOL, question, lambda: records((0, 2)))
    for notes in (one["notes"], ready["notes"]):
        assert any("X and Y feel each other, and Y has no displacement sensor" in note for note in notes)


def test_a_replayed_stream_is_the_record():
    """The plan goes to another process; its forces are those of the whole record, in the order that was asked for."""
    cut, air = records()
    question = StreamQuestion(cut.rate, CASE.spindle_speed, cut.sensors, ("Y", "X"), "cut", "resonators")
    raw, ready = design_replay(MACHINE, TOOL, question, records)
    plan = decode(raw)
    assert len(plan.observer.observer.filters) == 1
    state, found = plan.observer.init(), []
    for part in np.split(cut.samples, [700, 3000]):
        state, block = plan.observer.run(state, *plan.signals(part))
        found.append(block.force)
    whole = observe(oblique_machine(), oblique_cut().tooling.assembly, 2, cut, air, CASE.spindle_speed).estimate.force
    np.testing.assert_allclose(np.concatenate(found)[plan.settling :], whole, atol=1e-9 * np.abs(whole).max(), rtol=0.0)
    assert plan.order == (1, 0)
    assert ready["axes"] == ["Y", "X"]
    assert ready["std_n"]["X"] > 0.0
