"""Every reason why an answer should not be believed at once, and what the data cannot tell, with numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.remarks import Remark, says
from rcsa_ident.cutting.force import ForceTerm
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.candidate import Candidate
from rcsa_ident.identification.causes import Cause, Causes
from rcsa_ident.identification.data import LEVER, AxisData, IdentificationData
from rcsa_ident.identification.joint_fit import AxisSearch
from rcsa_ident.identification.learned_changes import LearnedChanges
from rcsa_ident.identification.levenberg_marquardt import Solution
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.posterior import Posterior
from rcsa_ident.identification.result import Identification, IdentificationCode
from rcsa_ident.identification.status import FEWEST_CUTS, FEWEST_OF_HOUSING, FEWEST_TOOLINGS, Status
from rcsa_ident.identification.unknowns import planes
from rcsa_ident.identification.validation import Prediction
from rcsa_ident.machine.flange_part import JointedFlange

#: Above this share of unexplained signal the force model or the recordings are wrong: where drawings are exact, and where they are rough.
#: Where all else is right, noise and the finite number of modes leave 0.0005 to 0.0011 of exact drawings (docs/study.md), 0.0021 on one of
#: ten machines with 20 speeds; with all ideals gone 0.0033 and 0.0040 meant a tip that was wrong by 25 % (`benchmarks.ideals`).
WORST_MODEL_ERROR, WORST_OF_ROUGH = 0.0025, 0.02
#: Solutions whose evidence lies closer than this are told apart by chance only.
EVIDENCE_TIE = 6.0
NOTHING_JUDGES = (
    "fewer than three toolings judge each other only roughly: one cut with a further one, marked `validation = true`, judges the answer"
)
#: Modes of an axis beyond which some of them stand for what is not in the model.
MOST_MODES = 12
#: Relative difference of two such solutions, and deviation of the answer, from which on they matter.
LARGEST_DIFFERENCE, LARGEST_BAND = 0.02, 0.01
#: Share of the cuts that may contradict the others before the whole is in doubt.
MOST_BAD_CUTS = 0.1
#: Half of the lines must carry at least this many times their noise (its amplitude's root mean square).
LEAST_SIGNAL = 3.0
#: A posterior narrower than this share of its prior was told by the data.
INFORMED = 0.5
#: Said where nothing sees the flange: with three toolings a holder that never cut came out wrong by about 2 % on ten virtual machines, but
#: on four of them by 4 to 22 %, and their lines did not show it.
HOUSING_ALONE = (
    "no sensor sees the flange: its receptance follows from how poles and zeros on the housing move from tooling to tooling, and tools in "
    "holders unlike those that cut may come out wrong by ten per cent and more; a displacement sensor at the flange settles it"
)
#: Said where lines stay unexplained and every drawing was taken as it is.
EXACT_DRAWINGS = "the drawings are taken as exact: a table [spread] in a tooling's file lets the identification learn what they do not tell"
#: Logarithm of the largest factor that is told.
_HARDLY_KNOWN = 20.0
_JOINT = ("translational stiffness", "rotational stiffness", "translational damping", "rotational damping")


def not_finite(data: IdentificationData) -> list[Remark]:
    """Return which of the inputs hold something else than finite numbers; a line may have an infinite variance, which says nothing."""
    found = []
    for axis in data.axes:
        inputs = {
            "lines": np.isfinite(axis.lines),
            "variances of the lines": ~np.isnan(axis.variance),
            "receptances of the tool-holders": np.isfinite(np.hstack([axis.flange, axis.tip])),
            "slopes of the simulated forces": np.isfinite(axis.force_slope),
        }
        wrong = [words for words, fine in inputs.items() if not np.all(fine)]
        name = str(axis.axis).upper()
        found += [Remark(IdentificationCode.NO_FINITE_FIT, f"{name}: not all {words} are finite numbers") for words in wrong]
    return found


def failed(data: IdentificationData, seed: int, method: str) -> Identification:
    """Return the answer where no machine has a finite misfit to the data."""
    words = "no machine has a finite misfit to the lines: units of recordings, toolings or coefficients may be wrong"
    reasons = not_finite(data) or [Remark(IdentificationCode.NO_FINITE_FIT, words)]
    nothing = np.zeros(0)
    return Identification(Status.FAILED, tuple(reasons), seed, method, {}, (), nothing, nothing, nothing, ())


def diagnose(
    data: IdentificationData, solution: Solution, misfit: Misfit, bands: Sequence[float], further: Sequence[Remark] = ()
) -> list[Remark]:
    """Return the reasons for `suspect`.

    `solution`: all axes together
    `misfit`: the one whose minimum it is
    `bands`: sequence of float [-], relative standard deviation of the machine's contribution to the tooltip FRF, for each axis
    `further`: reasons that only this kind of fit has
    """
    reasons: list[Remark] = []

    def doubt(code: IdentificationCode, sentence: str) -> None:
        reasons.append(Remark(code, sentence))

    if not solution.converged:
        words = f"not converged: the joint fit was still improving after {solution.steps} steps"
        doubt(IdentificationCode.NOT_CONVERGED, words)
    for axis in data.axes:
        noise = np.sqrt(2.0 * axis.noise)
        signal = float(np.median(np.abs(axis.measured) / np.where(noise > 0.0, noise, 1e-300)))
        if signal < LEAST_SIGNAL:
            words = f"{str(axis.axis).upper()}: the median signal-to-noise ratio of the lines is {signal:.2g} (at least {LEAST_SIGNAL:g})"
            doubt(IdentificationCode.WEAK_SIGNAL, words)
    worst = WORST_MODEL_ERROR if data.rough is None and data.of_flange and not data.tests else WORST_OF_ROUGH
    for axis, share in zip(data.axes, misfit.model_error, strict=True):
        if share > worst:
            causes = "drawings of the toolings or places of the hits may be wrong"
            if data.cuts:
                causes = "cutting coefficients, toolings, tooth count or sensor signs may be wrong, or the dynamics change with speed"
                if data.rough is None and not says(reasons, IdentificationCode.UNEXPLAINED):
                    causes += f"; {EXACT_DRAWINGS}"
            doubt(
                IdentificationCode.UNEXPLAINED,
                f"{str(axis.axis).upper()}: the model leaves {100 * share:.2g} % of each line unexplained "
                f"(limit {100 * worst:g} %): {causes}",
            )
    bad = _contradicting(data, misfit)
    if np.mean(bad) > MOST_BAD_CUTS:
        words = f"cuts that contradict the others: {np.sum(bad)} of {bad.size}, namely {_named(data, bad, misfit)}"
        doubt(IdentificationCode.CONTRADICTING_CUTS, words)
    # a cause before what it leads to
    if not data.of_flange:
        doubt(IdentificationCode.HOUSING_ALONE, HOUSING_ALONE)
    reasons += further
    for axis, band in zip(data.axes, bands, strict=True):
        if band > LARGEST_BAND:
            doubt(
                IdentificationCode.WIDE_POSTERIOR,
                f"{str(axis.axis).upper()}: the machine's contribution to the tooltip FRF has a standard deviation of {100 * band:.1f} % "
                f"(limit {100 * LARGEST_BAND:g} %), several times that with tools that were never cut: more or quieter cuts are needed",
            )
    toolings = data.used_toolings
    if len(toolings) < FEWEST_TOOLINGS:
        how = "cut with" if data.cuts else "hit"
        words = f"only one tooling: translation and slope of the flange cannot be separated; {how} a second, different holder"
        doubt(IdentificationCode.ONE_TOOLING, words)
    if FEWEST_TOOLINGS <= len(toolings) < FEWEST_OF_HOUSING and not data.of_flange:
        words = (
            f"only {len(toolings)} toolings: too little changes on the housing from one to the next to tell what the flange does; cut "
            "with a third, different one"
        )
        doubt(IdentificationCode.FEW_TOOLINGS, words)
    for t, name in enumerate(data.toolings):
        count = int(np.sum(data.cut_tooling[: data.cuts] == t))
        # a hammer hits all frequencies at once
        if name in toolings and count < FEWEST_CUTS and name not in {test.tooling for test in data.tests}:
            doubt(IdentificationCode.FEW_CUTS, f"too few cuts: {count} with {name}, at least {FEWEST_CUTS} are needed")
    return reasons


#: What is said of each cause, and its code: what it is, and what to do about it.
_CAUSES = {
    Cause.TIME: (
        IdentificationCode.DRIFTS_WITH_TIME,
        "the machine changes from cut to cut, as bearings do that warm up",
        "let the spindle turn for half an hour before each tooling, and repeat the first speed at the end",
    ),
    Cause.TEMPERATURE: (
        IdentificationCode.DRIFTS_WITH_TEMPERATURE,
        "the machine changes with its temperature",
        "let the spindle turn for half an hour before each tooling, until the temperature stays",
    ),
    Cause.SPEED: (
        IdentificationCode.CHANGES_WITH_SPEED,
        "the dynamics change with the spindle speed more than the model follows",
        "cut over a smaller range of speeds",
    ),
    Cause.ORDER: (
        IdentificationCode.FORCE_ORDERS,
        "the simulated forces are wrong by a factor for each order of the teeth",
        "check engagement and edge forces, and cut at a second feed per tooth",
    ),
    Cause.SCALE: (
        IdentificationCode.FORCE_SCALES,
        "the forces differ from cut to cut by more than the model knows",
        "check depth and width of the cuts, and the wear of the edges",
    ),
    Cause.CLAMPING: (
        IdentificationCode.CLAMPED_ANEW,
        "the joint between holder and spindle is not the same with every tooling",
        "clean the faces, clamp one tooling anew and cut with it once more",
    ),
    Cause.AMPLITUDE: (
        IdentificationCode.JOINT_GIVES_WAY,
        "the joint between holder and spindle gives way more the larger the vibration is",
        "check the clamping force and the faces, or cut less deep",
    ),
    Cause.DISTANCE: (
        IdentificationCode.SENSOR_DISTANCE,
        "the flange sensors look elsewhere than the campaign tells",
        "measure distance_behind_flange_mm with a ruler",
    ),
}


def because(found: Causes) -> list[Remark]:
    """Return what the lines contradict the model for, the likeliest cause first."""
    told = []
    for each in found.believed:
        code, what, remedy = _CAUSES[each.cause]
        told.append(Remark(code, f"{what}: that explains {100.0 * each.share:.2g} % of what the model leaves; {remedy}"))
    return told


def learned(found: LearnedChanges) -> list[Remark]:
    """Return what the identification has learned beyond the machine, and by how much that differs from what was told."""
    told = []
    if found.warming is not None:
        cause = Cause.TIME if found.warming.thermometer is None else Cause.TEMPERATURE
        told.append((cause, f"{found.warming.words}: the answer is the {found.warming.state}"))
    if found.orders:
        off = 100.0 * float(np.sqrt(np.mean([abs(each.log) ** 2 for each in found.orders.values()])))
        words = (
            f"the forces differ from the simulated ones by {off:.2g} % in the orders of the teeth: the identification has learned that, "
            "lobes at the feed of the cuts and monitored forces have not; check engagement and edge forces, or calibrate the coefficients"
        )
        told.append((Cause.ORDER, words))
    if found.scales:
        told.append((Cause.SCALE, f"{found.scales_in_words}: the identification has learned that; check the depth of the cuts"))
    if found.amplitude is not None:
        told.append((Cause.AMPLITUDE, f"{found.amplitude_in_words}: the answer is that of cuts of middle loudness"))
    if found.joints:
        off = 100.0 * float(np.ptp([each.log.real for each in found.joints.values()]))
        words = (
            f"the joint's stiffness differs by {off:.2g} % between toolings, as each clamping does: the answer is their mean, "
            "and bands allow as much for the next clamping"
        )
        told.append((Cause.CLAMPING, words))
    return [Remark(_CAUSES[cause][0], words) for cause, words in told]


def not_as_predicted(found: Sequence[Prediction]) -> list[Remark]:
    """Return which toolings the other ones do not predict as well as promised."""
    return [
        Remark(
            IdentificationCode.NOT_AS_PREDICTED,
            f"{str(each.axis).upper()}: the other toolings predict the lines of {each.tooling} with an error of {100 * each.error:.2g} %, "
            f"{100 * each.promised:.2g} % was promised",
        )
        for each in found
        if not each.holds
    ]


def not_judged(found: Sequence[Prediction]) -> Remark:
    """Return why nothing judges an answer."""
    widest = max((each.typical for each in found), default=np.inf)
    words = NOTHING_JUDGES
    if np.isfinite(widest):
        words = f"the other toolings promise half of a tooling's lines to {100.0 * widest:.2g} % alone; {NOTHING_JUDGES}"
    return Remark(IdentificationCode.NOT_JUDGED, words)


def two_solutions(data: IdentificationData, searched: Sequence[AxisSearch]) -> list[Remark]:
    """Return for which axes two answers of equal evidence differ, and by how much; or the two likeliest of searches that do not agree.

    `searched`: one for each axis
    """
    found = []
    for axis, search in zip(data.axes, searched, strict=True):
        apart = data.side_minima and not search.confirmed
        if len(search.candidates) > 1 and (apart or search.evidences[1] - search.evidences[0] < EVIDENCE_TIE):
            difference, band = _difference(axis, *search.candidates[:2])
            told = f"differ by {100 * difference:.1f} % in the machine's contribution to the tooltip FRF"
            name = str(axis.axis).upper()
            if apart and difference > LARGEST_DIFFERENCE:
                words = f"{name}: searches do not agree: the two likeliest {told}; the chosen one may be wrong"
                found.append(Remark(IdentificationCode.NO_AGREEMENT, words))
            elif not apart and difference > max(LARGEST_DIFFERENCE, 3.0 * band):
                words = f"{name}: two solutions of equal evidence {told}, more than its standard deviation of {100 * band:.1f} % explains"
                found.append(Remark(IdentificationCode.TWO_SOLUTIONS, words))
    return found


def remarks(
    data: IdentificationData, solution: Solution, misfit: Misfit, covariance: FloatArray, natural: Mapping[str, FloatArray]
) -> list[Remark]:
    """Return what the data cannot tell, and what was done about single cuts.

    `covariance`, shape (p, p): covariance of all unknowns
    `natural`: mapping of str to array [rad/s], natural frequencies of each machine's modes as the result has them, under the name of its
        axes
    """
    notes: list[Remark] = []

    def note(code: IdentificationCode, sentence: str) -> None:
        notes.append(Remark(code, sentence))

    if len(data.axes) == 1:
        note(IdentificationCode.ONE_AXIS, one_axis(data.axes[0].axis))
    layout, priors = solution.layout, misfit.priors
    deviation = np.sqrt(np.diag(covariance))
    for name, std in zip(_JOINT, deviation[layout.joint], strict=True):
        if std > INFORMED * priors.joint_spread:
            note(
                IdentificationCode.JOINT_UNKNOWN,
                f"joint: the {name} cannot be separated from the flange's own compliance (known to within a factor of "
                f"{np.exp(min(std, _HARDLY_KNOWN)):.1f}); the tooltip FRF depends on both together",
            )
    low = min(float(axis.omega.min()) for axis in data.axes) / (2.0 * np.pi)
    high = max(float(axis.omega.max()) for axis in data.axes) / (2.0 * np.pi)
    for name, omega_n in natural.items():
        most = MOST_MODES * len(name.split(" and "))
        if omega_n.size > most:
            words = f"{name}: the answer has {omega_n.size} modes, more than {most}: modes beyond those of a spindle stand for other errors"
            note(IdentificationCode.MANY_MODES, words)
        frequency = omega_n / (2.0 * np.pi)
        outside = np.sort(frequency[(frequency < low) | (frequency > high)])
        if outside.size:
            listed = ", ".join(f"{f:.0f}" for f in outside)
            note(
                IdentificationCode.MODES_OUTSIDE_BAND,
                f"{name}: modes at {listed} Hz lie outside the excited band of {low:.0f} to {high:.0f} Hz: "
                "they represent all dynamics of the machine outside it",
            )
    for c, coefficient in enumerate(data.coefficients):
        std, before = deviation[layout.force][c], data.coefficient_spread[c]
        if std > INFORMED * before and coefficient.term is not ForceTerm.RUNOUT:
            share = 100.0 * min(std, before)
            words = f"{coefficient}: hardly determined by the cuts; its standard deviation is {share:.1f} %, close to the prior's"
            note(IdentificationCode.COEFFICIENT_UNKNOWN, words)
    bad = _contradicting(data, misfit)
    if 0.0 < np.mean(bad) <= MOST_BAD_CUTS:
        words = f"cuts that contradict the others and were given less weight: {_named(data, bad, misfit)}"
        note(IdentificationCode.CUTS_WEIGHTED_DOWN, words)
    return notes


def one_axis(axis: Dof) -> str:
    """Return what a campaign that has recorded one axis cannot know."""
    own, other = ("X", "Y") if axis is Dof.X else ("Y", "X")
    return (
        f"only {own} was recorded: whether X and Y feel each other cannot be told, and where they do, what the force in {other} "
        f"does in {own} is taken for the machine's own; nothing is known of the tool's motion in {other}: limits and FRFs take it for rigid"
    )


def _contradicting(data: IdentificationData, misfit: Misfit) -> np.ndarray:
    """Cuts with less weight than they would have by their noise; of hammer tests beside cuts nobody expects that."""
    return misfit.cut_weight[: data.cuts or None] < 1.0


def _named(data: IdentificationData, bad: np.ndarray, misfit: Misfit) -> str:
    worst = [k for k in np.argsort(misfit.cut_weight, kind="stable") if bad[k]]
    rest = f" and {len(worst) - 5} more" if len(worst) > 5 else ""
    return ", ".join(f"{data.cut_ids[k]} ({1.0 / misfit.cut_weight[k]:.0f} times its variance)" for k in worst[:5]) + rest


def _machine_contribution(axis: AxisData) -> Callable[[JointedFlange], ComplexArray]:
    """What a tooltip feels of the machine, a^T (A22 + K^-1 + B)^-1 a with a = A21 of the cut toolings, at the axis' lines."""
    lever = np.array([[1.0, LEVER], [LEVER, LEVER**2]])
    flange = axis.flange[:, [0, 1, 1, 2]].reshape(-1, 2, 2)

    def contribution(machine: JointedFlange) -> ComplexArray:
        together = flange + lever * machine.interface(axis.omega)
        return np.einsum("ni,ni->n", axis.tip, np.linalg.solve(together, axis.tip[:, :, None])[:, :, 0])

    return contribution


def deviation_of_tip(posterior: Posterior, axis: AxisData) -> float:
    """Return the relative standard deviation of what a tooltip feels of the machine."""
    value, changes = posterior.part(axis.axis).response(_machine_contribution(axis))
    assert changes is not None
    return float(np.linalg.norm(changes) / max(float(np.linalg.norm(value)), 1e-300))


def _difference(axis: AxisData, one: Candidate, two: Candidate) -> tuple[float, float]:
    """Relative difference of two candidates in the machine's contribution to the tooltip FRF, and the first one's deviation."""
    contribution = _machine_contribution(axis)
    first, second = (_flange_posterior(candidate) for candidate in (one, two))
    value, other = (contribution(each.candidate(axis.axis)) for each in (first, second))
    size = np.linalg.norm(value)
    if size == 0.0:
        return 0.0, 0.0
    return float(np.linalg.norm(value - other) / size), deviation_of_tip(first, axis)


def _flange_posterior(candidate: Candidate) -> Posterior:
    layout = planes(candidate.layout)
    entries = np.r_[layout.axes[0].machine, layout.joint]
    covariance = np.linalg.inv(candidate.information)[np.ix_(entries, entries)]
    return Posterior(candidate.theta[entries], covariance, replace(layout.axes[0], places=0))
