"""Teeth that come round alike in a part of a turn."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import force_lines, runout_force_lines
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.cutting.serration import Serration

ALTERNATE = np.deg2rad([84.0, 96.0, 84.0, 96.0])
UNLIKE = [
    (Cutter(4, 0.012), 4),
    (Cutter(4, 0.012, pitch=ALTERNATE), 2),
    (Cutter(4, 0.012, pitch=np.deg2rad([84.0, 96.0, 96.0, 84.0])), 1),
    (Cutter(4, 0.012, helix=np.deg2rad([30.0, 36.0, 30.0, 36.0])), 2),
    (Cutter(4, 0.012, helix=np.deg2rad([30.0, 36.0, 30.0, 36.0]), pitch=np.deg2rad([80.0, 90.0, 95.0, 95.0])), 1),
    (Cutter(4, 0.012, runout=[0.0, 5e-6, 0.0, 5e-6]), 2),
    (Cutter(4, 0.012, runout=[0.0, 5e-6, 2e-6, 0.0]), 1),
    (Cutter(6, 0.012, pitch=np.deg2rad([50.0, 60.0, 70.0] * 2)), 2),
    (Cutter(6, 0.012, pitch=np.deg2rad([50.0, 70.0] * 3)), 3),
    (Cutter(4, 0.012, tilt=1e-3), 1),
    (Cutter(4, 0.012, serration=Serration(1e-4, 2e-3)), 1),
]


@pytest.mark.parametrize(("cutter", "count"), UNLIKE)
def test_symmetry_is_that_of_the_forces(cutter, count):
    """Between its multiples there is no line of the force; at its first one there is."""
    assert cutter.symmetry == count
    process = MillingProcess(cutter, CuttingCoefficients(6e8, 0.3, tangential_edge=2e4), Engagement(0.3, 1.4), feed_per_tooth=1e-4)
    orders = np.arange(1, 2 * cutter.teeth + 1)
    push = runout_force_lines if cutter.offset else force_lines
    lines = np.linalg.norm(push(cutter, process.conditions(900.0, 1.3e-3), process.coefficients, orders), axis=-1)
    silent = orders % count != 0
    assert np.all(lines[silent] < 1e-9 * lines.max())
    assert lines[count - 1] > 1e-6 * lines.max()
