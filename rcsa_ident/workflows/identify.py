"""From a campaign to modes and joint: read and judge every recording, then identify."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.scaleout import Map
from rcsa_ident.base.units import from_hz
from rcsa_ident.cutting.corner import corner_change, has_corner
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.receptance import assumed_of
from rcsa_ident.identification.cut_data import prepare
from rcsa_ident.identification.data import IdentificationData
from rcsa_ident.identification.hammer_data import AtPoints, with_tests
from rcsa_ident.identification.hammer_lines import FEWEST_LINES, HammerLines, noise_of, thinned
from rcsa_ident.identification.made_cuts import MadeCuts, in_order
from rcsa_ident.identification.method import Method
from rcsa_ident.identification.posterior import Posterior
from rcsa_ident.identification.progress import Progress
from rcsa_ident.identification.result import Identification, IdentificationCode
from rcsa_ident.identification.rough_data import with_distances, with_rough_cuts, with_rough_toolings
from rcsa_ident.identification.workpiece_side import workpiece_side
from rcsa_ident.setup.campaign import Campaign, HammerTest
from rcsa_ident.setup.cut import Cut
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.signals.measurement import Reading, among_fellows, measure_cut
from rcsa_ident.signals.recording import Quantity, Recording, Sensor
from rcsa_ident.signals.sweep import measure_pass
from rcsa_ident.signals.verdict import RecordCode, Verdict
from rcsa_ident.tool_holder.drawings import KnownToolings, rough_toolings
from rcsa_ident.tool_holder.learnt import learned
from rcsa_ident.tool_holder.model import receptance_at_points, tool_holder_receptance
from rcsa_ident.tool_holder.rough import rough_tool_holder
from rcsa_ident.tool_holder.turning import turning_pair
from rcsa_ident.workflows.cut_times import began, time_remarks
from rcsa_ident.workflows.kinds_of_cuts import kinds_of, with_law

#: Change of an unknown (all are logarithms or of order one) from which a slope is taken.
_STEP = 1e-5
#: Cuts from which on speeds beside the programmed ones say something, and by what share they lie beside them at least.
_FEW_SPEEDS, _LEAST_CLOCK_ERROR = 5, 2e-4
DRAWINGS_EXACT = (
    "toolings were taken as drawn, whatever their [spread] says: of passes, beside hammer tests and by the published method nothing of "
    "them is learned"
)
#: Reads the recordings of a cut: the cut itself, and its air cut where there is one.
ReadCut = Callable[[Cut], tuple[Recording, Recording | None]]
#: Reads a hammer test's frequencies [Hz] and receptance [m/N].
ReadTest = Callable[[HammerTest], tuple[FloatArray, ComplexArray]]


def judge(campaign: Campaign, read: ReadCut, map: Map = map, progress: Callable[[int, int], None] | None = None) -> list[Reading]:
    """Return the reading of every cut of a campaign, in its order.

    `read`: given a cut, returns its recordings; a bad file is a reason to leave the cut out, not to stop
    `map`: cuts are independent of each other
    `progress`: callable of (done, total)
    """
    readings = []
    for reading in map(partial(judge_cut, campaign, read), campaign.cuts):
        readings.append(reading)
        if progress is not None:
            progress(len(readings), len(campaign.cuts))
    return among_fellows(readings)


def judge_cut(campaign: Campaign, read: ReadCut, cut: Cut) -> Reading:
    """Return verdict and measurement of one cut, for itself (see `among_fellows`)."""
    try:
        recording, air = (None if each is None else campaign.clocked(each) for each in read(cut))
        assert recording is not None
        return read_of(campaign, cut, recording, air)
    except InputError as error:
        return Reading(cut.id, cut.tooling, cut.conditions.spindle_speed, Verdict((Remark(RecordCode.UNREADABLE, f"unreadable: {error}"),)))


def read_of(campaign: Campaign, cut: Cut, recording: Recording, air: Recording | None) -> Reading:
    """Return what the recordings of a cut or of a pass say, their clock already set right.

    Raises `InputError` as `measure_cut` and `measure_pass`.
    """
    cutter = campaign.toolings[cut.tooling].cutter
    if cut.last_speed is None:
        found = measure_cut(cut.id, cut.tooling, recording, air, cutter, cut.conditions, campaign.coefficients)
    else:
        found = measure_pass(cut.id, cut.tooling, recording, air, cutter, cut.conditions, cut.last_speed, campaign.coefficients)
    return replace(found, started=recording.started, seconds=recording.samples.shape[0] / recording.rate)


def left_out(readings: Iterable[Reading]) -> list[tuple[str, str]]:
    """Return (cut id, reasons) of each cut that is not used."""
    return [(each.cut_id, "; ".join(each.verdict.reasons)) for each in readings if not each.verdict.usable]


def hammer_lines(campaign: Campaign, read: ReadTest) -> tuple[HammerLines, ...]:
    """Return the lines of a campaign's hammer tests, in its order.

    Raises `InputError` if a file does not hold the FRF, or the FRF no line within the test's band.
    """
    return tuple(_lines_of(test, read(test)) for test in campaign.tests)


def _lines_of(test: HammerTest, curve: tuple[FloatArray, ComplexArray]) -> HammerLines:
    """The lines of a test that are kept, with the noise that its curve shows and the share that it may be wrong by."""
    low, high = test.band
    frequency, value = curve
    # at 0 Hz a receptance from acceleration is not one, and nothing has a direction
    used = (frequency >= low) & (frequency <= high) & (frequency > 0.0) & (value != 0.0)
    if np.sum(used) < FEWEST_LINES:
        told = f"{np.sum(used)} lines from {low:g} to {high:g} Hz"
        raise InputError("frfs", f"{test.id}: {told}", f"at least {FEWEST_LINES} lines in its band", str(test.file))
    omega, value = from_hz(frequency[used]), value[used]
    variance = noise_of(value)
    kept = thinned(omega, value, variance)
    return HammerLines(
        test.id,
        test.tooling,
        test.axis,
        omega[kept],
        value[kept],
        variance[kept] + 0.5 * (test.error * np.abs(value[kept])) ** 2,
        test.response,
        test.force,
        test.sensor_mass,
        test.standstill,
        assumed_of([curve]),
    )


def identify(
    campaign: Campaign,
    readings: Sequence[Reading],
    method: Method,
    seed: int,
    map: Map = map,
    progress: Progress | None = None,
    tests: Sequence[HammerLines] = (),
) -> Identification:
    """Return modes and joint from the usable cuts, and from hammer tests beside them or in their place.

    `readings`: as `judge` returns them
    `seed`: same seed, same answer, whatever `map` is
    `map`: the builtin, or a pool's: the method's long work goes through it
    `progress`: told of every step of the search; with a pool's map it has to be picklable
    `tests`: as `hammer_lines` returns them
    Raises `InputError` if no cut is usable, and there is no hammer test; or of a robot's cuts at several postures.
    """
    return of_campaign(method.run(data_of(campaign, readings, tests), seed, map, progress), campaign, readings, tests)


def _at_one_posture(campaign: Campaign) -> None:
    """Refuse cuts of a robot at several postures: each is another machine."""
    postures = len({cut.posture for cut in campaign.cuts})
    if postures > 1:
        raise InputError("posture_deg", f"cuts at {postures} postures", "cuts at one posture; `robot identify` takes several together")


def clock_error(readings: Sequence[Reading]) -> float | None:
    """Return by what share a recorder's clock runs fast if the spindle keeps its speed in the mean, None where it shows no error."""
    # of a pass nobody knows when its programmed speeds were reached
    single = [(each, each.measurements[0]) for each in readings if len(each.measurements) == 1]
    off = np.array([measurement.spindle_speed / each.programmed_speed - 1.0 for each, measurement in single])
    if off.size < _FEW_SPEEDS:
        return None
    # a record whose speed was not found rightly is not asked
    near = np.abs(off - np.median(off)) <= 4.5 * np.median(np.abs(off - np.median(off)))
    mean, std = float(np.mean(off[near])), float(np.std(off[near])) / np.sqrt(np.sum(near))
    return None if abs(mean) < max(_LEAST_CLOCK_ERROR, 4.0 * std) else -mean / (1.0 + mean)


def clock_remark(readings: Sequence[Reading]) -> Remark | None:
    """Return what to make of speeds that all lie beside the programmed ones, None where they do not.

    A recorder whose clock is off and a spindle that turns at another speed than it is told look alike; only of the former are all
    frequencies wrong by as much.
    """
    error = clock_error(readings)
    if error is None:
        return None
    slower = error > 0.0
    turned = f"the spindle turned {abs(100.0 * error):.2g} % {'slower' if slower else 'faster'} than programmed in all recordings"
    way = f"clock_error_percent = {100.0 * error:.2g} in [campaign] takes that out"
    words = f"{turned}: if it keeps its speed, the recorder's clock is off and all frequencies are wrong by as much; {way}"
    return Remark(RecordCode.CLOCK, words)


def of_campaign(
    found: Identification, campaign: Campaign, readings: Sequence[Reading] = (), tests: Sequence[HammerLines] = ()
) -> Identification:
    """Return the identification with what its machine has to know of the campaign, what is unusual about that, and shapes of cutters; and
    with what gives way on the workpiece's side, where the readings tell it.
    """
    side, told = workpiece_side(found, [each for reading in readings for each in reading.measurements], campaign.sensors)
    exact = () if found.toolings is not None or not campaign.rough else (Remark(IdentificationCode.DRAWINGS_EXACT, DRAWINGS_EXACT),)
    clock = clock_remark(readings)
    tested = (*(remark for test in tests for remark in test.remarks), *(() if clock is None else (clock,)))
    said = (*told, *campaign.remarks, *time_remarks(campaign, readings), *campaign.cylinder_remarks(found.cut_ids), *tested)
    notes = tuple(dict.fromkeys((*found.notes, *exact, *said)))
    drawings = {name: tooling.drawing for name, tooling in campaign.toolings.items()}
    values = () if found.toolings is None else learned(found.toolings, drawings)
    known = replace(found, campaign=campaign.name, workpiece=campaign.workpiece, sensors=campaign.sensors, notes=notes, learned=values)
    return replace(known, workpiece_side=side, changes=with_law(found.changes, campaign, readings))


def mode_deviations(found: Identification) -> dict[Dof, tuple[FloatArray, FloatArray]]:
    """Return the standard deviations of natural frequencies [rad/s] and damping ratios of the axes that have a posterior.

    Linear propagation, sqrt(diag(J C J^T)), of the unknowns' covariance C; shape (m,) each, in the order of the axis' modes. Planes that
    feel each other have the same modes, those of the whole machine that does not turn.
    """
    if found.whole is not None:
        whole = found.whole
        return dict.fromkeys(
            found.axes, _mode_deviation(whole.best.theta, whole.covariance, lambda theta: replace(whole.best, theta=theta).standing().pole)
        )
    known = {axis: part.posterior for axis, part in found.axes.items() if part.posterior is not None}
    return {axis: _mode_deviation(each.theta, each.covariance, partial(_poles, axis, each)) for axis, each in known.items()}


def _poles(axis: Dof, posterior: Posterior, theta: FloatArray) -> ComplexArray:
    return posterior.machine(axis, theta)[0].pole


def _mode_deviation(
    theta: FloatArray, covariance: FloatArray, poles_of: Callable[[FloatArray], ComplexArray]
) -> tuple[FloatArray, FloatArray]:
    pole = poles_of(theta)
    size = np.abs(pole)

    def poles(step: FloatArray) -> ComplexArray:
        moved = poles_of(theta + step)
        # modes that stand close may change places: each goes on from where it was
        return moved[np.argmin(np.abs(moved[None, :] - pole[:, None]), axis=1)]

    slope = np.array([(poles(step) - poles(-step)) / (2.0 * _STEP) for step in _STEP * np.eye(theta.size)])
    frequency = (slope * pole.conj()).real / size
    # zeta = -Re(pole) / |pole|
    damping = (frequency * pole.real / size - slope.real) / size

    def deviation(jacobian: FloatArray) -> FloatArray:
        return np.sqrt(np.maximum(np.einsum("pm,pq,qm->m", jacobian, covariance, jacobian), 0.0))

    return deviation(frequency), deviation(damping)


def data_of(campaign: Campaign, readings: Sequence[Reading], tests: Sequence[HammerLines] = (), robot: bool = False) -> IdentificationData:
    """Return the usable cuts' lines beside their tool-holders' receptances, and hammer tests behind them, which take these as drawn.

    `robot`: whether the cuts may have several postures; the flange's sensors look at the flange itself then
    Raises `InputError` if no cut is usable, and there is no hammer test; or of cuts at several postures.
    """
    if not robot:
        _at_one_posture(campaign)
    cuts = _data_of_cuts(campaign, readings, tests, robot)
    return with_tests(cuts, tests, _at_points(campaign)) if tests else with_rough(cuts, campaign)


def data_to_learn_from(
    campaign: Campaign, readings: Sequence[Reading], tests: Sequence[HammerLines], known: KnownToolings | None
) -> IdentificationData:
    """Return usable cuts and hits of the tip as what they tell of toolings that are known as well as drawings and earlier cuts say."""
    return with_rough(_data_of_cuts(campaign, readings, tests), campaign, known, tests).learned_from()


def _at_points(campaign: Campaign) -> dict[str, AtPoints]:
    return {name: partial(receptance_at_points, t.assembly) for name, t in campaign.toolings.items()}


def _data_of_cuts(
    campaign: Campaign, readings: Sequence[Reading], tests: Sequence[HammerLines], robot: bool = False
) -> IdentificationData | None:
    """The cuts alone; None where no cut is usable but there are tests."""
    measurements = [measurement for each in readings for measurement in each.measurements]
    if not measurements and tests:
        return None
    if not measurements:
        reasons = "; ".join(dict.fromkeys(reason for each in readings for reason in each.verdict.reasons))
        raise InputError("cuts", f"none of {len(readings)} usable ({reasons})", "at least one usable cut")
    receptances = {name: partial(tool_holder_receptance, t.assembly) for name, t in campaign.toolings.items()}
    teeth = {name: t.cutter.teeth for name, t in campaign.toolings.items()}
    known = campaign.coefficients
    edges = [known.edge_spread if edge > 0.0 else 0.0 for edge in (known.tangential_edge, known.radial_edge)]
    unlike = [name for name, t in campaign.toolings.items() if t.cutter.repeats == 1]
    turning = {name: partial(turning_pair, t.assembly) for name, t in campaign.toolings.items()}
    data = prepare(measurements, receptances, teeth, (known.tangential_spread, known.ratio_spread, *edges), turning, unlike)
    sensors = _displacements(campaign, data)
    # where nobody tells it the flange itself is believed, and the lines are asked what they say to that
    told = [(0.0, 0.0) if s is None or s.distance is None else (s.distance, s.distance_spread) for s in sensors]
    data = data if robot else with_distances(data, *np.array(told).reshape(-1, 2).T)
    known_places = not data.of_flange or all(s is not None and s.distance is not None for s in sensors)
    made = _made(campaign, readings)
    if np.all(made.judged):
        raise InputError("cuts", "usable ones for validation alone", "at least one usable cut to learn from")
    return replace(data, softening_spread=campaign.softening_spread, distance_told=known_places, made=made)


def _made(campaign: Campaign, readings: Sequence[Reading]) -> MadeCuts:
    """When the cuts of the data were made, and which of them judge the answer."""
    ids = [each.cut_id for each in readings for _ in each.measurements]
    cuts = {cut.id: cut for cut in campaign.cuts if cut.id in ids}
    warm = {id: cut.temperature for id, cut in cuts.items() if cut.temperature is not None}
    found, times = in_order(len(ids)), began(campaign, [each for each in readings if each.measurements])
    if times:
        found = replace(found, started=np.array([times[id] for id in ids]))
    judged = np.array([id in cuts and cuts[id].validation for id in ids])
    return replace(found, temperature=np.array([warm.get(id, np.nan) for id in ids]), judged=judged, kind=kinds_of(campaign, ids))


def with_rough(
    data: IdentificationData | None, campaign: Campaign, known: KnownToolings | None = None, tests: Sequence[HammerLines] = ()
) -> IdentificationData:
    """Return the data whose tool-holders, depths and sensors are known as well as drawings, earlier cuts and campaign say.

    `data`: of cuts; None where there are hits of the tip alone
    `known`: what earlier cuts have told
    `tests`: hits of the tip, behind the cuts
    """
    names = dict.fromkeys([*(() if data is None else data.toolings), *(test.tooling for test in tests)])
    drawn = [campaign.toolings[name] for name in names]
    rough = rough_toolings({t.name: t.drawing for t in drawn}, known)
    if data is not None:
        # what a sweep does to a line is taken out by the drawn tool-holder's receptances around it
        if data.sweeps or (rough is None and not any(_corner_owner(t) for t in drawn)):
            return data
        data = _with_rough_cuts(data, campaign)
    if tests:
        data = with_tests(data, tests, _at_points(campaign))
    assert data is not None
    if rough is None:
        # a corner radius is no part of a tool-holder
        return data
    highest = max(float(axis.omega.max()) for axis in data.axes) / (2.0 * np.pi)
    return with_rough_toolings(data, rough, [rough_tool_holder(each.assembly, highest) for each in drawn])


def _with_rough_cuts(data: IdentificationData, campaign: Campaign) -> IdentificationData:
    """The data of cuts whose depths, corner radii and sensors are known as well as the campaign says."""
    depths = [np.mean([cut.conditions.axial_depth for cut in campaign.cuts if cut.tooling == name]) for name in data.toolings]
    sensors = _displacements(campaign, data)
    # a place on the housing moves as it likes: its motion has no scale to be wrong
    gain, talk, delay = (
        np.array([0.0 if sensor is None else getattr(sensor, name) for sensor in sensors])
        for name in ("gain_spread", "cross_talk_spread", "delay_spread")
    )
    return with_rough_cuts(data, campaign.depth_spread / np.array(depths), gain, delay, talk, _corners(data, campaign))


def _displacements(campaign: Campaign, data: IdentificationData) -> list[Sensor | None]:
    """The displacement sensor along each axis of the data."""
    shown = {sensor.axis: sensor for sensor in campaign.sensors if sensor.quantity is Quantity.DISPLACEMENT}
    return [shown.get(axis.axis) for axis in data.axes]


def _corners(data: IdentificationData, campaign: Campaign) -> list[ComplexArray]:
    """What corner radii that are not known exactly do to the force in each axis' lines, a column each: tools of one model share one."""
    drawn = [campaign.toolings[name] for name in data.toolings]
    owners = [_corner_owner(t) for t in drawn]
    unknowns = [owner for owner in dict.fromkeys(owners) if owner]
    conditions = {cut.id: cut.conditions for cut in campaign.cuts}
    changes = [np.zeros((axis.omega.size, len(unknowns)), dtype=complex) for axis in data.axes]
    for axis, change in zip(data.axes, changes, strict=True):
        for k in np.unique(axis.cut):
            t = data.cut_tooling[k]
            if owners[t]:
                own = np.flatnonzero(axis.cut == k)
                cutter, wider = drawn[t].cutter, drawn[t].spread.corner_radius
                ratio = corner_change(cutter, conditions[data.cut_ids[k]], campaign.coefficients, axis.order[own], wider)
                change[own, unknowns.index(owners[t])] = ratio[:, 0 if axis.axis is Dof.X else 1]
    return changes


def _corner_owner(tooling: Tooling) -> str:
    """Whose corner radius it is, tool model or tooling; empty where it is known exactly."""
    rough = tooling.spread.corner_radius > 0.0 and has_corner(tooling.cutter)
    return (tooling.tool_model or tooling.name) if rough else ""
