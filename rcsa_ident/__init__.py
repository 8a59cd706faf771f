"""In-process spindle dynamics from ordinary stable cuts; tooltip FRFs and stability lobes of any tool.

This is the front door: every name in `__all__` is imported from its room when it is first asked for.

    import rcsa_ident as ri

    found = ri.identify("data/sample_runs", seed=1)
    tool = ri.read_tooling("data/machines/toolings/S3-PG25-long.toml")
    print(ri.advise(found, tool))
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from rcsa_ident.version import __version__ as __version__

if TYPE_CHECKING:
    from rcsa_ident.base.errors import InputError
    from rcsa_ident.base.units import hz, rpm
    from rcsa_ident.cutting.coefficients import CuttingCoefficients
    from rcsa_ident.cutting.conditions import Engagement
    from rcsa_ident.cutting.cutter import Cutter
    from rcsa_ident.cutting.materials import material
    from rcsa_ident.cutting.power import SpindleDrive
    from rcsa_ident.cutting.process import MillingProcess, ProcessDamping, SpeedVariation
    from rcsa_ident.dynamics.coordinates import Coordinate, Dof
    from rcsa_ident.dynamics.modal import normal_modes
    from rcsa_ident.dynamics.receptance import Receptance
    from rcsa_ident.front.recorded import listen, ring, tap
    from rcsa_ident.front.samples import sample_robot, sample_tooling
    from rcsa_ident.front.verbs import (
        advise,
        connect,
        estimate_forces,
        identify,
        plot_lobes,
        read_machine,
        read_modes,
        read_result,
        read_tap_tests,
        sample_campaign,
    )
    from rcsa_ident.io.curves.forces import read_forces
    from rcsa_ident.io.curves.lobes import read_lobes
    from rcsa_ident.io.curves.tips import read_tip
    from rcsa_ident.io.recordings.readers import read_recording
    from rcsa_ident.io.results.robot_results import read_robot_result
    from rcsa_ident.io.settings.robots import read_robot
    from rcsa_ident.io.settings.setups import read_campaign, read_tooling
    from rcsa_ident.machine.known_tip import KnownTip
    from rcsa_ident.machine.robot.flexible import FlexibleRobot
    from rcsa_ident.machine.robot.posed_robot import PosedRobot
    from rcsa_ident.setup.cut import CutSpec
    from rcsa_ident.setup.tooling import Tooling
    from rcsa_ident.signals.recording import Quantity, Sensor
    from rcsa_ident.stability.discretisation import FullDiscretisation, SemiDiscretisation
    from rcsa_ident.stability.lobes import stability_lobes
    from rcsa_ident.stability.multi_frequency import MultiFrequency
    from rcsa_ident.stability.stability_map import stability_map
    from rcsa_ident.stability.surface_error import surface_location_error
    from rcsa_ident.stability.time_domain import TimeDomain
    from rcsa_ident.stability.tip_modes import TipModes
    from rcsa_ident.stability.zero_order import ZeroOrder
    from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, Contact, clamped

__all__ = [
    "MATERIALS",
    "BeamSegment",
    "Contact",
    "Coordinate",
    "CutSpec",
    "Cutter",
    "CuttingCoefficients",
    "Dof",
    "Engagement",
    "FlexibleRobot",
    "FullDiscretisation",
    "InputError",
    "KnownTip",
    "MillingProcess",
    "MultiFrequency",
    "PosedRobot",
    "ProcessDamping",
    "Quantity",
    "Receptance",
    "SemiDiscretisation",
    "Sensor",
    "SpeedVariation",
    "SpindleDrive",
    "TimeDomain",
    "TipModes",
    "Tooling",
    "ZeroOrder",
    "advise",
    "clamped",
    "connect",
    "estimate_forces",
    "hz",
    "identify",
    "listen",
    "material",
    "normal_modes",
    "plot_lobes",
    "read_campaign",
    "read_forces",
    "read_lobes",
    "read_machine",
    "read_modes",
    "read_recording",
    "read_result",
    "read_robot",
    "read_robot_result",
    "read_tap_tests",
    "read_tip",
    "read_tooling",
    "ring",
    "rpm",
    "sample_campaign",
    "sample_robot",
    "sample_tooling",
    "stability_lobes",
    "stability_map",
    "surface_location_error",
    "tap",
]

#: Where each name lives, as the block above says it to editors.
_ROOMS = {
    "base.errors": ("InputError",),
    "base.units": ("hz", "rpm"),
    "cutting.coefficients": ("CuttingCoefficients",),
    "cutting.conditions": ("Engagement",),
    "cutting.cutter": ("Cutter",),
    "cutting.materials": ("material",),
    "cutting.power": ("SpindleDrive",),
    "cutting.process": ("MillingProcess", "ProcessDamping", "SpeedVariation"),
    "dynamics.coordinates": ("Coordinate", "Dof"),
    "dynamics.modal": ("normal_modes",),
    "dynamics.receptance": ("Receptance",),
    "front.recorded": ("listen", "ring", "tap"),
    "front.samples": ("sample_robot", "sample_tooling"),
    "front.verbs": (
        "advise", "connect", "estimate_forces", "identify", "plot_lobes", "read_machine", "read_modes", "read_result", "read_tap_tests",
        "sample_campaign",
    ),
    "io.curves.forces": ("read_forces",),
    "io.curves.lobes": ("read_lobes",),
    "io.curves.tips": ("read_tip",),
    "io.recordings.readers": ("read_recording",),
    "io.results.robot_results": ("read_robot_result",),
    "io.settings.robots": ("read_robot",),
    "io.settings.setups": ("read_campaign", "read_tooling"),
    "machine.known_tip": ("KnownTip",),
    "machine.robot.flexible": ("FlexibleRobot",),
    "machine.robot.posed_robot": ("PosedRobot",),
    "setup.cut": ("CutSpec",),
    "setup.tooling": ("Tooling",),
    "signals.recording": ("Quantity", "Sensor"),
    "stability.discretisation": ("FullDiscretisation", "SemiDiscretisation"),
    "stability.lobes": ("stability_lobes",),
    "stability.multi_frequency": ("MultiFrequency",),
    "stability.stability_map": ("stability_map",),
    "stability.surface_error": ("surface_location_error",),
    "stability.time_domain": ("TimeDomain",),
    "stability.tip_modes": ("TipModes",),
    "stability.zero_order": ("ZeroOrder",),
    "tool_holder.geometry": ("MATERIALS", "BeamSegment", "Contact", "clamped"),
}  # fmt: skip
_HOME = {name: f"rcsa_ident.{room}" for room, names in _ROOMS.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'rcsa_ident' has no attribute '{name}'")
    found = globals()[name] = getattr(import_module(_HOME[name]), name)
    return found


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
