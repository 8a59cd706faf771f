"""Least squares whose intervals hold with unequal and correlated errors: what belongs together is one cluster."""

from __future__ import annotations

import numpy as np
from scipy.special import stdtrit

from rcsa_ident.base.arrays import FloatArray

#: A cluster's own leverage from which on its residual is nothing but rounding.
_ALONE = 1.0 - 1e-7


def cluster_covariance(design: FloatArray, residual: FloatArray, cluster: np.ndarray) -> tuple[FloatArray, FloatArray]:
    """Return the covariance of a least-squares estimate and the degrees of freedom of each parameter's t-distribution.

    Parameters
    ----------
    design : array, shape (n, p)
        Full rank; whitened where the fit was.
    residual : array, shape (n,)
        What the least-squares fit leaves.
    cluster : array of int, shape (n,)
        Rows of one cluster may be correlated in any way and have any variance; clusters are independent.

    Returns
    -------
    arrays, shapes (p, p) and (p,)

    Notes
    -----
    Bias-reduced linearisation ([bell2002], "CR2"): V = B sum_g X_g' A_g e_g e_g' A_g X_g B with B = (X'X)^-1 and
    A_g = (I - H_gg)^-1/2, exact in the mean for equal independent errors; the degrees of freedom are Satterthwaite's for
    each parameter under them, (sum_g G_gg)^2 / sum_gh G_gh^2. With one row a cluster this is the heteroscedastic-robust HC2.
    """
    root = np.linalg.inv(np.linalg.qr(design, mode="r"))
    p, names = design.shape[1], np.unique(cluster)
    score, carried, inside, norm = (np.zeros((names.size, *shape)) for shape in ((p,), (p, p), (p, p), (p,)))
    for g, name in enumerate(names):
        rows = cluster == name
        turned = design[rows] @ root
        share, vectors = np.linalg.eigh(turned.T @ turned)
        share = np.clip(share, 0.0, 1.0)
        own = vectors @ np.diag(share) @ vectors.T
        # (I - H)^-1/2 seen from the columns; a direction that the cluster alone determines has no residual
        factor = np.where(share < _ALONE, 1.0 / np.sqrt(np.maximum(1.0 - share, 1e-300)), 0.0)
        stretch = vectors @ np.diag(factor) @ vectors.T
        score[g] = root @ stretch @ turned.T @ residual[rows]
        carried[g] = root @ stretch
        inside[g] = carried[g] @ own
        norm[g] = np.einsum("jp,pq,jq->j", carried[g], own, carried[g])
    covariance = score.T @ score
    pairs = -np.einsum("gjp,hjp->jgh", inside, inside)
    diagonal = np.arange(names.size)
    pairs[:, diagonal, diagonal] += norm.T
    trace = np.einsum("jgg->j", pairs)
    return covariance, trace**2 / np.maximum(np.sum(pairs**2, axis=(1, 2)), 1e-300)


def student_quantile(dof: FloatArray, level: float = 0.95) -> FloatArray:
    """Return the factor on a standard deviation that holds `level` of a t-distribution, both sides together."""
    return stdtrit(np.maximum(dof, 1e-3), 0.5 * (1.0 + level))
