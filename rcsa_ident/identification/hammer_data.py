"""Hammer tests beside the cuts of an identification, or in their place."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.identification.data import LEVER, AxisData, IdentificationData
from rcsa_ident.identification.hammer_lines import HammerLines
from rcsa_ident.identification.made_cuts import CutPrior
from rcsa_ident.tool_holder.model import point_name

#: Standard deviations of a hammer test's gain, and of its channels' delay to each other [s].
GAIN_SPREAD, TEST_DELAY = 0.02, 1e-6
#: Frequencies [rad/s], points of a tool-holder [m from the tip], and where a sensor of how many kg is fixed to it, to the free
#: receptances between tip, flange and the points.
AtPoints = Callable[[FloatArray, Sequence[float], tuple[float, float] | None], Receptance]
_SCALE = np.array([1.0, LEVER])


def with_tests(cuts: IdentificationData | None, tests: Sequence[HammerLines], at_points: Mapping[str, AtPoints]) -> IdentificationData:
    """Return the data of cuts with hammer tests behind them, or of the tests alone.

    A test is a cut of one output without an air cut, whose force was measured. By receptance coupling [schmitz2000] it is, between
    two points of the tool-holder, H_pq = A_pq - A_p2 Z A_2q, where p is the machine's side of the flange B Z A_2q, with
    Z = (A_22 + K^-1 + B)^-1 [m/N]. What is unknown of it: its gain, a delay between its channels, and where cuts tell of a spindle
    that turns, by how much the machine's natural frequencies and damping differ at standstill.

    `cuts`: of its axes that were hit gap and fixture are summed
    `at_points`: mapping of tooling to AtPoints
    Raises `InputError` if there are no tests, or one of them has no lines.
    """
    if not tests:
        raise InputError("frfs", "none", "at least one hammer test")
    if cuts is not None and not cuts.of_flange:
        raise InputError("frfs", "hammer tests beside cuts with accelerometers on the housing alone", "one of both")
    toolings = tuple(dict.fromkeys([*(() if cuts is None else cuts.toolings), *(test.tooling for test in tests)]))
    named = () if cuts is None else cuts.coefficient_spread
    further = [GAIN_SPREAD] * len(tests)
    first = 0 if cuts is None else len(cuts.cut_ids)
    count = len(named) + len(further)
    axes = []
    for axis in (Dof.X, Dof.Y):
        known = None if cuts is None else next((each for each in cuts.axes if each.axis is axis), None)
        parts = [] if known is None else [_wider(known, count, any(test.axis is axis for test in tests))]
        parts += [
            _axis_data(test, first + i, len(named) + i, count, at_points[test.tooling]) for i, test in enumerate(tests) if test.axis is axis
        ]
        if parts:
            axes.append(parts[0] if len(parts) == 1 else _joined(parts))
    prior = _prior(len(tests))
    index = np.array([toolings.index(test.tooling) for test in tests])
    apart, still = np.full(len(tests), -1), np.zeros(len(tests))
    spread = (*named, *further)
    ids = tuple(test.id for test in tests)
    if cuts is None:
        return IdentificationData(
            cut_ids=ids,
            cut_tooling=frozen(index, np.intp),
            toolings=toolings,
            axes=tuple(axes),
            spindle_speed=frozen(still),
            cut_prior=prior,
            clamping=frozen(apart, np.intp),
            edge=np.zeros((len(tests), 2)),
            coefficient_spread=spread,
            tests=tuple(tests),
        )
    return replace(
        cuts,
        cut_ids=(*cuts.cut_ids, *ids),
        cut_tooling=np.concatenate([cuts.cut_tooling, index]),
        toolings=toolings,
        axes=tuple(axes),
        spindle_speed=np.concatenate([cuts.spindle_speed, still]),
        cut_prior=CutPrior(*np.concatenate([cuts.cut_prior.columns, prior.columns]).T),
        clamping=np.concatenate([cuts.clamping, apart]),
        edge=np.concatenate([cuts.edge, np.zeros((len(tests), 2))]),
        coefficient_spread=spread,
        tests=tuple(tests),
    )


def _prior(count: int) -> CutPrior:
    """Channels that are nearly in step, and no air cut whose angle would be asked."""
    whole = np.ones(count)
    return CutPrior(0.0 * whole, whole / TEST_DELAY**2, 1e8 * whole, whole)


def _axis_data(test: HammerLines, cut: int, gain: int, count: int, at_points: AtPoints) -> AxisData:
    """The lines of one test, as the cut of a number, with its gain among so many unknowns of the lines."""
    n = test.omega.size
    if n == 0:
        raise InputError("frfs", f"{test.id}: no lines", "an FRF with lines in its band")
    points = list(dict.fromkeys(z for z in (test.response, test.force) if z is not None))
    sensor = None if test.response is None or test.sensor_mass == 0.0 else (test.response, test.sensor_mass)
    free = at_points(test.omega, points, sensor)
    a22 = free["flange", "flange"]
    # where the force acts on the machine's side the response is on the tool-holder: the same receptance read the other way
    response, force = (test.response, test.force) if test.force is not None else (None, test.response)
    assert force is not None
    a2q = free["flange", point_name(force)][:, :, 0] * _SCALE
    point = np.zeros((n, 3), dtype=complex)
    if response is not None:
        point[:, 0] = free[point_name(response), point_name(force)][:, 0, 0]
        point[:, 1:] = -free["flange", point_name(response)][:, :, 0] * _SCALE
    slope = np.zeros((n, count), dtype=complex)
    slope[:, gain] = 1.0
    zero = np.zeros(n, dtype=complex)
    return AxisData(
        axis=test.axis,
        omega=test.omega,
        order=test.omega / (2.0 * np.pi),
        variance=test.variance[:, None],
        lines=np.stack([test.value, zero], axis=1)[:, None, :],
        cut=np.full(n, cut),
        flange=np.stack([a22[:, 0, 0], LEVER * a22[:, 0, 1], LEVER**2 * a22[:, 1, 1]], axis=1),
        tip=a2q,
        force_slope=slope,
        on_holder=np.full(n, response is not None),
        still=np.full(n, test.standstill),
        point=point,
    )


def _wider(axis: AxisData, count: int, hit: bool) -> AxisData:
    """The cuts' lines with columns for the tests' unknowns, which they do not depend on."""
    slope = np.zeros((axis.omega.size, count), dtype=complex)
    slope[:, : axis.force_slope.shape[1]] = axis.force_slope
    own = replace(axis, force_slope=slope)
    return own.summed() if hit else own


def _cuts_alone(parts: Sequence[AxisData]) -> dict[str, np.ndarray]:
    """What a cut's lines feel of the other axis, where they do: a hammer's hit along one of them alone."""
    found = {}
    for name in ("beside", "talk"):
        values = [getattr(part, name) for part in parts]
        shape = next((each.shape[1:] for each in values if each.size), None)
        if shape is not None:
            found[name] = np.concatenate([v if v.size else np.zeros((p.omega.size, *shape)) for v, p in zip(values, parts, strict=True)])
    return found


def _swept(parts: Sequence[AxisData]) -> dict[str, np.ndarray]:
    """How the lines sweep, where some do; a hammer's do not."""
    if not any(part.sweep.size for part in parts):
        return {}
    still = [
        (part.sweep, part.around)
        if part.sweep.size
        else (np.zeros((part.omega.size, 2)), np.repeat(np.concatenate([part.flange, part.tip], axis=1)[:, None], 2, axis=1))
        for part in parts
    ]
    return {"sweep": np.concatenate([each for each, _ in still]), "around": np.concatenate([each for _, each in still])}


def _joined(parts: Sequence[AxisData]) -> AxisData:
    """All lines of an axis; both forces and both planes are a matter of cuts alone."""

    def whole(values: Callable[[AxisData], np.ndarray]) -> ComplexArray:
        return np.concatenate([values(part) for part in parts])

    return AxisData(
        axis=parts[0].axis,
        omega=whole(lambda p: p.omega),
        order=whole(lambda p: p.order),
        variance=whole(lambda p: p.variance),
        lines=whole(lambda p: p.lines),
        cut=whole(lambda p: p.cut),
        flange=whole(lambda p: p.flange),
        tip=whole(lambda p: p.tip),
        force_slope=whole(lambda p: p.force_slope),
        on_holder=whole(lambda p: p.on_holder if p.on_holder.size else np.zeros(p.omega.size, dtype=bool)),
        still=whole(lambda p: p.still if p.still.size else np.zeros(p.omega.size, dtype=bool)),
        point=whole(lambda p: p.point if p.point.size else np.zeros((p.omega.size, 3))),
        behind=parts[0].behind,
        **_cuts_alone(parts),
        **_swept(parts),
    )
