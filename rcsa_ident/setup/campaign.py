"""Recordings of one machine, and hammer tests beside them or in their place."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.shown import Shown
from rcsa_ident.base.units import to_rpm
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.passivity import Correction
from rcsa_ident.setup.cut import Cut, Workpiece
from rcsa_ident.setup.cut_course import course_remarks
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.signals.recording import Recording, Sensor, untold_distances

#: Median of the positive half of a normal distribution over its standard deviation, and about the spread of its logarithm.
HALF_NORMAL, HALF_NORMAL_SPREAD = 0.67, 0.95


@dataclass(frozen=True, slots=True, repr=False)
class HammerTest(Shown):
    """A receptance that a hammer has shown: of two points of a clamped tool, or of one and the machine's side of the flange.

    `tooling`: key of the campaign's toolings
    `axis`: X or Y, of response and force
    `response`, `force` [m]: distance of the point from the tip; None is the machine's side of the flange, where the cuts' sensors look
    `record`: number of the FRF in the file, from 1, where it holds several
    `units`: of a file that does not tell its own, as ``um/N``
    `standstill`: bool, default True; the spindle did not turn
    `sensor_mass` [kg], default 0: fixed to the tool-holder where the response is measured
    `band`: (float, float) [Hz]; lines that are used
    `error` [-]: standard deviation of each line beside its noise, as a share
    `correction`: of an FRF that was measured with a reversed sensor, or written conjugated
    """

    id: str
    tooling: str
    axis: Dof
    response: float | None
    force: float | None
    file: Path
    record: int | None = None
    units: str | None = None
    standstill: bool = True
    sensor_mass: float = 0.0
    band: tuple[float, float] = (0.0, np.inf)
    error: float = 0.02
    correction: Correction = Correction.AUTO

    def __str__(self) -> str:
        points = (
            "the flange" if z is None else "the tip" if z == 0.0 else f"{1e3 * z:g} mm from the tip" for z in (self.response, self.force)
        )
        return f"{self.id}: {self.tooling}, {self.axis.upper()}, {' for a force at '.join(points)}"


@dataclass(frozen=True, slots=True, repr=False)
class Campaign(Shown):
    """Recordings of one machine, hammer tests beside them or in their place.

    Parameters
    ----------
    sampling_rate : float or None [Hz]
        For files that carry none.
    workpiece : Workpiece or None
        None of hammer tests alone.
    clock_error : float, default 0
        By what share the recorder's clock runs fast: it takes that many more samples in a second than its files say.
    tests : tuple of HammerTest
    depth_spread : float [m]
        Standard deviation of the axial depth, the same in all cuts of a tooling. It counts where something of the drawings is not exact.
    softening_spread : float [-]
        Standard deviation of the stiffness' change from the middle to the end of the speeds, as a share.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> campaign = ri.read_campaign("data/sample_runs")
    >>> cut = campaign.cuts[0]
    >>> cut.id, cut.tooling, round(cut.conditions.spindle_speed, 1)
    ('S1-ER32-00', 'S1-ER32', 837.8)
    >>> print(campaign.workpiece)
    EN AW-6082: K_tc 902 MPa, k_rc 0.26
    """

    name: str
    sampling_rate: float | None
    sensors: tuple[Sensor, ...]
    workpiece: Workpiece | None
    toolings: Mapping[str, Tooling]
    cuts: tuple[Cut, ...]
    clock_error: float = 0.0
    tests: tuple[HammerTest, ...] = ()
    depth_spread: float = 0.02e-3
    softening_spread: float = 0.03

    @property
    def coefficients(self) -> CuttingCoefficients:
        """The workpiece's cutting coefficients, with the edge forces that are to be expected where nothing is told of any.

        Raises
        ------
        InputError
            There is no workpiece.
        """
        if self.workpiece is None:
            raise InputError("workpiece", "nothing", "a table [workpiece] in the campaign of cuts")
        told, edge = self.workpiece.coefficients, HALF_NORMAL * self.workpiece.edge_force_spread
        if not self.rough or told.tangential_edge or told.radial_edge or edge == 0.0:
            return told
        return replace(told, tangential_edge=edge, radial_edge=edge, edge_spread=HALF_NORMAL_SPREAD)

    @property
    def rough(self) -> bool:
        """Whether some of its drawings say that they are not exact."""
        return any(not tooling.spread.exact for tooling in self.toolings.values())

    def clocked(self, recording: Recording) -> Recording:
        """Return a recording whose rate is that at which its samples were truly taken."""
        return recording if self.clock_error == 0.0 else replace(recording, rate=recording.rate * (1.0 + self.clock_error))

    def cylinder_remarks(self, used: Collection[str]) -> tuple[Remark, ...]:
        """Return what to make of forces that took cutters for cylinders, for each tooling of the cuts of these ids."""
        found = []
        for name, tooling in self.toolings.items():
            depths = [cut.conditions.axial_depth for cut in self.cuts if cut.tooling == name and cut.id in used]
            if depths:
                found += [remark.of(name) for remark in tooling.cutter.cylinder_remarks(min(depths), forces=True)]
        return tuple(found)

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """What is unusual about its toolings, workpiece, sensors and cuts; of cuts that share a remark it names the first."""
        found = [remark.of(name) for name, tooling in self.toolings.items() for remark in tooling.remarks]
        if self.workpiece is not None:
            found += [remark.of(self.workpiece.name) for remark in self.workpiece.coefficients.remarks]
        found += untold_distances(self.sensors)
        found += course_remarks(self.cuts)
        cuts: dict[Remark, list[str]] = {}
        for cut in self.cuts:
            for remark in cut.remarks:
                cuts.setdefault(remark, []).append(cut.id)
        for remark, names in cuts.items():
            found.append(remark.of(names[0] + (f" and {len(names) - 1} more" if len(names) > 1 else "")))
        return tuple(found)

    def __str__(self) -> str:
        speeds = to_rpm(np.array([cut.speeds for cut in self.cuts]))
        counted = [f"{len(self.cuts)} cuts"] * bool(self.cuts or not self.tests) + [f"{len(self.tests)} hammer tests"] * bool(self.tests)
        made = f"{self.name}: {' and '.join(counted)} with {', '.join(self.toolings)}"
        if not speeds.size or self.workpiece is None:
            return made
        return f"{made}, {speeds.min():.0f} to {speeds.max():.0f} rev/min, {self.workpiece.name}"
