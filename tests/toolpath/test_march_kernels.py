"""The kernels of the march against plain looking and plain algebra; these tests run again without the compiler."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rcsa_ident.toolpath._kernels import march as kernels

NOTHING = -1.0


def chip_by_looking(wall: np.ndarray, foot: np.ndarray, start: float, spacing: float, ray: tuple[float, ...]) -> float:
    """What of a ray lies in the material behind its edge, by looking at 200 000 places."""
    x, y, sine, cosine, radius = ray
    along = radius * (1.0 - np.arange(200_000) / 200_000)
    places = start + spacing * np.arange(wall.size)
    there, height = x + along * sine, y + along * cosine
    inside = (there >= places[0]) & (there < places[-1]) & (height < np.interp(there, places, wall))
    if not inside[0] or height[0] < foot[int((there[0] - start) / spacing)]:
        return 0.0
    return radius - along[np.argmin(inside)] if not inside.all() else radius


def test_a_chip_is_what_lies_on_the_ray() -> None:
    random = np.random.default_rng(7)
    spacing, hits = 5e-5, 0
    for _ in range(300):
        wall = -0.004 + np.cumsum(random.normal(0.0, 1e-5, 240))
        foot = np.full(240, random.choice([NOTHING, -0.0045]))
        angle = random.uniform(0.5 * np.pi + 0.02, 1.5 * np.pi - 0.02)
        ray = (random.uniform(-0.004, 0.004), random.uniform(-3e-4, 3e-4), math.sin(angle), math.cos(angle), random.uniform(0.0038, 0.0052))
        found = kernels.chip(wall, foot, -0.006, spacing, *ray)
        wanted = chip_by_looking(wall, foot, -0.006, spacing, ray)
        hits += wanted > 0.0
        assert found == pytest.approx(wanted, abs=1e-7)
    assert hits > 50


def test_a_ray_straight_down_and_one_from_within() -> None:
    wall, foot = np.full(100, -0.003), np.full(100, NOTHING)
    assert kernels.chip(wall, foot, 0.0, 1e-4, 0.005, 0.0, 0.0, -1.0, 0.005) == pytest.approx(0.002)
    # a tool whose very centre lies in the material cuts along its whole radius
    assert kernels.chip(wall, foot, 0.0, 1e-4, 0.005, -0.004, 0.0, -1.0, 0.002) == pytest.approx(0.002)
    assert kernels.chip(wall, foot, 0.0, 1e-4, 0.5, 0.0, 0.0, -1.0, 0.005) == 0.0
    # columns end with their last one, and nothing is known beyond it, nor before the first
    for place, wanted in ((-1e-5, 0.0), (1e-5, 0.002), (98.9e-4 / 100 * 99, 0.002), (98.99e-4, 0.002), (99.01e-4, 0.0)):
        assert kernels.chip(wall, foot, 0.0, 1e-4, place, 0.0, 0.0, -1.0, 0.005) == pytest.approx(wanted)


@pytest.mark.parametrize("seed", range(4))
def test_a_force_is_that_of_edges_along_their_own_axes(seed: int) -> None:
    """Two flat walls, cones of any lean: what a ray cuts off in closed form, and forces along the edge's three axes by cross products."""
    random = np.random.default_rng(seed)
    lean = random.uniform(-1.0, 1.0, (3, 2))
    edges = np.stack([random.uniform(0.004, 0.006, (3, 2)), np.cos(lean), np.sin(lean), random.uniform(1e-4, 1e-3, (3, 2))], axis=-1)
    cut = random.uniform(1.0, 5.0, 6) * [1e8, 1e8, 1e8, 1e3, 1e3, 1e3]
    wall = random.uniform(-0.003, -0.001, (2, 2))
    columns = kernels.Columns(np.tile(wall[..., None], 400), np.full((2, 2, 400), NOTHING), -0.01, 5e-5)
    angle, place = random.uniform(0.0, 2.0 * np.pi, (3, 2)), random.uniform(-2e-4, 2e-4, 3)
    turned = np.stack([np.sin(angle), np.cos(angle)], axis=-1)
    force, chips, wanted = np.full(3, 9.0), np.empty((3, 2)), np.zeros(3)
    kernels.cut_force(columns, kernels.Teeth(edges, angle, cut), tuple(place), turned, chips, force)
    for j in range(3):
        for k in range(2):
            (radius, upright, leaning, width), (s, c) = edges[j, k], turned[j, k]
            side = 0 if c < 0.0 else 1
            # from the centre to the wall along the ray
            clear = ((-1.0) ** side * place[1] - wall[side, k]) / abs(c)
            thick = max(radius - place[2] * np.tan(lean[j, k]) - clear, 0.0)
            assert chips[j, k] == pytest.approx(thick, abs=1e-15)
            if thick > 0.0:
                along, normal = np.array([-c, s, 0.0]), np.array([upright * s, upright * c, -leaning])
                strength = width * (cut[:3] * thick * upright + cut[3:])
                wanted += strength[0] * along - strength[1] * normal + strength[2] * np.cross(along, normal)
    assert force == pytest.approx(wanted)
    assert np.any(chips > 0.0)


def test_an_edge_takes_columns_down_to_its_way_and_never_up() -> None:
    random = np.random.default_rng(3)
    for _ in range(50):
        wall = random.normal(0.0, 1e-3, 60)
        x0, x1 = random.uniform(-0.001, 0.007, 2)
        y0, y1 = random.normal(0.0, 1e-3, 2)
        x = 1e-4 * np.arange(60)
        passed = (x >= min(x0, x1)) & (x <= max(x0, x1))
        wanted = np.where(passed, np.minimum(wall, y0 + (y1 - y0) * (x - x0) / (x1 - x0)), wall)
        kernels.erase(wall, 0.0, 1e-4, x0, y0, x1, y1)
        assert wall == pytest.approx(wanted, abs=1e-15)


def test_above_the_path_what_the_ray_has_not_swept_stays() -> None:
    walls = np.zeros((2, 50))
    trail, held = np.zeros((8, 2)), np.zeros(1, dtype=np.int64)
    for x in (0.0010, 0.0015, 0.0020, 0.0025):
        kernels.place_edge(walls, 0.0, 1e-4, x, 0.004, 0.0, 0.0016, trail, held)
    # two stretches are swept at most up to x = 1.6 mm: columns 10 to 15
    assert np.flatnonzero(walls[1] < 0.0).tolist() == [10, 11, 12, 13, 14, 15]
    assert walls[0].tolist() == [0.0] * 50
    kernels.place_edge(walls, 0.0, 1e-4, 0.0030, 0.004, 0.0, np.inf, trail, held)
    assert np.flatnonzero(walls[1] < 0.0).tolist() == list(range(10, 31))
    assert held[0] == 1
    # what is held longest goes first where there is no more room
    for x in 0.0031 + 1e-4 * np.arange(12):
        kernels.place_edge(walls, 0.0, 1e-4, x, 0.004, 0.0, 0.0030, trail, held)
    assert held[0] == 8
    assert np.flatnonzero(walls[1] < 0.0)[-1] == 35


@pytest.mark.parametrize("room", [2, 3, 9, 300])
def test_walls_are_taken_down_to_all_that_an_edge_has_passed(room: int) -> None:
    """Turn by turn, the upper wall a while later: in the end both are as if each stretch had been taken off at once."""
    random = np.random.default_rng(room)
    walls, wanted = np.full((2, 160), 0.0), np.full((2, 160), 0.0)
    trail, held = np.zeros((room, 2)), np.zeros(1, dtype=np.int64)
    angle = np.cumsum(random.uniform(0.02, 0.3, 150))
    way = np.stack([0.008 + 1e-5 * angle + 0.004 * np.sin(angle), 0.003 * np.cos(angle)], axis=1)
    for t, (x, y) in enumerate(way):
        kernels.place_edge(walls, 0.0, 1e-4, x, y, 0.0, x - random.uniform(0.0, 0.002), trail, held)
        assert 1 <= held[0] <= room
        assert trail[held[0] - 1].tolist() == [x, y]
        if t:
            (a, b), (c, d) = way[t - 1], way[t]
            for side, sign in enumerate((1.0, -1.0)):
                if min(sign * b, sign * d) < 0.0:
                    kernels.erase(wanted[side], 0.0, 1e-4, a, sign * b, c, sign * d)
    assert np.array_equal(walls[0], wanted[0])
    assert np.all(walls[1] >= wanted[1])
    kernels.place_edge(walls, 0.0, 1e-4, *way[-1], 0.0, np.inf, trail, held)
    assert np.array_equal(walls[1], wanted[1])


def test_a_march_is_that_of_the_full_equations() -> None:
    """Two freedoms, one with play, and a mode: every instant's equations by brute force, with the force of `cut_force` in both."""
    step, count, radius = 2e-5, 120, 0.005
    zero = np.array([3e-6, -5e-6, 1e-6])
    mass, damping = np.array([[2.0, 0.3], [0.3, 1.5]]), np.array([[300.0, 40.0], [40.0, 250.0]])
    stiffness, play, load = np.array([2e6, 3e6]), np.array([0.0, 5e-6]), np.array([4.0, -9.0])
    motion = np.array([[1.0, 0.2], [0.1, 1.0], [0.05, -0.1]])
    pole, outputs, inputs = np.array([-200.0 + 9000.0j]), np.array([[1e-5j], [-2e-5j], [0.0]]), np.array([[0.5, -1.0, 0.0]])
    inputs = inputs.astype(complex)
    outputs = -outputs
    turn = pole * step
    first = np.expm1(turn) / turn
    second = (first - 1.0) / turn
    swings = kernels.Swings(np.exp(turn), step * (first - second), step * second, outputs, inputs, np.zeros((3, 3)))
    inverse = np.linalg.inv(mass + 0.5 * step * damping + 0.25 * step**2 * np.diag(stiffness))
    springs = kernels.Springs(inverse, damping, stiffness, load, motion, zero, play)
    teeth = kernels.Teeth(
        np.array([[[radius, 0.8, 0.6, 1e-3]], [[radius, 0.96, -0.28, 1e-3]]]),
        np.array([[0.0], [np.pi]]),
        np.array([7e8, 3e8, 1e8, 1e4, 5e3, 2e3]),
    )

    def columns() -> kernels.Columns:
        tops = np.full((2, 1, 400), -0.001)
        return kernels.Columns(tops, np.full((2, 1, 400), NOTHING), -0.01, 5e-5)

    course = np.column_stack([1.9 + 0.05 * np.arange(count), 1e-6 * np.arange(count), np.zeros(count)])

    def going() -> kernels.Going:
        return kernels.Going(np.zeros((3, 2)), np.zeros(1, complex), np.zeros(3), np.zeros((2, 1, 200, 2)), np.zeros((2, 1), np.int64))

    forces, tips = np.empty((2, count, 3))
    went, cut = going(), columns()
    assert kernels.march(springs, swings, went, teeth, cut, course, step, 1e-14, forces, tips) == 0
    assert np.abs(forces).max() > 100.0

    there, other = going(), columns()
    chips = np.zeros((2, 1))
    q, v, a, p, force = np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(1, complex), np.zeros(3)
    for t in range(count):
        angles = course[t, 0] - teeth.lags
        turned = np.stack([np.sin(angles), np.cos(angles)], axis=-1)
        before, new = force.copy(), a.copy()
        for _ in range(200):
            here = q + step * v + 0.25 * step**2 * (a + new)
            rate = v + 0.5 * step * (a + new)
            swing = swings.factor * p + swings.early * (inputs @ before) + swings.late * (inputs @ force)
            tip = motion @ here - zero + 2.0 * (outputs @ swing).real
            kernels.cut_force(other, teeth, (course[t, 1] + tip[0], course[t, 2] + tip[1], tip[2]), turned, chips, force)
            felt = here - np.clip(here, -play, play)
            new = np.linalg.solve(mass, load + motion.T @ force - damping @ rate - stiffness * felt)
        q, v, a, p = here, rate, new, swing
        assert forces[t] == pytest.approx(force, abs=1e-6)
        assert tips[t] == pytest.approx(tip, abs=1e-13)
        for j in range(2):
            own = radius - tip[2] * teeth.edges[j, 0, 2] / teeth.edges[j, 0, 1]
            x, y = course[t, 1:] + tip[:2] + own * turned[j, 0]
            swept = x - chips[j, 0] * turned[j, 0, 0] if turned[j, 0, 1] > 0.0 else np.inf
            kernels.place_edge(other.tops[:, 0], -0.01, 5e-5, x, y, course[t, 2] + tip[1], swept, there.trail[j, 0], there.held[j])
    assert went.state == pytest.approx(np.array([q, v, a]), rel=1e-6, abs=1e-12)
    # what is left of both walls
    assert cut.tops == pytest.approx(other.tops, abs=1e-11)
    assert np.all(np.any(cut.tops < -0.0011, axis=2))
    assert went.held.tolist() == there.held.tolist()
