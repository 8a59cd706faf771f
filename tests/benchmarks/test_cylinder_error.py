"""What cutters with a shape were computed as: limits of cylinders that two other roads have found, beside those of the shapes."""

import re

import numpy as np
import pytest

from benchmarks import cylinder_error

FACE = [1.1287, 1.3449, 1.1319, 2.2655]
HIGH_FEED, BULL = [0.6239, 0.6389, 0.6248, 1.7211], [2.9794, 3.1712, 5.8141, 3.4052]
BALL, DEEP = [0.7821, 0.8404, 1.4424, 0.7443], [2.8172, 3.0301, 5.1657, 2.6799]
PITCH = [3.4761, 4.9347, 6.3244, 9.1299]
ROUGHER = [2.5527, 2.0403, 2.5538, 3.8374]
#: In the order of the benchmark [mm]; of the largest face mill none was found.
CYLINDERS = [
    FACE * 2, FACE[0:3:2], None, HIGH_FEED, HIGH_FEED, HIGH_FEED, BALL + DEEP, [3.6501, 4.5524, 4.0221], BALL, BULL, BULL,
    [3.6425, 4.3757, 4.6582, 5.1888], PITCH, [3.6519, 4.5546, 4.6739, 5.2336], ROUGHER * 3,
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("compared", "wanted"), list(zip(cylinder_error.COMPARED, CYLINDERS, strict=True)))
def test_cylinders_are_as_far_off_as_was_found(compared, wanted):
    true, cylinder = cylinder_error.limits(compared)
    if wanted is not None:
        assert 1e3 * cylinder == pytest.approx(wanted, rel=4e-4)
    found = [float(each) for each in re.findall(r"[0-9.]+", compared.found)]
    ratios = cylinder / true
    # told to two or three digits, one of them as about
    assert np.max(ratios) == pytest.approx(found[-1], rel=0.035)
    if not compared.found.startswith("up to"):
        assert np.min(ratios) == pytest.approx(found[0], rel=0.035)
