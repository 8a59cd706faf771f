"""Every public noun with one value in a wrong unit: refused with the field's name, or remarked on where the value is not usual."""

from __future__ import annotations

import math

import numpy as np
import pytest

import rcsa_ident as ri
from rcsa_ident.base import plausibility as table
from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.conditions import Block, EngagementMap, Stepover
from rcsa_ident.signals.recording import Recording
from rcsa_ident.signals.verdict import examined
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.tool_holder.geometry import Material
from rcsa_ident.workflows.listen import listen_to
from rcsa_ident.workflows.tool_change import ToolChange, tooltip

TIP_Y = (ri.Coordinate("tip", ri.Dof.Y),)
CUTTER, COEFFICIENTS = ri.Cutter(2, 0.012), ri.CuttingCoefficients(7e8, 0.3)
HALF = ri.Engagement.from_immersion(0.5, "down")
SPEC = ri.CutSpec(coefficients={"tangential": 7e8, "radial_ratio": 0.3})
SPEEDS = ri.rpm(8000, 9000, 500)
STEEL, CONTACT = (205e9, 7850.0, 0.3, 0.003), (2e10, 6e5, 1e5, 40.0)
#: What a slip of the unit multiplies with; and what is no value at all.
SLIPS = (1e3, 1e-3, 1e6, 1e-6, 60.0 / (2.0 * math.pi), 2.0 * math.pi, -1.0)
NONE = (math.inf, -math.inf, math.nan)


def modes(frequency=2.0 * math.pi * 900.0, zeta=0.02, psi=5.0):
    return ri.TipModes.of({ri.Dof.Y: ri.normal_modes([frequency], [zeta], [[psi]], TIP_Y)})


def spec(**given):
    return ri.CutSpec(**{"coefficients": SPEC.coefficients} | given).process(CUTTER).remarks


def process(**given):
    return ri.MillingProcess(**{"cutter": CUTTER, "coefficients": COEFFICIENTS, "engagement": HALF} | given)


def tooling(holder=0.06, diameter=0.012, stickout=0.06, insertion=0.04, contact=CONTACT, material=STEEL, cutter=0.012, bore=0.012):
    steel = Material(*material)
    holders = (ri.BeamSegment(holder, 0.05, steel, inner_diameter=bore),)
    assembly = ri.clamped((ri.BeamSegment(0.1, diameter, steel),), holders, stickout, insertion, ri.Contact(*contact))
    return ri.Tooling("T", ri.Cutter(2, cutter), assembly)


def one_of(values, place, value):
    return (*values[:place], value, *values[place + 1 :])


TOOL = tooling()


def change(**given):
    return ToolChange(**{"machine": ri.KnownTip(modes()), "tooling": TOOL, "cut": SPEC, "speeds": SPEEDS, "max_depth": 0.01} | given)


def advised(**given):
    return ri.advise(ri.KnownTip(modes()), TOOL, SPEC, **{"speeds": SPEEDS} | given)


def lobes(speed=SPEEDS[0], depth=0.01):
    return stability_lobes(modes(), process(), np.array([speed]), depth)


def recording(rate):
    noise = np.random.default_rng(1).standard_normal((4096, 1)) * 1e-5
    return examined(Recording(rate, noise, (ri.Sensor("gap", ri.Quantity.DISPLACEMENT, ri.Dof.X),))).notes


def heard(rate=25600.0, speed=628.3):
    time = np.arange(25600) / 25600.0
    return listen_to(rate, [np.cos(2 * np.pi * 400 * time) + 0.1 * np.cos(2 * np.pi * 100 * time)], ri.Quantity.SOUND, None, speed).reasons


SHARE, DELAY = table.Range("", 1.0, (0.0, 0.5), (0.0, 0.5)), table.Range("s", 1.0, (-1.0, 1.0), (-1.0, 1.0))
#: What a drawing of 100 mm and a bore of 60 mm leave, of a shank of 12 mm.
INSERTION = table.Range("mm", 1e-3, (4.8, 40.0), (0.48, 40.0))
#: Asked for, and refused where it is impossible; nobody remarks on what is only unusual.
SILENT = {
    "CutSpec.feed_angle", "MillingProcess.feed_angle", "Block.y_to", "EngagementMap.z", "ToolChange.max_depth", "stability_lobes.max_depth",
    "stability_map.depths", "tooltip.speed", "advise.depth", "advise.planned speed", "advise.planned depth", "listen.speed",
    "Sensor.gain_spread", "Sensor.delay",
}  # fmt: skip
#: Name: the value that is right, its range, what is made of a value, and which part of its name a sentence has.
FIELDS = {
    "Cutter.diameter": (0.012, table.DIAMETER, lambda v: process(cutter=ri.Cutter(2, v)).remarks, "diameter"),
    "Cutter.runout": (10e-6, table.RUNOUT, lambda v: process(cutter=ri.Cutter(2, 0.012, runout=[v, 0.0])).remarks, "run"),
    "Cutter.axial_runout": (10e-6, table.RUNOUT, lambda v: process(cutter=ri.Cutter(2, 0.012, axial_runout=[v, 0.0])).remarks, "run"),
    "CutSpec.runout": (10e-6, table.RUNOUT, lambda v: spec(runout=(v, 0.0)), "run"),
    "CutSpec.feed_per_tooth": (1e-4, table.FEED_PER_TOOTH, lambda v: spec(feed_per_tooth=v), "feed"),
    "CutSpec.feed_angle": (0.5, table.FEED_ANGLE, lambda v: ri.CutSpec(feed_angle=v), "feed_angle"),
    "MillingProcess.feed_per_tooth": (1e-4, table.FEED_PER_TOOTH, lambda v: process(feed_per_tooth=v).remarks, "feed"),
    "MillingProcess.feed_angle": (0.5, table.FEED_ANGLE, lambda v: process(feed_angle=v), "feed_angle"),
    "CuttingCoefficients.tangential": (7e8, table.TANGENTIAL, lambda v: ri.CuttingCoefficients(v, 0.3).remarks, "tangential"),
    "CutSpec.coefficients": (7e8, table.TANGENTIAL, lambda v: spec(coefficients={"tangential": v, "radial_ratio": 0.3}), "tangential"),
    "CuttingCoefficients.radial_ratio": (0.3, table.RADIAL_RATIO, lambda v: ri.CuttingCoefficients(7e8, v).remarks, "radial"),
    "CuttingCoefficients.tangential_edge": (12e3, table.EDGE, lambda v: ri.CuttingCoefficients(7e8, 0.3, 0.0, v).remarks, "edge"),
    "Stepover.width": (0.006, table.STEPOVER, lambda v: process(engagement=Stepover(v, "up")).remarks, ""),
    "Block.y_to": (0.006, table.SIDE, lambda v: Block(-0.006, v), "y_"),
    "EngagementMap.z": (0.01, table.HEIGHT, lambda v: EngagementMap([0.0, v], [0.0, 0.0], [1.0, 1.0]), "heights"),
    "ProcessDamping.wear_land": (50e-6, table.WEAR_LAND, lambda v: process(damping=ri.ProcessDamping(1e14, v)).remarks, "wear"),
    "ProcessDamping.indentation": (1e14, table.INDENTATION, lambda v: process(damping=ri.ProcessDamping(v, 50e-6)).remarks, "indentation"),
    "SpindleDrive.power": (15e3, table.POWER, lambda v: ri.SpindleDrive.flat(power=v).remarks, "power"),
    "SpindleDrive.torque": (50.0, table.TORQUE, lambda v: ri.SpindleDrive.flat(torque=v).remarks, "torque"),
    "SpindleDrive.max_speed": (ri.rpm(18_000), table.SPINDLE_SPEED, lambda v: ri.SpindleDrive.flat(max_speed=v).remarks, "max"),
    "TipModes.frequency": (ri.hz(900.0), table.TIP_FREQUENCY, lambda v: modes(frequency=v).remarks, ""),
    "TipModes.zeta": (0.02, table.TIP_DAMPING, lambda v: modes(zeta=v).remarks, ""),
    "BeamSegment.diameter": (0.012, table.SEGMENT_DIAMETER, lambda v: tooling(diameter=v).remarks, "diameter"),
    "BeamSegment.length": (0.06, table.SEGMENT_LENGTH, lambda v: tooling(holder=v).remarks, ""),
    "Tooling.stickout": (0.06, table.STICKOUT, lambda v: tooling(stickout=v).remarks, "stickout"),
    "Tooling.insertion": (0.04, INSERTION, lambda v: tooling(insertion=v).remarks, "insertion"),
    "Tooling.cutter": (0.012, table.DIAMETER, lambda v: tooling(cutter=v).remarks, "diameter"),
    "Material.youngs_modulus": (205e9, table.MODULUS, lambda v: tooling(material=one_of(STEEL, 0, v)).remarks, "youngs_modulus"),
    "Material.density": (7850.0, table.DENSITY, lambda v: tooling(material=one_of(STEEL, 1, v)).remarks, "density"),
    "Material.loss_factor": (0.003, table.LOSS_FACTOR, lambda v: tooling(material=one_of(STEEL, 3, v)).remarks, "loss_factor"),
    **{
        f"Contact.{name}": (value, table.CONTACT[name], lambda v, i=i: tooling(contact=one_of(CONTACT, i, v)).remarks, name.split("_")[0])
        for i, (name, value) in enumerate(zip(table.CONTACT, CONTACT, strict=True))
    },
    "ToolChange.max_depth": (0.01, table.AXIAL_DEPTH, lambda v: change(max_depth=v), "max_depth"),
    "stability_lobes.max_depth": (0.01, table.SEARCHED_DEPTH, lambda v: lobes(depth=v), "max_depth"),
    "stability_lobes.speeds": (ri.rpm(8000.0), table.SPINDLE_SPEED, lambda v: lobes(speed=v).warnings, "speed"),
    "stability_map.depths": (0.001, table.AXIAL_DEPTH, lambda v: ri.stability_map(modes(), process(), SPEEDS[:1], np.array([v])), "depths"),
    "tooltip.speed": (ri.rpm(8000.0), table.SPINDLE_SPEED, lambda v: tooltip(ri.KnownTip(modes()), TOOL, SPEEDS, v), "speed"),
    "advise.depth": (0.001, table.AXIAL_DEPTH, lambda v: advised(depth=v), "depth"),
    "advise.planned speed": (ri.rpm(8500.0), table.SPINDLE_SPEED, lambda v: advised(planned=[(v, 1e-3)]), "planned[0] spindle speed"),
    "advise.planned depth": (1e-3, table.AXIAL_DEPTH, lambda v: advised(planned=[(SPEEDS[0], v)]), "planned[0] axial depth"),
    "Recording.rate": (25600.0, table.RATE, recording, "rate"),
    "listen.speed": (ri.rpm(6000.0), table.SPINDLE_SPEED, lambda v: heard(speed=v), "speed"),
    "Sensor.gain_spread": (0.02, SHARE, lambda v: ri.Sensor("s", ri.Quantity.SOUND, gain_spread=v), "gain_spread"),
    "Sensor.delay": (1e-5, DELAY, lambda v: ri.Sensor("s", ri.Quantity.SOUND, delay=v), "delay"),
}  # fmt: skip


@pytest.mark.parametrize("name", FIELDS)
def test_a_wrong_unit_is_refused_or_remarked_on(name):
    right, kind, made, word = FIELDS[name]
    made(right)
    for value in (*(right * slip for slip in SLIPS), 0.0, *NONE):
        try:
            said = made(value)
        except InputError as error:
            assert word in error.field, value  # noqa: PT017 - a value may be accepted, too
            continue
        given = value / kind.size
        assert kind.possible[0] <= given <= kind.possible[1], value
        if name not in SILENT and not kind.usual[0] <= given <= kind.usual[1]:
            assert any(word in remark.replace(" ", "_").replace("run-out", "run") for remark in said), (value, said)


def test_a_mode_in_hertz_and_a_stiffness_in_newtons_per_micrometre():
    (slow,) = modes(frequency=900.0).remarks
    assert slow.endswith("were natural frequencies given in Hz where rad/s is asked for (1.2791e+06 N/m)?")
    with pytest.raises(InputError, match=r"softest mode: found 12 N/m, .*N/µm \(1.2e\+07 N/m\)"):
        modes(psi=ri.hz(900.0) / math.sqrt(12.0))
    with pytest.raises(InputError, match="highest natural frequency"):
        modes(frequency=1e9, psi=1e-9)


def test_rad_per_second_as_revolutions_per_minute():
    """Whether the spindle or the edge is too fast for that, or only one of the two."""
    assert any("(301.593 m/min)?" in each for each in lobes(speed=8000.0).warnings)
    said = advised(speeds=np.arange(4000.0, 20_001.0, 1000.0)).remarks
    assert any("were rev/min given as rad/s (20000 rev/min)?" in each for each in said)


@pytest.mark.parametrize("diameter", [0.1e-3, 250e-3])
def test_micro_mills_and_large_face_mills_are_possible(diameter):
    cut = process(cutter=ri.Cutter(2, diameter), feed_per_tooth=1e-6 if diameter < 1e-3 else 2e-4)
    tip = modes(frequency=ri.hz(6000.0), psi=ri.hz(6000.0) / math.sqrt(1e4 if diameter < 1e-3 else 1e8))
    assert stability_lobes(tip, cut, ri.rpm(300, 301, 1), 0.01).limit_depth.size == 2


def test_work_that_explodes_is_counted_before_it_is_done():
    with pytest.raises(InputError, match=r"20 rev/min, whose limit by multi-frequency takes about \d+ h, allowed is higher speeds"):
        ri.stability_lobes(modes(), process(), ri.rpm(20, 30, 10), 0.01, ri.MultiFrequency())
    with pytest.raises(InputError, match=r"6.02e\+07 speeds, .*at most 100000"):
        advised(speeds=np.linspace(800.0, 800.001, 50), planned=[(2000.0, 1e-3)])


def test_a_receptance_of_a_file_is_no_other(tmp_path):
    """What is measured says nothing of units, but for what its reader assumed."""
    path = tmp_path / "tip.txt"
    path.write_text("500 2e-8 -1e-9\n501 2e-8 -1e-9\n", encoding="utf-8")
    machine = ri.KnownTip(ri.read_tap_tests(y=path))
    assert machine.remarks[0] == "FRF Y: the table has no unit: receptance [m/N] is assumed"
    assert ri.KnownTip(ri.read_tap_tests(y=path, units="m/N")).remarks[0] != machine.remarks[0]
