"""What a row pushes with and how its chip follows the tip's motion, as sums of 1, cos, sin, cos 2 and sin 2 of the immersion angle.

Directions of the tip are x (feed), y (normal), z (towards the spindle) and the slopes x' and y': the edge at the height z and the
radius r moves by J q, so that its normal counts as J^T n and its force as J^T e. The normal is (sin kappa sin phi, sin kappa cos phi,
-cos kappa), the tangential direction (-cos phi, sin phi, 0), the radial one against the normal, the axial one across both.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.cutting.rows import Rows

#: How many of the directions count: x and y, with z, with the slopes.
Directions = Literal[2, 3, 5]


def normal_form(rows: Rows, directions: Directions) -> FloatArray:
    """Return the outward normals J^T n of 1, cos and sin, shape (rows, directions, 3) [-, slopes m]."""
    found = np.zeros((rows.count, 5, 3))
    sine, cosine = np.sin(rows.kappa), np.cos(rows.kappa)
    lever = rows.z * sine + rows.r * cosine
    found[:, 0, 2] = found[:, 1, 1] = sine
    found[:, 2, 0] = -cosine
    found[:, 3, 2] = found[:, 4, 1] = lever
    return found[:, :directions]


def force_form(rows: Rows, tangential: float, radial: float, axial: float, directions: Directions) -> FloatArray:
    """Return the forces J^T (tangential e_t + radial e_r + axial e_a) of 1, cos and sin, shape (rows, directions, 3)."""
    found = np.zeros((rows.count, 5, 3))
    sine, cosine = np.sin(rows.kappa), np.cos(rows.kappa)
    inward, upward = radial * sine + axial * cosine, radial * cosine - axial * sine
    found[:, 0, 1] = -tangential
    found[:, 1, 2] = tangential
    found[:, 0, 2] = found[:, 1, 1] = -inward
    found[:, 2, 0] = upward
    moment = -(rows.z * inward + rows.r * upward)
    found[:, 3, 1] = -rows.z * tangential
    found[:, 4, 2] = rows.z * tangential
    found[:, 3, 2] = found[:, 4, 1] = moment
    return found[:, :directions]


def product_form(force: FloatArray, normal: FloatArray) -> FloatArray:
    """Return the products force normal^T of 1, cos, sin, cos 2 and sin 2, shape (rows, 5, directions, directions)."""
    one, cos, sin = (force[:, :, None, k] for k in range(3))
    n_one, n_cos, n_sin = (normal[:, None, :, k] for k in range(3))
    even, odd = cos * n_cos, sin * n_sin
    return np.stack(
        [
            one * n_one + 0.5 * (even + odd),
            one * n_cos + cos * n_one,
            one * n_sin + sin * n_one,
            0.5 * (even - odd),
            0.5 * (cos * n_sin + sin * n_cos),
        ],
        axis=1,
    )


def exponential_form(form: FloatArray) -> ComplexArray:
    """Return the coefficients of e^{i q phi}, q from -k to k, of sums of 1, cos, sin, ..., cos k, sin k along axis 1."""
    top = form.shape[1] // 2
    found = np.zeros(form.shape, dtype=complex)
    found[:, top] = form[:, 0]
    for k in range(1, top + 1):
        found[:, top + k] = 0.5 * (form[:, 2 * k - 1] - 1j * form[:, 2 * k])
        found[:, top - k] = found[:, top + k].conj()
    return found


def mean_over_turn(rows: Rows, form: FloatArray) -> FloatArray:
    """Return the mean over the rotation of what rows do per width, summed over them: shape (directions, ...).

    `form`, shape (rows, 5, ...)
    """
    start, end = rows.start, rows.end
    basis = [end - start, np.sin(end) - np.sin(start), np.cos(start) - np.cos(end)]
    basis += [0.5 * (np.sin(2.0 * end) - np.sin(2.0 * start)), 0.5 * (np.cos(2.0 * start) - np.cos(2.0 * end))]
    weight = np.stack(basis, axis=1) * (rows.width / rows.spacing)[:, None]
    found: FloatArray = np.tensordot(weight[:, : form.shape[1]], form, axes=2)
    return found


def lines_of_rows(rows: Rows, form: FloatArray, orders: FloatArray) -> ComplexArray:
    """Return two-sided lines at multiples of the spindle's frequency of what rows do per width, each row by itself, shape (m, rows, ...).

    Parameters
    ----------
    form : array, shape (rows, 3 or 5, ...)
        Of 1, cos, sin, cos 2, sin 2.
    orders : array, shape (m,)
        Whole numbers; lines at which the teeth that are not listed answer each other are 0.

    Notes
    -----
    Line m of a row is the integral of e^{i (q - m) phi} over its arc, times e^{i m (angle - lag)}, the mean over the lags between
    near and far.
    """
    waves = exponential_form(form)
    top = form.shape[1] // 2
    n = np.arange(-top, top + 1)[None, None, :] - orders[:, None, None]
    middle, half = 0.5 * (rows.start + rows.end)[None, :, None], 0.5 * (rows.end - rows.start)[None, :, None]
    window = half / np.pi * np.exp(1j * n * middle) * np.sinc(n * half / np.pi)
    turned = np.exp(1j * orders[:, None] * (rows.angle - 0.5 * (rows.near + rows.far)))
    spread = np.sinc(orders[:, None] * (0.5 * (rows.far - rows.near)) / np.pi)
    copies = 2.0 * np.pi / rows.spacing
    together = np.abs(orders / copies - np.round(orders / copies)) < 1e-9
    weight = rows.width * turned * spread * (copies * together)[:, None]
    found: ComplexArray = np.einsum("mnq,nq...->mn...", window * weight[:, :, None], waves)
    return found
