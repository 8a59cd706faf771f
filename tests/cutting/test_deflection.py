"""A tool that the cut bends: closed forms, the reference figures of the published case, laws of symmetry."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate
import scipy.optimize

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.deflection import ToolDeflection, deflected_edge, deflected_process
from rcsa_ident.cutting.process import MillingProcess, ProcessDamping
from tests.oracles.literature import DEFORMED_TOOL, TIP_DEFLECTION_MM
from tests.stability.mills import RPM

T = DEFORMED_TOOL
EI = T["youngs_modulus"] * np.pi / 64.0 * T["diameter"] ** 4
CUTTER = Cutter(T["teeth"], T["diameter"], np.radians(T["helix_degrees"]))
COEFFICIENTS = CuttingCoefficients(
    T["tangential"], T["radial"] / T["tangential"], tangential_edge=T["tangential_edge"], radial_edge=T["radial_edge"]
)
DOWN = Engagement.from_immersion(T["radial_depth"] / T["diameter"], "down")
UP = Engagement.from_immersion(T["radial_depth"] / T["diameter"], "up")
BARE = MillingProcess(CUTTER, COEFFICIENTS, DOWN)
WORN = replace(BARE, damping=ProcessDamping(T["indentation"], T["wear_land"], T["friction"]))
TOOL = ToolDeflection(T["length"], EI, T["machine_yy"], feed_rate=T["feed_rate"])
PLATEAU = 0.5 * T["diameter"] * np.arccos(1.0 - 2.0 * T["radial_depth"] / T["diameter"])


def at_the_tip(edge) -> float:
    """Points stand in the middle of slices: half a slice on."""
    return float(1.5 * edge.deflection[0] - 0.5 * edge.deflection[1])


@pytest.mark.parametrize("depth", TIP_DEFLECTION_MM)
def test_published_deflection(depth):
    edge = deflected_edge(BARE, TOOL, 10_000.0 * RPM, depth * 1e-3)
    assert edge.settled
    assert at_the_tip(edge) * 1e3 == pytest.approx(TIP_DEFLECTION_MM[depth], rel=5e-3)


def test_entry_shifts_by_more_than_a_degree_and_grows_no_further():
    """Beyond the depth at which the wall's point leaves nothing in the cut above it the deflection of the tip is what it was."""
    assert pytest.approx(6.847, abs=1e-3) == PLATEAU * 1e3
    edges = [deflected_edge(BARE, TOOL, 10_000.0 * RPM, a) for a in (0.8 * PLATEAU, PLATEAU, 1.2 * PLATEAU, 1.6 * PLATEAU)]
    shift = [np.degrees(e.start[0] - DOWN.entry) for e in edges]
    assert shift[1] == pytest.approx(1.106, rel=2e-3)
    assert shift[0] < 0.9 * shift[1]
    np.testing.assert_allclose(shift[2:], shift[1], rtol=1e-4)
    for e in edges:
        # what is left of the radial depth is what the entry stands for
        np.testing.assert_allclose(0.004 - e.deflection, 0.005 * (1.0 - np.cos(np.pi - e.start)), atol=1e-12)
        np.testing.assert_array_equal(e.end, np.pi)


@pytest.mark.parametrize("down", [True, False])
@pytest.mark.parametrize("feed_compliance", [0.0, 0.1e-6])
def test_slow_twin(down, feed_compliance):
    """Point by point: the radial depth at which the forces along the edge leave just that depth, by integrals and a root's search."""
    process = BARE if down else replace(BARE, engagement=UP)
    tool = replace(TOOL, machine_yx=feed_compliance)
    for depth in (3e-3, 9e-3):
        edge = deflected_edge(process, tool, 10_000.0 * RPM, depth)
        assert edge.settled
        for k in range(0, edge.height.size, edge.height.size // 7):
            expected = _slow_deflection(tool, edge.height[k], depth, down)
            assert edge.deflection[k] == pytest.approx(expected, abs=4e-3 * np.abs(edge.deflection).max())


def _slow_deflection(tool: ToolDeflection, height: float, depth: float, down: bool) -> float:
    radius, feed, kr = 0.005, 0.01 * 2.0 * np.pi / (3.0 * 10_000.0 * RPM), T["radial"]

    def load(z, other):
        phi = (np.pi if down else 0.0) - (z - height) / radius
        chip = feed * np.sin(phi)
        tangential, radial = T["tangential"] * chip + T["tangential_edge"], kr * chip + T["radial_edge"]
        forward, normal = -tangential * np.cos(phi) - radial * np.sin(phi), tangential * np.sin(phi) - radial * np.cos(phi)
        near, far = min(tool.length - z, tool.length - other), max(tool.length - z, tool.length - other)
        # a cantilever, clamped behind
        bent = near**2 * (3.0 * far - near) / (6.0 * tool.bending_stiffness)
        return (bent + tool.machine_yy) * normal + tool.machine_yx * forward

    def left(off):
        span = radius * np.arccos(1.0 - (0.004 - off) / radius)
        ends = (height, min(height + span, depth)) if down else (max(height - span, 0.0), height)
        total = scipy.integrate.quad(load, *ends, args=(height,), epsabs=1e-10)[0]
        return (total if down else -total) - off

    return float(scipy.optimize.brentq(left, -3e-3, 3.9e-3, xtol=1e-12))


def test_bending_is_a_cantilever():
    """A force at the tip: P (L - z)^2 (2 L + z) / 6 E I; at a height: nothing but rotation below it; the same both ways."""
    from rcsa_ident.cutting.deflection import _bending

    z = np.array([0.0, 0.004, 0.011, 0.03])
    found = _bending(z, TOOL)
    L = TOOL.length
    np.testing.assert_allclose(found[:, 0], (L - z) ** 2 * (2.0 * L + z) / (6.0 * EI), rtol=1e-12)
    np.testing.assert_allclose(found[0, 0], L**3 / (3.0 * EI), rtol=1e-12)
    np.testing.assert_allclose(found, found.T, rtol=1e-12)
    # below a force at height a the beam is straight: deflection there plus slope times distance
    a = z[3]
    slope = (L - a) ** 2 / (2.0 * EI)
    np.testing.assert_allclose(found[:3, 3], (L - a) ** 3 / (3.0 * EI) + slope * (a - z[:3]), rtol=1e-12)


def test_a_stiff_tool_on_a_compliant_machine():
    """One point of the edge, no helix: the deflection is the fixed point of a closed form."""
    process = replace(BARE, cutter=Cutter(3, 0.010))
    stiff = ToolDeflection(0.061, 1e9, 0.26e-6, feed_rate=0.01)
    edge = deflected_edge(process, stiff, 10_000.0 * RPM, 2e-3)
    # straight edge: all points at 180 degrees, no chip there, only the radial edge force pushes the tool off the wall
    expected = 0.26e-6 * 2e-3 * COEFFICIENTS.radial_edge
    np.testing.assert_allclose(edge.deflection, expected, rtol=1e-3)
    cross = ToolDeflection(0.061, 1e9, 0.0, 0.2e-6, feed_rate=0.01)
    forward = 2e-3 * COEFFICIENTS.tangential_edge
    np.testing.assert_allclose(deflected_edge(process, cross, 10_000.0 * RPM, 2e-3).deflection, 0.2e-6 * forward, rtol=1e-3)


def test_literal_chip_reduction_cuts_less():
    none, literal = (deflected_edge(BARE, replace(TOOL, chip_reduction=c), 10_000.0 * RPM, 4e-3) for c in ("none", "literal"))
    assert np.all(literal.deflection < none.deflection)
    assert literal.deflection[0] < 0.95 * none.deflection[0]
    # the shift is of second order where nothing bends
    stiff = [
        deflected_edge(BARE, replace(TOOL, bending_stiffness=1e12, machine_yy=1e-15, chip_reduction=c), 10_000.0 * RPM, 4e-3)
        for c in ("none", "literal")
    ]
    np.testing.assert_allclose(stiff[0].deflection, stiff[1].deflection, rtol=1e-4)


def test_all_teeth():
    """More than one tooth pushes where the engagement and the helix exceed the pitch; otherwise the sum is the same."""
    one, all_ = (replace(TOOL, all_teeth=a) for a in (False, True))
    # 78.5 degrees and 11.5 degrees per mm: two teeth from 3.6 mm on
    for depth, alike in ((2e-3, True), (5e-3, False)):
        a, b = (deflected_edge(BARE, t, 10_000.0 * RPM, depth).deflection for t in (one, all_))
        assert np.allclose(a, b, rtol=1e-9) == alike


def test_feed_rate_and_feed_per_tooth():
    """A feed rate is kept at all speeds: the feed per tooth falls."""
    assert TOOL.feed_per_tooth(BARE, 8200.0 * RPM) == pytest.approx(0.6 / (3 * 8200.0), rel=1e-12)
    with_feed = replace(BARE, feed_per_tooth=2e-5)
    a = deflected_edge(BARE, TOOL, 10_000.0 * RPM, 3e-3).deflection
    b = deflected_edge(with_feed, replace(TOOL, feed_rate=None), 12_345.0 * RPM, 3e-3).deflection
    np.testing.assert_allclose(a, b, rtol=1e-9)


def test_the_profile_is_the_edge_in_slices():
    """Slices of equal height, angles at their middle; it travels between processes, and a second tool replaces the first."""
    cut = deflected_process(BARE, TOOL)
    rows, edge = cut.engagement_profile(1000.0, 3e-3), deflected_edge(BARE, TOOL, 1000.0, 3e-3)
    assert rows.shape == (18, 4)
    np.testing.assert_allclose(rows[:, 1] - rows[:, 0], 1.0 / 18.0, rtol=1e-12)
    np.testing.assert_allclose(rows[:, 2], np.interp(1.5e-3 * (rows[:, 0] + rows[:, 1]), edge.height, edge.start), rtol=1e-12)
    np.testing.assert_array_equal(rows[:, 3], np.pi)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(cut)).engagement_profile(1000.0, 3e-3), rows)
    again = deflected_process(cut, replace(TOOL, length=0.05))
    assert again.engagement_profile.process.engagement_profile is None


@pytest.mark.parametrize(
    ("call", "field"),
    [
        (lambda: ToolDeflection(0.0, 1.0), "length"),
        (lambda: ToolDeflection(0.06, -1.0), "bending_stiffness"),
        (lambda: ToolDeflection(0.06, 1.0, -1e-6), "machine_yy"),
        (lambda: ToolDeflection(0.06, 1.0, 0.0, np.nan), "machine_yx"),
        (lambda: ToolDeflection(0.06, 1.0, feed_rate=0.0), "feed_rate"),
        (lambda: ToolDeflection(0.06, 1.0, chip_reduction="some"), "chip_reduction"),
        (lambda: deflected_edge(BARE, replace(TOOL, feed_rate=None), 900.0, 1e-3), "feed_per_tooth"),
        (lambda: deflected_edge(BARE, TOOL, 900.0, 0.07), "depth"),
        (lambda: deflected_edge(replace(BARE, engagement=Engagement(0.2, 1.0)), TOOL, 900.0, 1e-3), "engagement"),
        (lambda: deflected_edge(replace(BARE, engagement=Engagement(0.0, np.pi)), TOOL, 900.0, 1e-3), "engagement"),
    ],
)
def test_bad_input(call, field):
    with pytest.raises(InputError) as error:
        call()
    assert error.value.field == field
