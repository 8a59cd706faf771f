"""The kernel of reduced tool-holders beside plain linear algebra; these tests run again without the compiler."""

import numpy as np
import pytest

from rcsa_ident.tool_holder import _kernels as kernels


@pytest.mark.parametrize(("count", "columns"), [(1, 5), (3, 6), (kernels.LANES + 5, 5), (kernels.LANES + 5, 6)])
def test_receptances_and_slopes_are_those_of_solved_systems(count, columns):
    rng = np.random.default_rng(count)
    r, unknowns = 4, 2

    def symmetric(scale, positive=True):
        a = rng.standard_normal((r, r))
        return scale * (a @ a.T + np.eye(r)) if positive else scale * (a + a.T)

    matrices = np.array([symmetric(1.0), symmetric(30.0), symmetric(1e6), symmetric(1e4)])
    changes = np.array([[symmetric(s, False) for s in (0.1, 3.0, 1e5, 1e3)] for _ in range(unknowns)])
    loads, omega = rng.standard_normal((3, r)), rng.uniform(300.0, 3000.0, count)
    values, slopes = np.empty((count, columns), dtype=complex), np.empty((count, columns, unknowns), dtype=complex)
    kernels.reduced_receptances(matrices, loads, omega, changes, values, slopes)
    pairs = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))[:columns]
    for f, w in enumerate(omega):
        m, c, k, s = matrices
        dynamic = k - w**2 * m + 1j * (s + w * c)
        x = np.linalg.solve(dynamic, loads.T)
        np.testing.assert_allclose(values[f], [loads[a] @ x[:, b] for a, b in pairs], rtol=1e-9)
        for u, (dm, dc, dk, ds) in enumerate(changes):
            change = dk - w**2 * dm + 1j * (ds + w * dc)
            expected = [-x[:, a] @ change @ x[:, b] for a, b in pairs]
            np.testing.assert_allclose(slopes[f, :, u], expected, rtol=1e-8, atol=1e-10 * np.abs(expected).max())


def test_without_room_for_slopes_all_values_come_all_the_same():
    """More frequencies than lanes: those behind the first ones, too."""
    rng = np.random.default_rng(1)
    count = 2 * kernels.LANES + 3
    matrices = np.array([np.eye(2), 30.0 * np.eye(2), 1e6 * np.eye(2), 1e4 * np.eye(2)])
    loads, omega = rng.standard_normal((3, 2)), np.linspace(300.0, 3000.0, count)
    values = np.full((count, 6), np.nan, dtype=complex)
    kernels.reduced_receptances(matrices, loads, omega, np.ones((1, 4, 2, 2)), values, np.empty((0, 6, 1), dtype=complex))
    dynamic = 1e6 - omega**2 + 1j * (1e4 + 30.0 * omega)
    np.testing.assert_allclose(values[:, 5], loads[2] @ loads[2] / dynamic, rtol=1e-12)
