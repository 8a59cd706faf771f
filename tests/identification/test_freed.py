"""What the lines ask for beyond the machine becomes a part of the model: machines without an ideal, drawn for development."""

import pytest

from benchmarks.ideals import KINDS, identified


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "code", "error"), [("chip law", "force-orders", 0.03), ("warming at random", "drifts-with-time", 0.02), ("none", "", 0.01)]
)
def test_the_cause_is_learned(tmp_path, name, code, error):
    """Without it errors of this machine's tips were 0.09 and 0.06 at worst, at twice the level.

    They are 0.018 and 0.013 with the libraries' kernels for one processor, 0.021 and 0.017 with those for another one, whose bands of the
    warming machine are wider than the status asks for.
    """
    row = identified(tmp_path, 7103, name, 0.5, told=True)
    assert row["status"] != "failed"
    assert any(reason.startswith(code or "joint-unknown") for reason in row["reasons"][:3])
    assert max(row[kind]["error"] for kind in KINDS) < error
    assert min(row[kind]["band"] for kind in KINDS) > 0.55


@pytest.mark.slow
def test_a_joint_that_gives_way_is_learned(tmp_path):
    """The joint of the virtual machine is softer in loud cuts; without that this machine's tips were wrong by 0.049, and are by 0.034."""
    row = identified(tmp_path, 7101, "joint", 0.5, told=True)
    assert any(each.startswith("joint-gives-way: joint stiffness in the loudest cut") and " % lower " in each for each in row["reasons"])
    assert max(row[kind]["error"] for kind in KINDS) < 0.045


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "code", "error"),
    [("warming, with a clock", "drifts-with-time", 0.035), ("warming, with a thermometer", "drifts-with-temperature", 0.01)],
)
def test_times_and_temperatures_of_a_campaign_are_learned_from(tmp_path, name, code, error):
    """Errors of this machine's tips were 0.027 and 0.0044 at worst, and 0.061 where nothing was learned."""
    row = identified(tmp_path, 7102, name, 0.5, told=True)
    assert any(each.startswith(f"{code}: natural frequencies fall") for each in row["reasons"])
    assert max(row[kind]["error"] for kind in KINDS) < error
