from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.coupled._kernels import PointArrays
from rcsa_ident.identification.coupled.data import coupled_data
from rcsa_ident.identification.coupled.misfit import CoupledMisfit
from rcsa_ident.identification.coupled.score import coupled_start
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.rough_data import with_distances
from rcsa_ident.identification.unknowns import EVERY_PAIR, CoupledLayout, Layout, ModalBlock, scaled_joint, unpack
from tests.identification.coupled.models import LAYOUTS, coupled_vector, dense_lines, named
from tests.identification.models import vector_of
from tests.identification.test_misfit import dense, flat

SHARES = (0.02, 0.05)


@pytest.fixture(scope="module")
def tables(plain, rich):
    """Points by number of outputs."""
    # one sensor looks behind the flange, one at the holder, and nobody knows where exactly
    looking = with_distances(rich, np.array([0.03, -0.02]), np.array([0.02, 0.005]))
    return {1: coupled_data(plain), 2: coupled_data(looking)}


def case(tables, layout):
    """Misfit, layout with all that these data have, and a vector of it."""
    points = tables[2 if layout.fixture else 1]
    layout = replace(layout, coefficients=len(points.base.coefficient_spread), clampings=points.base.clampings)
    weight = np.linspace(0.3, 1.0, len(points.base.cut_ids))
    return CoupledMisfit(points, Priors(), SHARES, weight), layout, coupled_vector(layout)


def test_the_rich_case_has_everything(tables):
    points = tables[2]
    assert points.base.clampings == 2
    assert len(points.base.coefficients) == 4  # K_tc and k_rc, two run-outs
    assert len(points.base.coefficient_spread) == 4 + 2 * 2 * 2 * 2 + 2  # and smooth errors, and where the sensors look
    assert np.abs(points.relative_speed).max() == pytest.approx(1.0)
    assert (points.place < 0).any(axis=0).all()


@pytest.mark.parametrize("layout", LAYOUTS, ids=named)
def test_models_from_their_definition(tables, layout):
    """Both forces through dense solutions, each with its own coefficients' factor; an axis' smooth errors on its own lines."""
    misfit, layout, theta = case(tables, layout)
    points, data = misfit.points_data, misfit.data
    named_ones = len(data.coefficients)
    scales = theta[layout.force]
    turning = layout.turning
    rows = PointArrays(
        points.omega, points.relative_speed, points.speed, points.place, points.flange[turning], points.tip[turning], points.force
    )
    seen = [misfit.seen_at(i, theta, layout) for i in range(2)]
    both = dense_lines(unpack(theta, layout.block), scaled_joint(theta[layout.joint]), rows, seen)
    force = points.force * np.exp(points.slope @ scales[:named_ones])
    moved = np.einsum("paof,pf->pao", both, force)
    for i, (axis, model) in enumerate(zip(data.axes, misfit.models(theta, layout), strict=True)):
        assert model.shape == axis.variance.shape
        for p in np.flatnonzero(points.place[:, i] >= 0):
            line = points.place[p, i]
            expected = moved[p, i] if layout.fixture else moved[p, i].sum(keepdims=True)
            expected = expected / axis.force[line] * np.exp(axis.force_slope[line, named_ones:] @ scales[named_ones:])
            np.testing.assert_allclose(model[line], expected, rtol=1e-8)


@pytest.mark.parametrize("layout", LAYOUTS, ids=named)
def test_every_column_against_differences(tables, layout):
    """All unknowns, the cuts' delays and angles too: 1e-6 of a column, or of a thousandth of the usual one where it is next to nothing."""
    misfit, layout, theta = case(tables, layout)
    cuts = len(misfit.data.cut_ids)
    nuisance = np.column_stack([np.linspace(1e-5, 2e-4, cuts), np.linspace(-0.05, 0.05, cuts)])
    # the derivative is taken where the cuts' own fits have come to rest: they start there and stay
    for _ in range(20):
        nuisance = misfit.evaluate(theta, layout, nuisance).nuisance
    here = misfit.evaluate(theta, layout, nuisance, normal=True)
    nuisance = here.nuisance
    expected = dense(misfit, theta, layout, nuisance)
    size = theta.size
    found = np.zeros_like(expected)
    for k in range(size + 2 * cuts):
        step = np.zeros(size + 2 * cuts)
        step[k] = 1.0
        found[:, k] = flat(here.linear.push(step[:size], step[size:].reshape(-1, 2)))
    norm = np.linalg.norm(expected, axis=0)
    assert np.all(norm[:size] > 0.0)
    error = np.linalg.norm(found - expected, axis=0) / np.maximum(norm, 1e-3 * np.median(norm[:size]))
    assert error[:size].max() < 1e-6
    assert error[size:].max() < 1e-5


@pytest.mark.parametrize("layout", [each for each in LAYOUTS if each.skew == 2], ids=named)
def test_gradient_and_matrix_with_the_cuts_following(tables, layout):
    misfit, layout, theta = case(tables, layout)
    nuisance = np.zeros((len(misfit.data.cut_ids), 2))
    for _ in range(20):
        nuisance = misfit.evaluate(theta, layout, nuisance).nuisance
    here = misfit.evaluate(theta, layout, nuisance, normal=True)
    jacobian = dense(misfit, theta, layout, here.nuisance)
    square, slope = jacobian.T @ jacobian, jacobian.T @ flat(here.residual)
    own, cuts = np.arange(theta.size), np.arange(theta.size, square.shape[0])
    following = np.linalg.solve(square[np.ix_(cuts, cuts)], np.column_stack([square[np.ix_(cuts, own)], slope[cuts]]))
    expected = square[np.ix_(own, own)] - square[np.ix_(own, cuts)] @ following[:, :-1]
    gradient = slope[own] - square[np.ix_(own, cuts)] @ following[:, -1]
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(here.hessian / np.outer(scale, scale), expected / np.outer(scale, scale), atol=1e-5)
    np.testing.assert_allclose(here.linear.gradient / scale, gradient / scale, atol=1e-5 * np.abs(gradient / scale).max())


@pytest.mark.parametrize("fixture", [False, True])
def test_two_planes_side_by_side_are_what_each_is_alone(tables, fixture):
    """Where nothing is felt across, and tool-holders are asked as if they stood, the model is that of `Misfit`."""
    points = tables[2 if fixture else 1]
    data = points.base
    layout = Layout((ModalBlock(3, int(fixture), True), ModalBlock(2, int(fixture), True)), len(data.coefficient_spread), data.clampings)
    theta = vector_of(layout, ((600.0, 1400.0, 2500.0), (900.0, 2100.0)))
    apart = Misfit(data, Priors(), SHARES).models(theta, layout)
    for skew in (0, EVERY_PAIR):
        vector, whole = coupled_start(theta, layout, skew)
        together = CoupledMisfit(points, Priors(), SHARES).models(vector, whole)
        for one, other in zip(together, apart, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12 * np.abs(other).max())


def test_compliance_is_the_change_with_the_flange(tables):
    """What a new mode's promise is made of: d residual / d the flange's receptance, its upper triangle by rows."""
    misfit, layout, theta = case(tables, CoupledLayout(3, True, True, 1, 1))
    here = misfit.evaluate(theta, layout, np.zeros((len(misfit.data.cut_ids), 2)), normal=True)
    factor = unpack(theta, layout.block).residual
    rows, cols = np.triu_indices(4)
    for k in range(10):
        step = np.zeros(theta.size)
        step[layout.block.parts["residual"].start + k] = 1e-4
        ahead, behind = (unpack(theta + sign * step, layout.block).residual for sign in (1.0, -1.0))
        change = ((ahead @ ahead.T - behind @ behind.T) / 2e-4)[rows, cols]
        models = [misfit.models(theta + sign * step, layout) for sign in (1.0, -1.0)]
        for i in range(2):
            difference = -misfit.root_weight(i) * ((models[0][i] - models[1][i]) / 2e-4).ravel()
            assert here.linear.compliance[i].shape[1] == 10
            np.testing.assert_allclose(here.linear.compliance[i] @ change, difference, atol=1e-6 * np.abs(difference).max())
    assert factor.shape == (4, 4)


def test_lines_of_both_axes_move_with_both_forces(tables):
    """Without the force along Y the lines of X are others: the model takes neither for nothing."""
    misfit, layout, theta = case(tables, CoupledLayout(3))
    data = misfit.points_data
    silent = replace(data, force=data.force * np.array([1.0, 0.0]))
    one, other = (CoupledMisfit(each, Priors(), SHARES).models(theta, layout)[0] for each in (data, silent))
    assert np.linalg.norm(one - other) > 0.1 * np.linalg.norm(one)


def test_the_other_axis_model_error_weighs(tables):
    """A line at which both forces' shares cancel is not taken for exact."""
    misfit, _, _ = case(tables, CoupledLayout(3))
    axis = misfit.data.axes[0]
    expected = misfit.cut_weight[axis.cut][:, None] / (axis.variance + 0.5 * SHARES[0] ** 2 * axis.power)
    np.testing.assert_allclose(misfit.weight(0), expected, rtol=1e-9)
    assert np.all(axis.power >= np.abs(axis.lines[:, :, 0] - axis.lines[:, :, 1]) ** 2)
    assert axis.axis is Dof.X
