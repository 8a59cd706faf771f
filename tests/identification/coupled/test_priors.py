from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.identification.coupled.score import coupled_start
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.unknowns import EVERY_PAIR, CoupledLayout, Layout, ModalBlock, prior_rows
from tests.identification.coupled.models import LAYOUTS, coupled_vector, named
from tests.identification.models import vector_of


@pytest.mark.parametrize("layout", LAYOUTS, ids=named)
def test_jacobian_against_differences(layout):
    layout = replace(layout, coefficients=2, clampings=1)
    theta = coupled_vector(layout)
    rows = prior_rows(layout, Priors(), (0.05, 3.0))
    columns = [(rows.residual(theta + step) - rows.residual(theta - step)) / 2.0 for step in np.eye(theta.size)]
    np.testing.assert_allclose(rows.jacobian, np.array(columns).T, atol=1e-9)
    _, expected = np.linalg.slogdet(rows.jacobian.T @ rows.jacobian)
    assert rows.log_volume == pytest.approx(expected, rel=1e-12)


def test_planes_that_feel_nothing_are_as_probable_as_apart():
    """Each plane's own unknowns have the priors that they had; what is felt across stands at its centre, and costs nothing."""
    layout = Layout((ModalBlock(3, 1, True), ModalBlock(2, 1, True)), 2, 1)
    theta = vector_of(layout, ((600.0, 1400.0, 2500.0), (900.0, 2100.0)))
    vector, whole = coupled_start(theta, layout, EVERY_PAIR)
    apart = prior_rows(layout, Priors(), (0.05, 3.0)).residual(theta)
    together = prior_rows(whole, Priors(), (0.05, 3.0)).residual(vector)
    assert together @ together == pytest.approx(apart @ apart, rel=1e-12)
    np.testing.assert_allclose(np.sort(together[together != 0.0]), np.sort(apart[apart != 0.0]), rtol=1e-12)


def test_gyroscopic_coupling_is_as_large_whichever_way_it_is_written():
    """An entry of one disc's a b^T - b a^T has, over many draws, the size that the entry itself may have."""
    rng, priors, m = np.random.default_rng(1), Priors(), 4
    one, every = (prior_rows(CoupledLayout(m, skew=skew), priors).spread for skew in (1, EVERY_PAIR))
    disc, entry = (of[CoupledLayout(m, skew=skew).block.parts["skew"]] for of, skew in ((one, 1), (every, EVERY_PAIR)))
    assert entry == pytest.approx(priors.skew)
    a, b = disc.reshape(2, 1, m) * rng.standard_normal((2, 4000, m))
    drawn = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    assert np.std(drawn) == pytest.approx(np.sqrt(2.0) * priors.skew, rel=0.1)
