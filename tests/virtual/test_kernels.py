import numpy as np
import pytest
import scipy.integrate
import scipy.signal

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.dynamics.coordinates import Coordinate
from rcsa_ident.virtual import _kernels as kernels
from rcsa_ident.virtual._kernels import mill
from rcsa_ident.virtual.milling import Course, mill_cut
from rcsa_ident.virtual.reduction import Poles, alike

STEP = 1.0 / 25600.0 / 8.0
EDGES = CuttingCoefficients(800e6, 0.3, 0.0, 8e3, 6e3)
DOWN = Engagement(0.5 * np.pi, np.pi)

# one mode each along two skew directions, of 1 kg
OMEGA, ZETA = 2.0 * np.pi * np.array([700.0, 1500.0]), np.array([0.03, 0.05])
WAY = np.array([[0.8, 0.6], [-0.5, 0.9]])
POLE = OMEGA * (-ZETA + 1j * np.sqrt(1.0 - ZETA**2))
INPUTS = WAY / (2j * POLE.imag)[:, None]
OUTPUTS = np.tile(WAY.T, (3, 1)).astype(complex)
NAMES = tuple(Coordinate.parse(f"{point}.{axis}") for point in ("tip", "flange", "fixture") for axis in "xy")


@pytest.mark.parametrize("axial", [False, True])
def test_march_is_exact_for_a_force_that_is_linear_in_each_step(axial):
    """Of edges that lean or not, where what pushes along the axis moves the tip, too, or does not."""
    x = POLE * STEP
    first = np.expm1(x) / x
    second = (first - 1.0) / x
    way = np.column_stack([WAY, [0.3, -0.7]]) if axial else WAY
    gain = STEP * np.stack([first - second, second])[:, :, None] * (way / (2j * POLE.imag)[:, None])
    speed, width = 1500.0, 2e-4
    ahead = np.tile(0.5 * np.pi * np.arange(1, 5), (4, 1))
    # one level of an edge: no lag, no offset
    edge = np.array([0.0, 0.0, *((0.8, 0.6) if axial else (1.0, 0.0)), width, DOWN.entry, DOWN.exit, 0.0])
    tooth = 0.5 * np.pi * np.arange(4), np.tile(edge, (4, 1, 1))
    cut = np.array([0.0, speed * STEP, 8e8, 2.4e8, 1e8, 8e3, 6e3, 1e3, 0.0, 0.0])
    instants = np.arange(1200)
    course = np.column_stack([1.4 + speed * STEP * instants, 2e-7 * instants, np.full(1200, 0.9)])
    force = np.zeros((1200, 3))
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    seen = mill(np.exp(x)[None], gain[None], 2.0 * OUTPUTS[None, :2], np.zeros(2, dtype=complex), tooth, ahead, cut, turn, course, force)
    state = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.diag(OMEGA**2), -np.diag(2.0 * ZETA * OMEGA)]])
    inputs = way.shape[1]
    system = (state, np.vstack([np.zeros((2, inputs)), way]), np.hstack([WAY.T, np.zeros((2, 2))]), np.zeros((2, inputs)))
    _, expected, _ = scipy.signal.lsim(system, force[:, :inputs], STEP * np.arange(1200))
    assert np.abs(force).max() > 5.0
    assert np.any(force[:, 2] != 0.0)
    # the first instant's force is there before the march begins
    assert np.abs(seen - expected).max() < 1e-9 * np.abs(expected).max()
    # and it is that of the tool where it was: of old places, of the teeth at the last one
    local, places, now, path = np.empty(3), -ahead / cut[1], cut.copy(), np.column_stack([seen @ turn, course[:, 1]])
    path[:, 0] += course[:, 1]
    for i in range(1, 1200):
        kernels.passed(i, ahead, course[:, 0].copy(), places)
        if i % 10 == 0:
            now[0] = course[i, 0]
            kernels.cut_force(path[i], *tooth, places, now, 2e-7, path, local)
            assert force[i] == pytest.approx(0.9 * np.append(turn @ local[:2], local[2]), abs=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_places_where_other_teeth_stood(seed):
    """By interpolation, wherever the search begins; before the first step by the speed of that step."""
    rng = np.random.default_rng(seed)
    angle = 0.7 + np.cumsum(rng.uniform(0.01, 0.5, 60))
    for step in (1, 2, 17, 59):
        ahead = rng.uniform(0.0, 1.2 * (angle[step] - angle[0]), (3, 4))
        places = rng.uniform(-20.0, 80.0, (3, 4))
        kernels.passed(step, ahead, angle, places)
        wanted = angle[step] - ahead
        early = (wanted - angle[0]) / (angle[1] - angle[0])
        assert places == pytest.approx(np.where(wanted <= angle[0], early, np.interp(wanted, angle, np.arange(60.0))), abs=1e-9)


@pytest.mark.parametrize("unlike", [False, True])
@pytest.mark.parametrize("seed", range(12))
def test_a_force_is_that_of_edges_along_their_own_axes(seed, unlike):
    """Teeth with lags, runout and lean against the past of all teeth: vectors, and the length of an arc inside the immersion."""
    rng = np.random.default_rng(seed)
    edges = np.empty((3, 2, 8))
    lean = rng.uniform(0.0, 1.2, (3, 2))
    edges[..., 0], edges[..., 1] = rng.uniform(-0.5, 2.0, (3, 2)), rng.uniform(-2e-5, 2e-5, (3, 2))
    edges[..., 2], edges[..., 3], edges[..., 4] = np.cos(lean), np.sin(lean), rng.uniform(1e-4, 1e-3, (3, 2))
    edges[..., 5], edges[..., 6] = ((0.0, 2.1), (1.0, np.pi))[seed % 2]
    edges[..., 7] = rng.uniform(0.0, 0.4, (3, 2))
    path = np.cumsum(rng.normal(0.0, 1e-5, (50, 3)), axis=0)
    tooth, position = rng.uniform(0.0, 2.0 * np.pi, 3), path[-1, :2] + [1e-4, 5e-5]
    places, before = rng.uniform(-20.0, 48.0, (3, 6 if unlike else 3)), 3e-6
    curve = ((0.0, 0.0), (-0.25, 2e4))[seed // 6]
    cut = np.array([rng.uniform(0.0, 7.0), 0.15, *rng.uniform(1e8, 5e8, 3), *rng.uniform(1e3, 5e3, 3), *curve])
    force, wanted = np.full(3, 9.0), np.zeros(3)
    kernels.cut_force(position, tooth, edges, places, cut, before, path, force)
    for j in range(3):
        for k in range(2):
            lag, offset, sine, cosine, width, entry, leave, spread = edges[j, k]
            phi, half = (cut[0] + tooth[j] - lag) % (2.0 * np.pi), 0.5 * max(0.15, spread)
            inside = sum(max(min(phi + turn + half, leave) - max(phi + turn - half, entry), 0.0) for turn in (0.0, -2.0 * np.pi))
            outward, ways = np.array([np.sin(phi), np.cos(phi)]), []
            for m in range(3):
                back = places[j, 2 * m + k if unlike else m]
                there = [path[0, 2] + before * back, 0.0] if back < 0.0 else [np.interp(back, np.arange(50), path[:, a]) for a in range(2)]
                ways.append((position - there) @ outward + offset - edges[(j + 1 + m) % 3, k, 1])
            if min(ways) > 0.0:
                along, normal = np.array([-outward[1], outward[0], 0.0]), np.array([*(sine * outward), -cosine])
                chip = min(ways) * sine
                strength = width * inside / (2.0 * half) * (cut[2:5] * chip * (chip * curve[1] if curve[1] else 1.0) ** curve[0] + cut[5:8])
                wanted += strength[0] * along - strength[1] * normal + strength[2] * np.cross(along, normal)
    assert force == pytest.approx(wanted, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("growth", [0.0, 0.08])
def test_kernel_cuts_as_a_plain_search_of_the_past(growth):
    # the same chips written plainly: each tooth against the places of all teeth before it; the speed grows by this share
    cutter = Cutter(4, 12e-3, runout=np.array([2e-6, 1e-6, -2e-6, -1e-6]))
    system = Poles(POLE, INPUTS, OUTPUTS, NAMES)
    cut = CuttingConditions(500.0 * np.pi, 0.3e-3, 1e-4, DOWN)
    count, start = 900, 1.3
    speed, feed = cut.spindle_speed, cut.feed_per_tooth * 4 * cut.spindle_speed / (2.0 * np.pi)
    time = STEP * np.arange(count)
    angle = start + speed * (time + 0.5 * growth * time**2 / time[-1])
    width = np.linspace(0.4, 1.0, count) if growth else np.ones(count)
    course = Course(angle, feed * time, width) if growth else None
    history = mill_cut(system, cutter, cut, EDGES, STEP, count, start, slices=1, course=course)
    # before the first step it turned as in the first
    rate = (angle[1] - angle[0]) / STEP
    centre = history.tip + np.outer(np.arange(count) * STEP * feed, [1.0, 0.0])

    def past(t):
        if t < 0.0:
            return np.array([feed * t, 0.0])
        return np.array([np.interp(t, np.arange(count) * STEP, centre[:, k]) for k in (0, 1)])

    def when(wanted):
        return (wanted - angle[0]) / rate if wanted < angle[0] else np.interp(wanted, angle, time)

    for i in range(0, count, 7):
        force = np.zeros(2)
        for j in range(4):
            phi = (angle[i] + cutter.tooth_angle[j]) % (2.0 * np.pi)
            share = np.clip((phi - DOWN.entry) / (speed * STEP) + 0.5, 0, 1) - np.clip((phi - DOWN.exit) / (speed * STEP) + 0.5, 0, 1)
            radial = np.array([np.sin(phi), np.cos(phi)])
            reach = [
                centre[i] @ radial + cutter.runout[j] - past(when(angle[i] - k * 0.5 * np.pi)) @ radial - cutter.runout[(j + k) % 4]
                for k in (1, 2, 3, 4)
            ]
            if share > 0.0 and min(reach) > 0.0:
                chip = min(reach)
                tangential, normal = 800e6 * chip + 8e3, 0.3 * 800e6 * chip + 6e3
                way = np.array([-radial[1] * tangential - radial[0] * normal, radial[0] * tangential - radial[1] * normal])
                force += way * share * width[i] * cut.axial_depth
        assert history.force[i] == pytest.approx(force, abs=1e-6)


@pytest.mark.parametrize(("fall", "allowed"), [(0.1, 1.5e-3), (0.02, 3e-4)])
def test_a_machine_that_changes_while_it_cuts_answers_as_its_equation_does(fall, allowed):
    # one mode whose stiffness falls by this share over the cut, in many parts: against the equation with a stiffness that falls evenly;
    # what is left out is the shape's own change within a period, which grows with the fall
    count, parts = 16000, 400
    omega, zeta = 2.0 * np.pi * 700.0, 0.03

    def system(share):
        own = omega * np.sqrt(1.0 - fall * share)
        # the damper stays as it is
        pole = np.array([-zeta * omega + 1j * np.sqrt(own**2 - (zeta * omega) ** 2)])
        return Poles(pole, np.array([[0.8, -0.5]]) / (2j * pole.imag)[:, None], np.tile([[0.8], [-0.5]], (3, 1)).astype(complex), NAMES)

    found = [system(0.0)]
    for part in range(1, parts):
        found.append(alike(found[-1], system((part + 0.5) / parts)))
    cut = CuttingConditions(500.0 * np.pi, 0.3e-3, 1e-4, DOWN)
    history = mill_cut(found, Cutter(4, 12e-3), cut, EDGES, STEP, count, 0.4, slices=1)
    time, pushed = STEP * np.arange(count), history.force @ np.array([0.8, -0.5])

    def right(t, state):
        stiffness = omega**2 * (1.0 - fall * t / time[-1])
        return [state[1], np.interp(t, time, pushed) - 2.0 * zeta * omega * state[1] - stiffness * state[0]]

    begin = history.tip[0, 0] / 0.8
    speed = (history.tip[1, 0] - history.tip[0, 0]) / 0.8 / STEP
    exact = scipy.integrate.solve_ivp(right, (0.0, time[-1]), [begin, speed], t_eval=time, rtol=1e-8, atol=1e-14, max_step=STEP).y[0]
    settled = slice(3 * count // 4, None)
    # what is wrong with the first state's speed has died out by then
    error = np.abs(history.tip[settled, 0] / 0.8 - exact[settled]).max() / np.abs(exact[settled]).max()
    assert error < allowed
    still = mill_cut(found[0], Cutter(4, 12e-3), cut, EDGES, STEP, count, 0.4, slices=1)
    assert np.abs(still.tip[settled] - history.tip[settled]).max() > 0.3 * fall * np.abs(still.tip[settled]).max()
