"""What a table shows of the workpiece's side of the cut, as plain rows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from rcsa_ident.base.units import to_hz
from rcsa_ident.machine.workpiece_side import WorkpieceSide


@dataclass(frozen=True, slots=True)
class SideModeRow:
    """A mode of the workpiece's side, in the field's units, with its standard deviations."""

    axis: str
    frequency_hz: float
    frequency_std_hz: float
    damping_percent: float
    damping_std_percent: float
    stiffness_n_per_um: float
    stiffness_std_n_per_um: float


def side_mode_rows(side: WorkpieceSide) -> Iterator[SideModeRow]:
    """Yield a row for each mode, axis by axis."""
    for axis, each in side.axes.items():
        frequency_std, damping_std, stiffness_std = each.deviations
        columns = (to_hz(each.omega_n), to_hz(frequency_std), 100.0 * each.zeta, 100.0 * damping_std)
        for row in zip(*columns, 1e-6 * each.stiffness, 1e-6 * stiffness_std, strict=True):
            yield SideModeRow(axis.upper(), *map(float, row))


def side_captions(side: WorkpieceSide) -> dict[str, str]:
    """Return what each axis was found from and how well the modes explain it, in words."""
    return {
        axis.upper(): f"{each.sensor} on the {each.role}, {each.lines} lines, "
        + (
            f"χ²/point {each.chi2_per_point:.2f}, unexplained share of a line {100.0 * each.model_error:.2f} %"
            if each.omega_n.size
            else "nothing above the noise"
        )
        for axis, each in side.axes.items()
    }
