"""HTML pages without scripts: what was recorded, what was found, what it is good for; and a tool's recommended cuts on a sheet of paper."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from importlib.resources import files
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.remarks import says
from rcsa_ident.base.units import to_hz, to_rpm
from rcsa_ident.cutting.conditions import AnyEngagement, Engagement
from rcsa_ident.cutting.shape import CutterShape
from rcsa_ident.cutting.stock import engagement_with
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.coupled.posterior import CoupledPosterior
from rcsa_ident.identification.result import AxisResult, Identification, IdentificationCode
from rcsa_ident.identification.unknowns import JOINT
from rcsa_ident.report import figures
from rcsa_ident.report.drawing import tooling_svg
from rcsa_ident.report.lobes import stability_figure
from rcsa_ident.report.style import svg
from rcsa_ident.report.summaries import (
    advice_summary,
    coefficient_rows,
    drawing_rows,
    lobes_summary,
    mode_rows,
    peak_row,
    recording_rows,
    two_digits,
    whole_mode_rows,
)
from rcsa_ident.report.workpiece_side import side_captions, side_mode_rows
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.signals.measurement import Reading
from rcsa_ident.stability.advice import Advice
from rcsa_ident.version import __version__

#: A logarithm that the data leave open by more than this is not told by them.
UNTOLD = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class ToolingPage:
    """What is shown of one tooling.

    `recorded`: whether the campaign has cuts with it
    `frequency` [Hz], shape (n,)
    `tip`: mapping of X, Y, XY (motion in X under a force in Y) or YX to complex array, shape (n,) [m/N]
    `deviation`: mapping of the same names to (real, imaginary) standard deviations [m/N]
    `truth`: mapping of the same names to complex array, shape (n,) [m/N], or None
    `error`: mapping of the same names to float [-], difference to the truth over the norm of the direct FRF, where it is known
    `coverage`: mapping of the same names to float [-], share of the true values (real and imaginary parts) within 2 standard deviations
    `advice`: stability limits, and what is recommended within them
    `true_limit` [m], shape (n,)
    `band_hz`: (low, high) [Hz], or None; band that was identified
    `conditions`: what the lobes hold for, in words
    `speed_rpm` [rev/min]: spindle speed that the tooltip FRF holds at; None where it does not change
    """

    name: str
    recorded: bool
    frequency: FloatArray
    tip: Mapping[str, ComplexArray]
    deviation: Mapping[str, tuple[FloatArray, FloatArray]] = field(default_factory=dict)
    truth: Mapping[str, ComplexArray] | None = None
    error: Mapping[str, float] = field(default_factory=dict)
    coverage: Mapping[str, float] = field(default_factory=dict)
    advice: Advice | None = None
    true_limit: FloatArray | None = None
    band_hz: tuple[float, float] | None = None
    conditions: str = ""
    warnings: Sequence[str] = ()
    speed_rpm: float | None = None


def report_html(
    found: Identification,
    campaign: Campaign,
    readings: Iterable[Reading],
    toolings: Sequence[ToolingPage] = (),
    seconds: Mapping[str, float] | None = None,
    deviations: Mapping[Dof, tuple[FloatArray, FloatArray]] | None = None,
) -> str:
    """Return the page.

    `readings`: of every cut of the campaign
    `seconds`: mapping of stage to float, how long each took
    `deviations`: mapping of Dof to (array, array); standard deviations of each mode's natural frequency [rad/s] and damping ratio
    """
    rows = recording_rows(readings)
    tooling_of = {cut.id: cut.tooling for cut in campaign.cuts}
    return _rendered(
        "template.html",
        campaign=campaign,
        found=found,
        status=str(found.status),
        recordings=rows,
        left_out=[row for row in rows if not row.usable],
        noted=sum(bool(row.notes) for row in rows),
        coefficients=None if campaign.workpiece is None else campaign.workpiece.coefficients,
        axes=[
            _axis(axis.upper(), part, [tooling_of[c] for c in found.cut_ids], (deviations or {}).get(axis))
            for axis, part in found.axes.items()
        ],
        both=None if found.whole is None else _both(found, deviations),
        notes=[note for note in found.notes if note != found.coupling],
        moved="housing" if says(found.reasons, IdentificationCode.HOUSING_ALONE) else "flange",
        scales=coefficient_rows(found.coefficients),
        drawings=drawing_rows(found.learned),
        side=None if found.workpiece_side is None else (list(side_mode_rows(found.workpiece_side)), side_captions(found.workpiece_side)),
        has_std=bool(deviations),
        softening=any(part.posterior is not None and part.posterior.layout.softening for part in found.axes.values())
        or (found.whole is not None and found.whole.best.layout.softening),
        joint=_joint(next(iter(found.axes.values())), found.whole) if found.axes else [],
        untold=UNTOLD,
        convergence=svg(figures.convergence(found), "search") if found.axes and found.trace else "",
        evaluations=len(found.trace),
        toolings=[_tooling(i, page) for i, page in enumerate(toolings)],
        known=any(page.error for page in toolings),
        seconds=dict(seconds or {}),
    )


@dataclass(frozen=True, slots=True, eq=False)
class ToolCard:
    """What those at the machine need of a tooling.

    `cut`: with its feed per tooth
    `machine`: in words
    `tolerance`, `probability`, `reserve`: shares of speed, of the possible machines and cutting coefficients, and of depth that the
        recommended depth keeps
    `versions`: what it was computed from
    """

    tooling: Tooling
    cut: CutSpec
    advice: Advice
    machine: str
    tolerance: float
    probability: float
    reserve: float
    versions: Sequence[str] = ()


def tool_cards_html(cards: Sequence[ToolCard], when: datetime) -> str:
    """Return recommended cuts with drawing, warnings and conditions, each tooling on one page of A4."""
    return _rendered("tool_card.html", cards=[_card(card) for card in cards], when=f"{when:%Y-%m-%d %H:%M}")


def _card(card: ToolCard) -> dict[str, Any]:
    cutter, assembly, cut = card.tooling.cutter, card.tooling.assembly, card.cut
    feed = cut.feed_per_tooth or 0.0
    speeds = to_rpm(card.advice.lobes.spindle_speed[[0, -1]])
    pressure = f"K_tc {_plain(cut.coefficients['tangential'] * 1e-6)} N/mm²" if "tangential" in cut.coefficients else None
    return {
        "name": card.advice.tooling,
        "drawing": b64encode(tooling_svg(card.tooling).encode()).decode(),
        "told": advice_summary(card.advice),
        "warnings": list(dict.fromkeys(card.advice.remarks)),
        "max_depth_mm": 1e3 * card.advice.lobes.max_depth,
        "feed_of_turn_mm": 1e3 * feed * cutter.teeth,
        "drawn": card.advice.lobes.drawn is not None,
        "conditions": [
            ("Machine", card.machine),
            *_stock(engagement_with(cut.engagement, cutter), cutter.diameter),
            ("Feed per tooth", f"{_plain(1e3 * feed, 4)} mm"),
            ("Feed direction", f"{_plain(float(np.degrees(cut.feed_angle)), 1)}° from +X to +Y"),
            ("Material", ", ".join(filter(None, (cut.material, pressure))) or "as in the identification"),
            ("Speeds asked for", f"{_plain(float(speeds[0]))} to {_plain(float(speeds[1]))} rev/min"),
        ],
        "tooling": [
            ("Teeth", str(cutter.teeth)),
            ("Cutting diameter", f"{_plain(1e3 * cutter.diameter, 1)} mm"),
            ("Helix", f"{' / '.join(_plain(angle, 1) for angle in np.degrees(np.atleast_1d(cutter.helix)).tolist())}°"),
            *([] if cutter.shape is CutterShape.FLAT else [("Shape", str(cutter.shape))]),
            ("Stickout", f"{_plain(1e3 * assembly.stickout, 1)} mm"),
            ("Insertion", f"{_plain(1e3 * assembly.insertion, 1)} mm"),
        ],
        "tolerance": card.tolerance,
        "probability": card.probability,
        "reserve": card.reserve,
        "versions": card.versions,
    }


def _stock(engagement: AnyEngagement, diameter: float) -> list[tuple[str, str]]:
    """What stands around the cutter, in rows."""
    if not isinstance(engagement, Engagement):
        return [("Stock", str(engagement))]
    width = engagement.immersion
    return [
        ("Teeth cut", f"from {engagement}, {_strategy(engagement)}"),
        ("Radial immersion", f"{_plain(100.0 * width, 1)} %, {_plain(1e3 * width * diameter, 2)} mm wide"),
    ]


def _strategy(engagement: Engagement) -> str:
    up, down = bool(np.isclose(engagement.entry, 0.0)), bool(np.isclose(engagement.exit, np.pi))
    return "slot" if up and down else "up milling" if up else "down milling" if down else "between both sides"


def _rendered(template: str, **known: Any) -> str:
    from jinja2 import Environment, StrictUndefined

    text = files("rcsa_ident.report").joinpath(template).read_text(encoding="utf-8")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"two_digits": two_digits, "thousandths": _thousandths, "plain": _plain, "number": _number}
    return environment.from_string(text).render(version=__version__, **known)


def _number(value: float | None, digits: int = 0) -> str:
    """A number with thin spaces between thousands."""
    return "–" if value is None or not np.isfinite(value) else f"{value:,.{digits}f}".replace(",", "\u202f").replace("-", "−")


def _plain(value: float, digits: int = 0) -> str:
    """The same with no more digits than it has."""
    text = _number(value, digits)
    return text.rstrip("0").rstrip(".") if digits else text


def _thousandths(value: complex, places: int) -> str:
    """A complex number in thousandths, with true minus signs."""
    real, imaginary = (f"{abs(1e3 * part):.{places}f}" for part in (value.real, value.imag))
    return f"{'−' if value.real < 0.0 else ''}{real} {'−' if value.imag < 0.0 else '+'} {imaginary} i"


def _axis(name: str, part: AxisResult, tooling: Sequence[str], deviation: tuple[FloatArray, FloatArray] | None) -> dict[str, Any]:
    omega = part.measured.get("omega", np.zeros(0))
    return {
        "name": name,
        "part": part,
        "modes": mode_rows(part.modes, deviation),
        "residual": part.modes.residual.tolist(),
        "band": (float(to_hz(omega.min())), float(to_hz(omega.max()))) if omega.size else None,
        "points": omega.size,
        "figure": svg(figures.cross_frf(part, tooling, name), f"cross{name}") if omega.size else "",
        "hammer": svg(figures.hammer_tests(part.tests, name), f"hammer{name}") if part.tests else "",
    }


def _both(found: Identification, deviations: Mapping[Dof, tuple[FloatArray, FloatArray]] | None) -> dict[str, Any]:
    """Both planes as one machine."""
    assert found.whole is not None
    standing = found.whole.best.standing()
    rows = whole_mode_rows(standing, next(iter((deviations or {}).values()), None))
    return {"words": found.coupling, "modes": rows, "residual": standing.residual.tolist(), "turns": found.whole.turns}


def _joint(part: AxisResult, whole: CoupledPosterior | None) -> list[dict[str, Any]]:
    """The joint's values with the range of 95 %, from the logarithms at the end of the covariance."""
    joint = part.joint
    values = (
        ("translational stiffness k_t", joint.translational_stiffness, "N/m"),
        ("rotational stiffness k_r", joint.rotational_stiffness, "N m/rad"),
        ("translational damping c_t", joint.translational_damping, "N s/m"),
        ("rotational damping c_r", joint.rotational_damping, "N m s/rad"),
    )
    posterior = part.posterior if whole is None else whole
    deviation = [None] * 4 if posterior is None else np.sqrt(np.maximum(np.diag(posterior.covariance)[-JOINT:], 0.0)).tolist()
    return [
        {"name": name, "value": value, "unit": unit, "std": std, "range": None if std is None else _range(value, std)}
        for (name, value, unit), std in zip(values, deviation, strict=True)
    ]


def _range(value: float, std: float) -> tuple[float, float]:
    factor = float(np.exp(min(2.0 * std, 50.0)))
    return value / factor, value * factor


def _tooling(number: int, page: ToolingPage) -> dict[str, Any]:
    found = None if page.advice is None else lobes_summary(page.advice)
    return {
        "page": page,
        "peaks": {axis: peak_row(page.frequency, value) for axis, value in page.tip.items()},
        "tip": svg(figures.tooltip_frf(page.frequency, page.tip, page.deviation, page.truth, page.band_hz), f"tip{number}"),
        "lobes": ""
        if page.advice is None
        else svg(
            stability_figure(
                page.advice.lobes, page.advice.recommended, page.true_limit, usable=page.advice.usable, around=page.advice.drawn_around
            ),
            f"lobes{number}",
        ),
        "recommended": [] if found is None else found["recommended"],
        "band": "" if page.advice is None or page.advice.band is None else page.advice.band.words,
        "anywhere": None if found is None else found["absolute_limit_mm"],
        "critical": None if found is None else found["absolute_frequency_hz"],
    }
