"""Responses of a reduced tool-holder and their changes; arrays and scalars only.

Frequencies stand in lanes, real and imaginary parts in arrays of their own, and the lanes innermost, so that the loops run in vector
registers.
"""

from __future__ import annotations

import numba
import numpy as np

#: Frequencies side by side: what they need stays in a core's cache.
LANES = 32


@numba.njit(cache=True, error_model="numpy")
def reduced_receptances(matrices, loads, omega, changes, values, slopes):
    """Fill `values` (n, p) with the receptances between flange and tip and, if it has rows, `slopes` (n, p, u) with their changes.

    D x_b = f_b with D = K - w^2 M + i (S + w C), and A_ab = f_a^T x_b, dA_ab = -x_a^T dD x_b, as D is symmetric. Its factor L D L^T has no
    pivots: damping keeps them from zero.

    Parameters
    ----------
    matrices : (4, r, r) mass, damping, stiffness, structural damping
    loads : (3, r) unit force at the flange, unit moment there, unit force at the tip
    omega : (n,)
    changes : (u, 4, r, r) of the matrices with each unknown

    Columns: flange tt, tr, rr, flange over tip t, r, and where there is a sixth the tip over the tip.
    """
    r, n, count, pairs = loads.shape[1], omega.size, changes.shape[0], values.shape[1]
    real, imag = np.empty((r, r, LANES)), np.empty((r, r, LANES))
    x_re, x_im = np.empty((3, r, LANES)), np.empty((3, r, LANES))
    w, t_re, t_im = np.ones(LANES), np.empty(LANES), np.empty(LANES)
    g_re, g_im = np.empty((3, LANES)), np.empty((3, LANES))
    s_re, s_im = np.empty((pairs, LANES)), np.empty((pairs, LANES))
    for start in range(0, n, LANES):
        here = min(LANES, n - start)
        for f in range(LANES):
            # the last lanes may be idle: they repeat a frequency
            w[f] = omega[start + min(f, here - 1)]
        for i in range(r):
            for j in range(i + 1):
                m, c, k, s = matrices[0, i, j], matrices[1, i, j], matrices[2, i, j], matrices[3, i, j]
                for f in range(LANES):
                    real[i, j, f] = k - w[f] * w[f] * m
                    imag[i, j, f] = s + w[f] * c
            for b in range(3):
                for f in range(LANES):
                    x_re[b, i, f] = loads[b, i]
                    x_im[b, i, f] = 0.0
        for j in range(r):
            # the pivot's inverse is kept in its place
            for f in range(LANES):
                size = 1.0 / (real[j, j, f] ** 2 + imag[j, j, f] ** 2)
                real[j, j, f] *= size
                imag[j, j, f] *= -size
            for i in range(j + 1, r):
                for f in range(LANES):
                    t_re[f] = real[i, j, f] * real[j, j, f] - imag[i, j, f] * imag[j, j, f]
                    t_im[f] = real[i, j, f] * imag[j, j, f] + imag[i, j, f] * real[j, j, f]
                for k in range(j + 1, i + 1):
                    for f in range(LANES):
                        real[i, k, f] -= t_re[f] * real[k, j, f] - t_im[f] * imag[k, j, f]
                        imag[i, k, f] -= t_re[f] * imag[k, j, f] + t_im[f] * real[k, j, f]
                for b in range(3):
                    for f in range(LANES):
                        x_re[b, i, f] -= t_re[f] * x_re[b, j, f] - t_im[f] * x_im[b, j, f]
                        x_im[b, i, f] -= t_re[f] * x_im[b, j, f] + t_im[f] * x_re[b, j, f]
        for j in range(r - 1, -1, -1):
            for b in range(3):
                for f in range(LANES):
                    t_re[f], t_im[f] = x_re[b, j, f], x_im[b, j, f]
                for i in range(j + 1, r):
                    for f in range(LANES):
                        t_re[f] -= real[i, j, f] * x_re[b, i, f] - imag[i, j, f] * x_im[b, i, f]
                        t_im[f] -= real[i, j, f] * x_im[b, i, f] + imag[i, j, f] * x_re[b, i, f]
                for f in range(LANES):
                    x_re[b, j, f] = t_re[f] * real[j, j, f] - t_im[f] * imag[j, j, f]
                    x_im[b, j, f] = t_re[f] * imag[j, j, f] + t_im[f] * real[j, j, f]
        for p in range(pairs):
            a, b = (0, 0, 1, 0, 1, 2)[p], (0, 1, 1, 2, 2, 2)[p]
            s_re[p, :] = 0.0
            s_im[p, :] = 0.0
            for i in range(r):
                for f in range(LANES):
                    s_re[p, f] += loads[a, i] * x_re[b, i, f]
                    s_im[p, f] += loads[a, i] * x_im[b, i, f]
            for f in range(here):
                values[start + f, p] = complex(s_re[p, f], s_im[p, f])
        if slopes.shape[0] == 0:
            continue
        for u in range(count):
            s_re[:] = 0.0
            s_im[:] = 0.0
            for i in range(r):
                g_re[:] = 0.0
                g_im[:] = 0.0
                for j in range(r):
                    m, c, k, s = changes[u, 0, i, j], changes[u, 1, i, j], changes[u, 2, i, j], changes[u, 3, i, j]
                    for f in range(LANES):
                        t_re[f] = k - w[f] * w[f] * m
                        t_im[f] = s + w[f] * c
                    for b in range(3):
                        for f in range(LANES):
                            g_re[b, f] += t_re[f] * x_re[b, j, f] - t_im[f] * x_im[b, j, f]
                            g_im[b, f] += t_re[f] * x_im[b, j, f] + t_im[f] * x_re[b, j, f]
                for p in range(pairs):
                    a, b = (0, 0, 1, 0, 1, 2)[p], (0, 1, 1, 2, 2, 2)[p]
                    for f in range(LANES):
                        s_re[p, f] += x_re[a, i, f] * g_re[b, f] - x_im[a, i, f] * g_im[b, f]
                        s_im[p, f] += x_re[a, i, f] * g_im[b, f] + x_im[a, i, f] * g_re[b, f]
            for p in range(pairs):
                for f in range(here):
                    slopes[start + f, p, u] = complex(-s_re[p, f], -s_im[p, f])
