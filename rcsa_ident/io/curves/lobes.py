"""LOBES.csv, MAP.csv and ADVICE.csv from what was computed, and lobes from LOBES.csv."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.units import from_hz, from_rpm, to_cm3_per_min, to_hz, to_rpm
from rcsa_ident.io.curves.tips import read_lobes_csv, write_lobes_csv, write_map_csv, write_speed_csv
from rcsa_ident.stability.advice import Advice
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.stability.stability_map import StabilityMap
from rcsa_ident.stability.surface_error import SurfaceError


def write_lobes(
    path: str | Path,
    lobes: StabilityLobes,
    surface: SurfaceError | None = None,
    recommended: FloatArray | None = None,
    preview: bool = False,
) -> None:
    """Write LOBES.csv; the band's columns are empty where even its edge is beyond the largest depth.

    `surface`: at the same speeds: two further columns
    `recommended` [m], shape (n,): recommended depths; by default those of the lobes alone, which look no further than their own speeds
    `preview`: whether the limits only say where to look: then no band is written, and the column of recommended depths is empty
    """
    band, extra = lobes.band, dict[str, FloatArray]()
    if band is not None and not preview:
        extra = {"limit_depth_low_mm": band[0] * 1e3, "limit_depth_high_mm": band[1] * 1e3}
    depth = np.full(lobes.spindle_speed.shape, np.nan) if preview else lobes.recommended_depth() if recommended is None else recommended
    extra["recommended_depth_mm"] = depth * 1e3
    extra["flip"] = np.where(lobes.stable, np.nan, lobes.flip.astype(float))
    if surface is not None:
        extra |= {"surface_error_um": surface.largest * 1e6, "surface_error_mean_um": surface.mean * 1e6}
    lobe = np.where(lobes.lobe < 0, np.nan, lobes.lobe.astype(float))
    # rad/s and back leaves a last digit that nobody asked for
    write_lobes_csv(
        path, to_rpm(lobes.spindle_speed, 9), lobes.limit_depth * 1e3, to_hz(lobes.chatter_frequency), lobe, extra, whole=("flip",)
    )


def read_lobes(path: str | Path, max_depth: float | None = None) -> StabilityLobes:
    """Return the lobes of LOBES.csv.

    Parameters
    ----------
    path : path
    max_depth : float or None [m]
        Up to which limits were looked for, which the file does not say; by default the largest that was found.

    Notes
    -----
    Of the machines that were drawn the file keeps the band alone: its edges take their place, so that a recommended depth is rather
    too small than too large. Where the file recommends no depth, neither does what is read.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
    >>> cut = ri.MillingProcess(ri.Cutter(2, 0.012), ri.CuttingCoefficients(7e8, 0.3), ri.Engagement.from_immersion(0.5, "down"))
    >>> tip = ri.TipModes.of({ri.Dof.Y: mode})
    >>> lobes = ri.stability_lobes(tip, cut, ri.rpm(8000, 16_000, 50), max_depth=10e-3)
    >>> print(ri.read_lobes(lobes.save("LOBES.csv")))
    from a file, 8000 to 16000 rev/min; best 13650 rev/min: stability limit 2.48 mm, recommended 1.23 mm
    """
    curves = read_lobes_csv(path)
    limit = np.where(np.isnan(curves.limit), np.inf, curves.limit * 1e-3)
    edges = [curves.extra.get(f"limit_depth_{edge}_mm") for edge in ("low", "high")]
    drawn = [np.where(np.isnan(edge), np.inf, edge * 1e-3) for edge in edges if edge is not None]
    finite = limit[np.isfinite(limit)]
    if max_depth is None:
        max_depth = float(finite.max()) if finite.size else np.inf
    return StabilityLobes(
        from_rpm(curves.speed),
        limit,
        from_hz(curves.chatter_frequency),
        np.where(np.isnan(curves.lobe), -1, curves.lobe).astype(np.intp),
        max_depth,
        "from a file",
        flip=curves.extra["flip"] == 1.0 if "flip" in curves.extra else None,  # type: ignore[arg-type]
        drawn=np.array(drawn) if drawn else None,
        withheld="the file recommends no depth" if np.isnan(curves.extra.get("recommended_depth_mm", np.zeros(1))).all() else "",
    )


def write_map(path: str | Path, chart: StabilityMap) -> None:
    """Write MAP.csv."""
    write_map_csv(path, to_rpm(chart.spindle_speed, 9), np.round(chart.depth * 1e3, 9), chart.growth)


def write_advice(path: str | Path, answers: Sequence[Advice]) -> None:
    """Write ADVICE.csv: what is recommended over speed, the columns of further toolings with their number behind the name."""
    columns: dict[str, FloatArray] = {}
    for i, answer in enumerate(answers):
        u, end, most = answer.usable, "" if len(answers) == 1 else f"_{i + 1}", answer.lobes.max_depth
        columns |= {
            f"limit_depth_mm{end}": answer.lobes.limit_depth * 1e3,
            f"stable_depth_mm{end}": u.stable * 1e3,
            f"power_depth_mm{end}": np.where(u.by_power >= most, np.inf, u.by_power) * 1e3,
            f"torque_depth_mm{end}": np.where(u.by_torque >= most, np.inf, u.by_torque) * 1e3,
            f"usable_depth_mm{end}": u.depth * 1e3,
        }
        if u.removal_rate is not None:
            columns[f"removal_rate_cm3_per_min{end}"] = to_cm3_per_min(u.removal_rate)
        if answer.common is not None:
            columns[f"common_depth_mm{end}"] = answer.common * 1e3
    write_speed_csv(path, to_rpm(answers[0].usable.spindle_speed, 9), columns)
