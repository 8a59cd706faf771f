"""What was learned beyond the modes: how a machine changes with a temperature, what is said of it, and where it is read from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_rpm
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.identification.further_unknowns import CutScales, GivingWay, Grips, Warming, loudness, order_factors
from rcsa_ident.identification.learned_changes import LearnedChanges, LearnedWarming
from rcsa_ident.identification.learned_unknowns import changes_learned
from rcsa_ident.identification.machine import SpeedModel
from rcsa_ident.identification.unknowns import JOINT, Layout, ModalBlock, pack, unpack
from tests.fixtures import by_hand
from tests.identification.models import vector_of

BY_TIME = LearnedChanges(LearnedWarming(-0.018, 0.001, time_constant=840.0, exponent=1.2))
OMEGA = 2.0 * np.pi * np.linspace(300.0, 3000.0, 40)


def frequencies(modes: ModalModel) -> np.ndarray:
    return np.sort(modes.omega_n)


@pytest.mark.parametrize("softening", [False, True])
@pytest.mark.parametrize("warmth", [0.0, -0.4, -1.0])
def test_a_stiffness_changes_with_the_warmth_as_its_equation_says(softening, warmth):
    """K = omega omega^T (1 + x s + w v), and all else of the machine stays."""
    known = by_hand.warmed(by_hand.posterior(softening=softening))
    here = known.at_warmth(warmth)
    assert here.layout == ModalBlock(2, softening=softening, warming=True)
    speed = 1300.0
    x = (speed - known.speed_range[0]) / known.speed_range[1] if softening else 0.0
    own = unpack(known.theta[:-JOINT], known.layout)
    change = np.array([[-0.1, 0.01], [0.01, -0.06]])
    matrix = np.eye(2) + warmth * change + (x * own.softening if softening else 0.0)
    expected = np.sqrt(np.linalg.eigvalsh(np.outer(own.omega_n, own.omega_n) * matrix))
    undamped = np.sort(unpack(here.theta[:-JOINT], here.layout).at(x, warmth).omega_n)
    np.testing.assert_allclose(undamped, expected, rtol=1e-12)
    modes, joint = here.machine(Dof.X, speed=speed)
    warm, same = known.machine(Dof.X, speed=speed)
    assert joint == same
    if warmth == 0.0:
        np.testing.assert_allclose(modes.receptance(OMEGA).values, warm.receptance(OMEGA).values, rtol=1e-12)
    else:
        assert np.all(frequencies(modes) > frequencies(warm))


@pytest.mark.parametrize("softening", [False, True])
def test_what_is_not_known_keeps_its_covariance(softening):
    known = by_hand.warmed(by_hand.posterior(softening=softening))
    here = known.at_warmth(-1.0)
    own = np.arange(here.layout.size)[here.layout.parts["warming"]]
    rest = np.setdiff1d(np.arange(here.theta.size), own)
    np.testing.assert_array_equal(here.theta[rest], known.theta)
    np.testing.assert_array_equal(here.theta[own], known.warmed.change)
    np.testing.assert_array_equal(here.covariance[np.ix_(rest, rest)], known.covariance)
    np.testing.assert_array_equal(here.covariance[np.ix_(own, own)], known.warmed.covariance)
    np.testing.assert_array_equal(here.covariance[np.ix_(rest, own)], known.warmed.cross)
    # the rival with one mode is colder, too
    warm, cold = (each.candidate(Dof.X, each.rivals[0]).flange.omega_n for each in (known, here))
    assert cold[0] / warm[0] == pytest.approx(np.sqrt(1.08))


def test_a_machine_at_a_temperature():
    machine = by_hand.warming_identification().machine
    cold, warm, middle = (machine.at_temperature(each) for each in (22.0, 38.0, 30.0))
    tips = [np.abs(each.tip(by_hand.tooling(), OMEGA, spread=False).values) for each in (machine, warm, middle, cold)]
    np.testing.assert_allclose(tips[1], tips[0], rtol=1e-12)
    assert np.linalg.norm(tips[3] - tips[0]) > 1.5 * np.linalg.norm(tips[2] - tips[0]) > 0.0
    own = [frequencies(each.identified[Dof.X].spindle.modes) for each in (machine, middle, cold)]
    assert np.all(np.diff(own, axis=0) > 0.0)
    assert [each.state() for each in (machine, cold)] == ["warm machine", "at 22 °C"]
    assert machine.state(from_rpm(14_000.0)) == "warm machine, 14000 rev/min"
    assert machine.at_temperature(None) is machine


def test_what_is_not_known_of_the_warming_widens_bands_of_the_cold_machine_alone():
    def deviation(factor, temperature):
        found = by_hand.warming_identification()
        axes = {}
        for axis, part in found.axes.items():
            known = part.posterior.warmed
            more = replace(known, cross=0.0 * known.cross, covariance=factor * known.covariance, rivals=())
            axes[axis] = replace(part, posterior=replace(part.posterior, rivals=(), warmed=more))
        tip = replace(found, axes=axes).machine.at_temperature(temperature).tip(by_hand.tooling(), OMEGA)
        return np.linalg.norm(next(iter(tip.deviation().values())))

    assert deviation(100.0, 38.0) == pytest.approx(deviation(1.0, 38.0), rel=1e-9)
    assert deviation(100.0, 22.0) > 2.0 * deviation(1.0, 22.0)


def test_beyond_its_temperatures_it_follows_a_straight_line_for_half_their_range():
    machine = by_hand.warming_identification().machine
    straight = "the cuts were made at 22 to 38 °C: the straight line through them is extrapolated"
    for outside, end in ((10.0, 14.0), (60.0, 46.0)):
        here, there = machine.at_temperature(outside), machine.at_temperature(end)
        found, expected = (each.tip(by_hand.tooling(), OMEGA, spread=False).values for each in (here, there))
        np.testing.assert_array_equal(found, expected)
        assert here.remarks[-1] == f"{straight} to {end:g} °C alone, and at {outside:g} °C the machine is taken as there"
        assert there.remarks[-1] == f"{straight} to {end:g} °C"
        assert here.remarks[:-1] == there.remarks[:-1] == machine.remarks == machine.at_temperature(30.0).remarks
    own = [frequencies(machine.at_temperature(each).identified[Dof.X].spindle.modes) for each in (14.0, 22.0, 38.0, 46.0)]
    assert np.all(np.diff(own, axis=0) < 0.0)


def test_a_machine_without_a_thermometer_refuses_a_temperature():
    by_time = by_hand.warming_identification(changes=BY_TIME).machine
    assert by_time.state() == "warm machine"
    warmed_up = replace(BY_TIME, warming=replace(BY_TIME.warming, warmed_up=True))
    assert by_hand.warming_identification(changes=warmed_up).machine.state() == "machine as warm as in its cuts"
    speed_bands = replace(
        by_hand.warming_identification().machine, speed_models=(SpeedModel((800.0, 1200.0), by_hand.machine().identified),)
    )
    for machine in (by_hand.machine(), by_time, speed_bands):
        with pytest.raises(InputError, match=r"temperature_c: found 24 °C, allowed is nothing"):
            machine.at_temperature(24.0)
        assert machine.at_temperature(None) is machine
    with pytest.raises(InputError, match=r"was it given in kelvin \(22 °C\)"):
        by_hand.warming_identification().machine.at_temperature(295.15)
    assert by_hand.machine().state() == ""


def test_it_is_said_in_words():
    assert by_hand.CHANGES.words == (
        "natural frequencies fall by up to 5 % from cold to warm, from 22 to 38 °C",
        "the cutting coefficients follow the chip thickness with the exponent -0.08 ± 0.02; K_te differs by -1.9 ± 0.3 N/mm; teeth "
        "enter by 0.57 ± 0.1 degrees later (± one standard deviation): this explains 79 % of the differences",
        "force in X at 4 times the spindle speed: 6 % lower than the model",
        "forces differ from cut to cut by 2 %",
        "joint stiffness of tooling T1: 4 % higher than the mean",
        "joint stiffness in the loudest cut: 3 % lower than in the quietest",
    )
    assert BY_TIME.words == ("natural frequencies fall by up to 1.8 % from cold to warm, time constant 14 min",)
    assert not LearnedChanges()
    assert LearnedChanges().words == ()


@pytest.mark.parametrize("constant", [900.0, None])
def test_it_is_read_from_the_unknowns(rich, constant):
    temperature = 20.0 + np.linspace(0.0, 10.0, len(rich.cut_ids))
    data = replace(rich, made=replace(rich.made, temperature=temperature))
    for each in (order_factors(data), CutScales(data.cut_ids[1:]), Grips(data.toolings), GivingWay(), Warming(data.cut_ids, constant)):
        data = each.on(data)
    blocks = tuple(ModalBlock(3, axis.places, warming=True) for axis in data.axes)
    layout = Layout(blocks, len(data.coefficient_spread), data.clampings)
    plain = Layout((ModalBlock(3), ModalBlock(3)))
    theta = vector_of(plain, ((600.0, 1400.0, 2600.0), (700.0, 1500.0, 2500.0)))
    parts = []
    for i, block in enumerate(blocks):
        part = pack(unpack(theta[plain.axis(i)], plain.axes[i]), block)
        # v_11 = -0.02 in X, v_33 = -0.04 in Y
        part[np.arange(block.size)[block.parts["warming"]][5 * i]] = -0.02 * (1 + i)
        parts.append(part)
    logs = np.zeros(layout.force.stop - layout.force.start)
    vector = np.concatenate([*parts, theta[plain.joint], logs, np.zeros(layout.size - sum(map(len, parts)) - JOINT - logs.size)])

    class Found:
        pass

    found = Found()
    found.theta, found.layout = vector, layout
    start = layout.force.start + len(rich.coefficient_spread)
    orders = order_factors(rich).keys
    vector[start : start + 2] = np.log(0.94), 0.05
    scales = start + 2 * len(orders)
    vector[scales] = 0.03
    grips = scales + len(data.cut_ids) - 1
    vector[grips] = np.log(1.04)
    vector[grips + len(data.toolings)] = -0.01
    changes = changes_learned(data, found, np.diag(np.arange(1.0, layout.size + 1) ** 2 * 1e-6))
    warming = changes.warming
    assert warming.frequency == pytest.approx(-0.5 * 0.04 * np.ptp(data.warmth))
    assert warming.thermometer == (None if constant else (20.0, 30.0))
    assert warming.time_constant == constant
    i, kind, order = orders[0]
    first = changes.orders[data.axes[i].axis, kind, order]
    assert first.share == pytest.approx(-0.06)
    assert first.log.imag == pytest.approx(0.05)
    assert first.deviation == pytest.approx(1e-3 * (start + 1))
    assert len(changes.orders) == len(orders)
    assert changes.scales[data.cut_ids[1]].log == pytest.approx(0.03)
    assert changes.amplitude.log == pytest.approx(-0.01 * np.ptp(loudness(data)))
    assert changes.joints[data.toolings[0]].share == pytest.approx(0.04)
    assert changes_learned(rich, found, np.eye(layout.size)) == LearnedChanges()
