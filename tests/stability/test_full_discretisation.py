"""Full discretisation against published limits, at high degree and at the published one."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.multi_frequency import MultiFrequency
from tests.oracles.literature import FOUR_MODES, LIMIT_RPM, SLOT_LIMIT_MM
from tests.stability.mills import FOUR, FOUR_COEFFICIENTS, ONE, RPM, TWO, mill, tip

#: The slot of one mode loses stability by period doubling there.
FLIPS = np.isin(LIMIT_RPM, (12500.0, 20000.0))


@pytest.mark.parametrize("degree", [1, 2, 6, 8])
@pytest.mark.parametrize("name", SLOT_LIMIT_MM)
def test_published_slot(name, degree):
    found = stability_lobes(tip(ONE if name == "one" else TWO), mill(2, 1.0), LIMIT_RPM * RPM, 30e-3, FullDiscretisation(degree=degree))
    np.testing.assert_allclose(found.limit_depth * 1e3, SLOT_LIMIT_MM[name], rtol=5e-4)
    assert found.warnings == ()
    if name == "one":
        np.testing.assert_array_equal(found.flip, FLIPS)
        np.testing.assert_allclose((found.chatter_frequency / (2.0 * LIMIT_RPM * RPM))[FLIPS] % 1.0, 0.5, atol=1e-6)
    else:
        assert not found.flip.any()


@pytest.mark.parametrize("degree", [1, 6])
def test_published_case_of_four_modes(degree):
    process = mill(4, 0.5, coefficients=FOUR_COEFFICIENTS)
    found = stability_lobes(tip(FOUR), process, FOUR_MODES["rpm"] * RPM, 30e-3, FullDiscretisation(degree=degree))
    np.testing.assert_allclose(found.limit_depth * 1e3, FOUR_MODES["limit_mm"], rtol=5e-4)


def test_up_is_down_for_a_symmetric_machine():
    up, down = (
        stability_lobes(tip(TWO), mill(2, 0.5, s), LIMIT_RPM * RPM, 30e-3, FullDiscretisation(tolerance=1e-6)) for s in ("up", "down")
    )
    np.testing.assert_allclose(up.limit_depth, down.limit_depth, rtol=1e-6)
    np.testing.assert_allclose(up.chatter_frequency, down.chatter_frequency, rtol=1e-5)


def test_intervals_that_are_given_are_used():
    """Forty steps a tooth period, as they are usual, are percents off; the default is not."""
    few = stability_lobes(tip(ONE), mill(2, 1.0), LIMIT_RPM[:4] * RPM, 30e-3, FullDiscretisation(intervals=40, degree=1))
    many = stability_lobes(tip(ONE), mill(2, 1.0), LIMIT_RPM[:4] * RPM, 30e-3, FullDiscretisation(intervals=600, degree=1))
    assert np.max(np.abs(few.limit_depth * 1e3 / SLOT_LIMIT_MM["one"][:4] - 1.0)) > 0.02
    np.testing.assert_allclose(many.limit_depth * 1e3, SLOT_LIMIT_MM["one"][:4], rtol=1e-3)


@pytest.mark.parametrize(
    ("arguments", "field", "words"),
    [
        ({"degree": 0}, "degree", "1 to 8"),
        ({"degree": 9}, "degree", "1 to 8"),
        ({"intervals": 0}, "intervals", "1 to 5000"),
        ({"tolerance": 0.5}, "tolerance", "1e-8 to 0.1"),
        ({"tolerance": float("nan")}, "tolerance", "1e-8 to 0.1"),
    ],
)
def test_bad_settings(arguments, field, words):
    with pytest.raises(InputError, match=words) as error:
        FullDiscretisation(**arguments)
    assert error.value.field == field


def test_a_receptance_is_not_marched_with():
    """The verb fits modes to it and says so; the method itself refuses it."""
    with pytest.raises(InputError, match="a rational fit") as error:
        FullDiscretisation().lobes(tip(ONE).receptance(), mill(), np.array([900.0]), 1e-3)
    assert error.value.field == "tip"
    # but the other way round
    assert stability_lobes(tip(ONE), mill(), [900.0], 30e-3, MultiFrequency()).limit_depth[0] < 30e-3
