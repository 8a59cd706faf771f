"""What the options of `lobes` and `advise` mean: the cut, its speeds, the tip, the spindle."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rcsa_ident.cli.common import inclusive, warn
from rcsa_ident.cli.options import CutOptions, DriveOptions, LobeMethod, SpeedOptions, Strategy, TipOptions
from rcsa_ident.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rcsa_ident.arrays import FloatArray
    from rcsa_ident.cutting.coefficients import CuttingCoefficients
    from rcsa_ident.cutting.conditions import Engagement
    from rcsa_ident.cutting.cutter import Cutter
    from rcsa_ident.cutting.power import SpindleDrive
    from rcsa_ident.cutting.process import MillingProcess
    from rcsa_ident.dynamics.receptance import Receptance
    from rcsa_ident.machining_setup import Tooling
    from rcsa_ident.stability.stability_map import StabilityMap
    from rcsa_ident.stability.surface_error import SurfaceError
    from rcsa_ident.stability.tip_modes import TipModes
    from rcsa_ident.workflows.limits import Limits
    from rcsa_ident.workflows.lobes import LobeConditions
    from rcsa_ident.workflows.speeds import MachineOverSpeed

__all__ = ["LobeMethod", "Strategy", "Subject", "drive_of", "process_of", "speeds_of", "subjects_of"]

#: Lower end of the receptances that lobes are computed from, and their step [Hz].
LOWEST, STEP = 100.0, 1.0
#: How far beyond the identified band receptances are computed where methods want more of them.
BEYOND = 1.5
#: Machines drawn from a posterior.
DRAWS = 60


@dataclass(frozen=True, slots=True, eq=False)
class Subject:
    """A tooling with the dynamics of its tip.

    Parameters
    ----------
    tooling : Tooling
    machine : MachineOverSpeed or None
        Of a result, with the result's content.
    data : dict
    tip : Receptance or TipModes or None
        What takes the result's place.
    stiffness_spread : float
    """

    tooling: Tooling
    machine: MachineOverSpeed | None
    data: dict[str, Any]
    tip: Receptance | TipModes | None
    stiffness_spread: float

    def omega(self, beyond: float = 1.0) -> FloatArray:
        """Return the frequencies [rad/s] of the receptances of a result, up to so many times the highest that was identified."""
        import numpy as np

        low, high = self.data["band_hz"]
        return 2.0 * np.pi * np.arange(min(LOWEST, low), beyond * high + 0.5 * STEP, STEP)

    def limits(self, conditions: LobeConditions, bands: bool) -> Limits:
        """Return the limits at the conditions' speeds, rising."""
        from rcsa_ident.workflows.limits import machine_limits, tip_limits
        from rcsa_ident.workflows.lobes import MARCHING

        if self.machine is None:
            assert self.tip is not None
            return tip_limits(self.tip, conditions)
        # a fit knows modes inside its band: those above the identified one are the tool's and the holder's own
        omega = self.omega(BEYOND if isinstance(conditions.method, MARCHING) else 1.0)
        return machine_limits(self.machine, self.tooling.assembly, omega, conditions, DRAWS if bands else 0, self.stiffness_spread)

    def map(self, conditions: LobeConditions, depths: int, full: bool) -> StabilityMap:
        """Return the map of stable cuts up to the conditions' largest depth."""
        from rcsa_ident.workflows.maps import machine_map, tip_map

        if self.machine is not None:
            return machine_map(self.machine, self.tooling.assembly, self.omega(BEYOND), conditions, depths, full)
        assert self.tip is not None
        return tip_map(self.tip, conditions, depths, full)

    def doubts(self, limits: Limits) -> list[str]:
        """What speaks against the limits beyond their own warnings."""
        from rcsa_ident.workflows.lobes import band_warning

        doubts = list(dict.fromkeys(limits.lobes.warnings))
        if self.machine is None:
            return doubts
        doubt = band_warning(limits.lobes, tuple(self.data["band_hz"]))
        return [*doubts, *([doubt] if doubt else [])]

    def surface(self, process: MillingProcess, speeds: FloatArray, depth: float) -> SurfaceError:
        """Return the surface location error."""
        from rcsa_ident.stability.surface_error import surface_location_error
        from rcsa_ident.stability.tip_modes import TipModes
        from rcsa_ident.workflows.limits import machine_surface
        from rcsa_ident.workflows.lobes import receptance_from_dc

        if self.machine is not None:
            return machine_surface(self.machine, self.tooling.assembly, self.omega(BEYOND), process, speeds, depth)
        assert self.tip is not None
        tip = receptance_from_dc(self.tip) if isinstance(self.tip, TipModes) else self.tip
        return surface_location_error(tip, process, speeds, depth)


def subjects_of(
    files: Sequence[Path], tip: TipOptions, stiffness_spread: float, stickouts: str | None = None, most: int = 1
) -> list[Subject]:
    """Return the toolings that a command is about: RESULT.json TOOLING.toml ..., or with --modes or --frf the tooling alone."""
    from rcsa_ident.cli.results import read_machine_over_speed
    from rcsa_ident.io.setups import read_tooling
    from rcsa_ident.io.stickouts import read_stickouts

    own_tip = tip.modes is not None or bool(tip.frf)
    if tip.modes is not None and tip.frf:
        raise InputError("--modes and --frf", "both", "one of them")
    if tip.frf_units is not None and not tip.frf:
        raise InputError("--frf-units", tip.frf_units, "given together with --frf")
    if own_tip and stickouts is not None:
        raise InputError("--stickout-mm", stickouts, "a machine that was identified: --modes and --frf are one stickout's")
    fewest, highest = (1, 1) if own_tip else (2, 1 + most)
    if not fewest <= len(files) <= highest:
        wanted = (
            "TOOLING.toml alone with --modes or --frf" if own_tip else "RESULT.json TOOLING.toml (or --modes or --frf and TOOLING.toml)"
        )
        raise InputError("files", f"{len(files)} files", wanted)
    if not 0.0 <= stiffness_spread <= 50.0:
        raise InputError("--stiffness-spread", stiffness_spread, "a number from 0 to 50 [%]")
    share = stiffness_spread / 100.0
    if own_tip:
        tooling = read_tooling(files[0])
        return [Subject(tooling, None, {}, _tip_of(tip), share)]
    lengths = None if stickouts is None else [mm * 1e-3 for mm in numbers(stickouts, "--stickout-mm", "mm")]
    toolings = [t for path in files[1:] for t in ([read_tooling(path)] if lengths is None else read_stickouts(path, lengths))]
    machine, data = read_machine_over_speed(files[0])
    return [Subject(tooling, machine, {**data, "where": str(files[0])}, None, share) for tooling in toolings]


def _tip_of(options: TipOptions) -> Receptance | TipModes:
    """Return the tip's modes from a modal model, or its receptance from tap tests."""
    from rcsa_ident.io.modes import read_modes
    from rcsa_ident.stability.tip_modes import TipModes

    if options.modes is not None:
        return TipModes.of(read_modes(options.modes))
    return idle_tip(options.frf or [], options.frf_units)


def idle_tip(texts: Sequence[str], units: str | None = None) -> Receptance:
    """Return the tip's receptance from tap tests, each written as with --frf."""
    from rcsa_ident.dynamics.coordinates import Dof
    from rcsa_ident.io.frf_files import read_tap_tests
    from rcsa_ident.workflows.lobes import measured_tip

    found = read_tap_tests([_source(text) for text in texts], units)
    pairs = {(Dof(a.lower()), Dof(b.lower())): curve for (a, b), curve in found.items()}
    return measured_tip({a: c for (a, b), c in pairs.items() if a is b}, {pair: c for pair, c in pairs.items() if pair[0] is not pair[1]})


def _source(text: str) -> Any:
    """A file, or X=FILE, XY=FILE, either with #RECORD."""
    from rcsa_ident.io.frf_files import Source

    axes, sign, name = text.partition("=")
    named = bool(sign) and axes.upper() in ("X", "Y", "XX", "YY", "XY", "YX")
    name = name if named else text
    pair = (axes.upper()[0], axes.upper()[-1]) if named else None
    path, mark, record = name.rpartition("#")
    if mark and record.isdigit() and not Path(name).exists():
        return Source(Path(path), pair, int(record))
    return Source(Path(name), pair)


def process_of(cut: CutOptions, speeds: SpeedOptions, subject: Subject) -> MillingProcess:
    """Return what cuts what, and how."""
    from rcsa_ident.cutting.process import MillingProcess, ProcessDamping, SpeedVariation
    from rcsa_ident.errors import positive

    damping = None
    if cut.wear_land_um is not None or cut.indentation is not None:
        if cut.wear_land_um is None or cut.indentation is None:
            missing = "--wear-land-um" if cut.wear_land_um is None else "--indentation"
            raise InputError(missing, "nothing", "--wear-land-um [um] and --indentation [N/m^3], or neither")
        damping = ProcessDamping(cut.indentation, cut.wear_land_um * 1e-6, cut.friction)
    variation = None
    if speeds.speed_variation is not None:
        parts = numbers(speeds.speed_variation.replace(":", ","), "--speed-variation", "AMPLITUDE:RATIO")
        if len(parts) != 2:
            raise InputError("--speed-variation", speeds.speed_variation, "AMPLITUDE:RATIO, as 0.1:0.2")
        variation = SpeedVariation(*parts)
    feed = None if cut.feed_per_tooth_mm is None else positive("--feed-per-tooth-mm", cut.feed_per_tooth_mm, "mm") * 1e-3
    return MillingProcess(
        _cutter(subject.tooling.cutter, cut.runout_um),
        coefficients(cut, None if subject.machine is None else (subject.data, subject.data["where"])),
        engagement(cut.immersion, cut.strategy, cut.entry_deg, cut.exit_deg),
        feed_angle(cut.feed_direction),
        feed,
        damping,
        variation,
    )


def _cutter(cutter: Cutter, runout_um: str | None) -> Cutter:
    import numpy as np

    if runout_um is None:
        return cutter
    offsets = numbers(runout_um, "--runout-um", "um")
    if len(offsets) != cutter.teeth:
        raise InputError("--runout-um", f"{len(offsets)} numbers", f"{cutter.teeth}, one for each tooth [um]")
    return replace(cutter, runout=np.array(offsets) * 1e-6)


def numbers(text: str, option: str, unit: str) -> list[float]:
    """Return the numbers of an option that takes several, divided by commas."""
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = [math.nan]
    if not all(math.isfinite(number) for number in found):
        raise InputError(option, text, f"finite numbers divided by commas [{unit}]")
    return found


def speeds_of(options: SpeedOptions, process: MillingProcess) -> LobeConditions:
    """Return what a limit is asked for."""
    from rcsa_ident.workflows.lobes import LobeConditions

    names = ("--speed-from", "--speed-to", "--speed-step")
    speeds = inclusive(options.speed_from, options.speed_to, options.speed_step, names, "rev/min") * (math.pi / 30.0)
    return LobeConditions(process, speeds, options.max_depth_mm * 1e-3, _method(options.method))


def _method(name: LobeMethod) -> Any:
    from rcsa_ident.stability.full_discretisation import FullDiscretisation
    from rcsa_ident.stability.multi_frequency import MultiFrequency
    from rcsa_ident.stability.semi_discretisation import SemiDiscretisation
    from rcsa_ident.stability.time_domain import TimeDomain
    from rcsa_ident.stability.zero_order import ZeroOrder

    methods = {
        LobeMethod.zero_order: ZeroOrder,
        LobeMethod.multi_frequency: MultiFrequency,
        LobeMethod.semi_discretisation: SemiDiscretisation,
        LobeMethod.full_discretisation: FullDiscretisation,
        LobeMethod.time_domain: TimeDomain,
    }
    return methods[name]()


def coefficients(cut: CutOptions, result: tuple[dict[str, Any], str] | None) -> CuttingCoefficients:
    """Return the cutting coefficients asked for: single ones over the material's, these over the result's."""
    from rcsa_ident.cutting.coefficients import CuttingCoefficients
    from rcsa_ident.cutting.materials import material
    from rcsa_ident.errors import positive
    from rcsa_ident.io.identifications import workpiece_from_json

    given = {} if cut.ktc_mpa is None else {"tangential": positive("--ktc-mpa", cut.ktc_mpa, "MPa") * 1e6}
    given |= {} if cut.krc is None else {"radial_ratio": cut.krc}
    given |= {} if cut.kte_n_per_mm is None else {"tangential_edge": cut.kte_n_per_mm * 1e3}
    given |= {} if cut.kre_n_per_mm is None else {"radial_edge": cut.kre_n_per_mm * 1e3}
    if cut.material is not None:
        return replace(material(cut.material).coefficients, **given)
    if result is not None:
        return replace(workpiece_from_json(*result).coefficients, **given)
    if "tangential" not in given or "radial_ratio" not in given:
        missing = "--ktc-mpa" if cut.ktc_mpa is None else "--krc"
        raise InputError(missing, "nothing", "--ktc-mpa [MPa] and --krc [-], or --material: without a result no workpiece is known")
    return CuttingCoefficients(**given)


def engagement(immersion: float, strategy: Strategy, entry_deg: float | None, exit_deg: float | None) -> Engagement:
    """Return the engagement from both angles, or from immersion and strategy."""
    from rcsa_ident.cutting.conditions import Engagement

    if (entry_deg is None) != (exit_deg is None):
        raise InputError("--entry-deg and --exit-deg", "one of them", "both, or neither")
    if entry_deg is None or exit_deg is None:
        return Engagement.from_immersion(immersion, str(strategy))
    return Engagement(math.radians(entry_deg), math.radians(exit_deg))


def feed_angle(text: str) -> float:
    """Return the feed direction [rad] of +X, -X, +Y, -Y or degrees."""
    from rcsa_ident.io.setups import FEED_DIRECTIONS

    if text.upper() in FEED_DIRECTIONS:
        return FEED_DIRECTIONS[text.upper()]
    try:
        degrees = float(text)
    except ValueError:
        degrees = math.nan
    if not abs(degrees) <= 360.0:
        raise InputError("--feed-direction", text, f"one of {', '.join(FEED_DIRECTIONS)}, or an angle from -360 to 360 [deg]")
    return math.radians(degrees)


def drive_of(options: DriveOptions) -> SpindleDrive:
    """Return what the spindle has."""
    from rcsa_ident.cutting.power import SpindleDrive
    from rcsa_ident.errors import positive
    from rcsa_ident.io.spindle_drives import read_spindle_drive

    given = (
        ("--max-power-kw", options.max_power_kw, "kW", 1e3),
        ("--max-torque-nm", options.max_torque_nm, "N m", 1.0),
        ("--max-speed-rpm", options.max_speed_rpm, "rev/min", math.pi / 30.0),
    )
    flat = SpindleDrive.flat(*(None if value is None else positive(name, value, unit) * factor for name, value, unit, factor in given))
    return flat if options.spindle is None else read_spindle_drive(options.spindle).limited(flat)


def warn_outside(subject: Subject, speeds: FloatArray) -> None:
    """Say where a machine that changes with speed is asked for speeds that it was not cut at."""
    known = None if subject.machine is None else subject.machine.speed_range
    # the last digit of a speed that was written in rev/min is nobody's wish
    if known is not None and (speeds.min() < known[0] * (1.0 - 1e-9) or speeds.max() > known[1] * (1.0 + 1e-9)):
        low, high = (speed * 30.0 / math.pi for speed in known)
        warn(f"the machine was identified from {low:.0f} to {high:.0f} rev/min; outside it stays what it is at the nearest of them")
