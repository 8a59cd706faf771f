"""Semi-discretisation against published limits, and against full discretisation."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.stability.discretisation import FullDiscretisation, SemiDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from tests.oracles.literature import FOUR_MODES, LIMIT_RPM, SLOT_LIMIT_MM
from tests.stability.mills import FOUR, FOUR_COEFFICIENTS, ONE, RPM, TWO, mill, tip


@pytest.mark.parametrize("name", SLOT_LIMIT_MM)
def test_published_slot(name):
    found = stability_lobes(tip(ONE if name == "one" else TWO), mill(2, 1.0), LIMIT_RPM * RPM, 30e-3, SemiDiscretisation())
    np.testing.assert_allclose(found.limit_depth * 1e3, SLOT_LIMIT_MM[name], rtol=1e-3)
    assert found.method == "semi-discretisation"
    assert found.warnings == ()


def test_published_case_of_four_modes():
    process = mill(4, 0.5, coefficients=FOUR_COEFFICIENTS)
    found = stability_lobes(tip(FOUR), process, FOUR_MODES["rpm"] * RPM, 30e-3, SemiDiscretisation())
    np.testing.assert_allclose(found.limit_depth * 1e3, FOUR_MODES["limit_mm"], rtol=1e-3)


@pytest.mark.parametrize("immersion", [0.05, 0.4])
def test_error_of_the_limit_falls_with_the_square_of_the_step(immersion):
    process, speeds = mill(2, immersion), np.array([8000.0, 14000.0]) * RPM
    exact = stability_lobes(tip(ONE), process, speeds, 30e-3, FullDiscretisation(tolerance=1e-7)).limit_depth
    one, two = (
        np.abs(stability_lobes(tip(ONE), process, speeds, 30e-3, SemiDiscretisation(n, 1e-5)).limit_depth / exact - 1.0) for n in (200, 800)
    )
    assert np.all(one < 0.02)
    np.testing.assert_allclose(one / two, 16.0, rtol=0.35)


@pytest.mark.parametrize(("arguments", "field"), [({"intervals": 6000}, "intervals"), ({"tolerance": 0.0}, "tolerance")])
def test_bad_settings(arguments, field):
    with pytest.raises(InputError) as error:
        SemiDiscretisation(**arguments)
    assert error.value.field == field
