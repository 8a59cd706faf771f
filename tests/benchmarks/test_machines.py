import hashlib
import tomllib
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from benchmarks import machines
from benchmarks.machines import (
    CONDITIONS,
    COUPLED,
    COUPLED_DEVELOPMENT,
    CUT,
    DEVELOPMENT,
    EVALUATION,
    HELD_OUT,
    MARGIN,
    TURNED,
    TURNED_SAMPLE,
    is_coupled,
    least_limit,
    named,
    random_machine,
    turned_sample,
    under,
)
from benchmarks.machines import drawn as named_one
from benchmarks.study import MACHINES
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.io.settings.setups import read_tooling

ALL = (*EVALUATION, *DEVELOPMENT)


def texts(folder):
    return {str(p.relative_to(folder)): p.read_text() for p in sorted(folder.rglob("*.toml"))}


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """Every machine of the study as it is drawn, before the depth is lowered for stability."""
    root = tmp_path_factory.mktemp("drawn")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(machines, "least_limit", lambda machine: np.inf)
        return {seed: random_machine(seed, root / str(seed)) for seed in ALL}


def test_seeds_are_fixed():
    assert EVALUATION == (1, 2, 3, 4, 5, 6, 7, 8, 9, 10)
    assert DEVELOPMENT == (101, 102, 103)


def test_the_machines_stay_what_they_were(drawn):
    # one that is drawn anew would make the study's figures those of other machines
    joined = "".join(text for seed in ALL for text in texts(drawn[seed].parent).values())
    assert hashlib.sha256(joined.encode()).hexdigest() == "88884ddcf72b78e6f08e51a2c7e31b0c2ee6b88367f80a93a03ea8124e2bb5bb"


@pytest.fixture(scope="module")
def coupled(tmp_path_factory):
    """Every coupled machine as it is drawn, and what the same seed draws without coupling."""
    root = tmp_path_factory.mktemp("coupled")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(machines, "least_limit", lambda machine: np.inf)
        return {
            seed: [random_machine(seed, root / f"{seed}-{kind}", coupled=kind) for kind in (True, False)]
            for seed in (*COUPLED, *COUPLED_DEVELOPMENT)
        }


def test_coupled_seeds_are_fixed_and_their_machines_stay_what_they_were(coupled):
    assert COUPLED == (201, 202, 203, 204, 205, 206, 207, 208, 209, 210)
    assert COUPLED_DEVELOPMENT == (301, 302, 303)
    joined = "".join(text for path, _ in coupled.values() for text in texts(path.parent).values())
    assert hashlib.sha256(joined.encode()).hexdigest() == "16f583bb30ee7b60fdb21c250394da898d85f3215d042f67515f46401665013b"


def test_a_coupled_machine_is_the_same_seeds_machine_with_turned_elements_and_gyroscopic_moments(coupled):
    angles = []
    for seed, paths in coupled.items():
        one, other = (texts(path.parent) for path in paths)
        kept = [text for text in one["machine.toml"].splitlines() if not text.startswith("angle_deg")]
        plain = (
            other["machine.toml"]
            .replace("gyroscopic = false", "gyroscopic = true")
            .replace(f"Drawn machine {seed}", f"Coupled machine {seed}")
        )
        assert kept == plain.splitlines()
        assert {name: text for name, text in one.items() if name != "machine.toml"} == {
            name: text for name, text in other.items() if name != "machine.toml"
        }
        spindle = read_machine(paths[0]).spindle
        own = np.degrees([spindle.housing.angle, *(b.angle for b in spindle.bearings)])
        assert spindle.gyroscopic
        assert np.unique(own).size == own.size
        assert np.all(own != 0.0)
        angles += own.tolist()
    assert -TURNED <= min(angles) < -0.8 * TURNED
    assert 0.8 * TURNED < max(angles) <= TURNED


def test_names_of_drawn_machines():
    assert [named_one(name) for name in ("7", "coupled-207", "hpm", "coupled-hpm")] == [(7, False), (207, True), None, None]
    assert named(["drawn", "hpm", "coupled"]) == [*(str(s) for s in EVALUATION), "hpm", *(f"coupled-{s}" for s in COUPLED)]
    assert [is_coupled(name) for name in ("7", "coupled-207", "stiff")] == [False, True, False]


def test_no_two_are_alike(drawn):
    bodies = [read_machine(drawn[seed]).spindle for seed in ALL]
    assert all(len({getattr(body, part) for body in bodies}) == len(ALL) for part in ("shaft", "bearings", "housing", "joint"))
    toolings = ["".join(texts(drawn[seed].parent / "toolings").values()) for seed in ALL]
    assert len(set(toolings)) == len(ALL)


@pytest.mark.parametrize("seed", ALL)
def test_every_machine_is_what_it_is_said_to_be(drawn, seed):
    machine = read_machine(drawn[seed])
    spindle = machine.spindle
    assert 2 <= len(spindle.bearings) <= 4
    assert all(a.position < b.position for a, b in pairwise(spindle.bearings))
    assert all(0.85 * b.stiffness[0] <= b.stiffness[1] * 1.001 <= 1.002 * b.stiffness[0] for b in spindle.bearings)
    softening = {b.softening * np.pi / 30.0 for b in spindle.bearings}
    assert len(softening) == 1
    assert softening == {0.0} or 0.99e-6 <= softening.pop() <= 5.01e-6
    assert 700e6 <= machine.workpiece.coefficients.tangential <= 1000e6
    assert 0.2e-3 <= machine.plan.axial_depth <= 0.4e-3
    assert len(machine.plan.spindle_speeds) == 40


@pytest.mark.parametrize("seed", ALL)
def test_toolings_are_what_they_are_said_to_be(drawn, seed):
    machine = read_machine(drawn[seed])
    paths = (*machine.toolings, *machine.truth_toolings)
    first, second, similar, different = (read_tooling(path) for path in paths)
    assert [t.name for t in (first, second, similar, different)] == [*CUT, *HELD_OUT]
    for tooling in (first, second, similar, different):
        assert tooling.cutter.teeth in (2, 3, 4)
        assert 0.010 <= tooling.cutter.diameter <= 0.016
        assert 0.030 <= tooling.assembly.tool_length - tooling.assembly.insertion <= 0.090
    like = [t for t in (first, second) if t.assembly.holder == similar.assembly.holder]
    assert len(like) == 1
    assert like[0].assembly.contact == similar.assembly.contact
    stickouts = [t.assembly.tool_length - t.assembly.insertion for t in (like[0], similar)]
    assert 0.0039 < abs(stickouts[0] - stickouts[1]) < 0.0091
    kinds = [path.read_text().splitlines()[0] for path in paths]
    assert len({kinds[0], kinds[1], kinds[3]}) == 3


@pytest.mark.slow
def test_the_depth_is_lowered_until_every_cut_is_stable_and_nothing_else_changes(drawn, tmp_path, monkeypatch):
    limits = []

    def limit(machine):
        limits.append(least_limit(machine))
        return limits[-1]

    monkeypatch.setattr(machines, "least_limit", limit)
    lowered, plain = texts(random_machine(101, tmp_path).parent), texts(drawn[101].parent)
    depth, before = (tomllib.loads(t["machine.toml"])["cuts"]["axial_depth_mm"] for t in (lowered, plain))
    # the largest of the steps by a tenth that keeps the margin; the file has microns
    steps = round(np.log(depth / before) / np.log(0.9))
    assert steps >= 1
    assert depth == pytest.approx(before * 0.9**steps, abs=1e-3)
    assert (depth - 5e-4) * MARGIN * 1e-3 <= limits[0] < depth / 0.9 * MARGIN * 1e-3
    line = f"axial_depth_mm = {depth:.3f}"
    assert lowered == {**plain, "machine.toml": plain["machine.toml"].replace(f"axial_depth_mm = {before:.3f}", line)}


def test_conditions_change_the_sensors_only(drawn):
    machine = read_machine(drawn[101])
    seen = {name: under(machine, name) for name in CONDITIONS}
    assert [seen[name].sensors.trigger for name in ("trigger", "no-trigger", "noise-x3")] == [True, False, False]
    assert seen["no-trigger"].sensors.gap_noise == machine.sensors.gap_noise == 2e-9
    assert seen["noise-x3"].sensors.gap_noise == pytest.approx(6e-9)
    assert seen["noise-x3"].sensors.acceleration_noise == pytest.approx(0.15)
    assert all(s.spindle is machine.spindle for name, s in seen.items() if CONDITIONS[name].housing is CONDITIONS[name].beside is None)
    for name, condition in CONDITIONS.items():
        if condition.housing is not None:
            assert seen[name].spindle == replace(machine.spindle, fixture_position=condition.housing)
        if condition.beside is not None:
            assert seen[name].spindle == replace(machine.spindle, housing_positions=(condition.beside,))
        toolings = [path.stem for path in (*seen[name].toolings, *seen[name].truth_toolings)]
        assert toolings == [*CUT, *HELD_OUT]
        assert len(seen[name].toolings) == condition.toolings
    for name, condition in CONDITIONS.items():
        plan = seen[name].plan
        if condition.passes:
            # all speeds of the cuts, and as long in the material as without entry and exit
            assert (plan.spindle_speeds, len(plan.passes)) == ((), condition.passes)
            assert plan.passes[0][0] == machine.plan.spindle_speeds[0]
            assert plan.passes[-1][1] == machine.plan.spindle_speeds[-1]
            assert plan.pass_duration - plan.entry - plan.leave == pytest.approx(4.0)
        elif condition.disturbances is None:
            assert plan is machine.plan
        if condition.disturbances is not None:
            assert plan.duration - plan.entry - plan.leave == pytest.approx(machine.plan.duration)
            assert seen[name].disturbances.speed_wander == 1e-3
    assert machine.sensors.tooth_angle != 0.0


@pytest.mark.parametrize("name", TURNED_SAMPLE)
def test_the_sample_machine_turned(name):
    """All of it is what the file says, but for angles, moments and Y's springs and dampers."""
    plain, machine = read_machine(MACHINES / "hpm.toml"), turned_sample(MACHINES / "hpm.toml", name)
    assert is_coupled(name)
    assert name in named(["turned-sample"])
    assert (machine.toolings, machine.truth_toolings) == (plain.toolings, plain.truth_toolings)
    assert machine.plan.spindle_speeds == plain.plan.spindle_speeds
    spindle, before = machine.spindle, plain.spindle
    assert spindle.coupled
    assert spindle.gyroscopic == (not name.startswith("oblique"))
    parts = [(spindle.housing, before.housing), *zip(spindle.bearings, before.bearings, strict=True)]
    for part, old in parts:
        assert part.stiffness[0] == old.stiffness[0]
        assert part.damping[1] == pytest.approx(old.damping[1] * (0.6 if name.startswith("oblique") else 1.0))
    angles = np.rad2deg([part.angle for part, _ in parts])
    expected = {"gyroscopic": [0.0] * 4, "turned": [14.0, -17.0, -4.0, 11.0]}
    np.testing.assert_allclose(angles, expected.get(name, [0.0 if "-" not in name else float(name.split("-")[-1])] * 4))
