"""Models at known unknowns, and data that they make."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.unknowns import DAMPING_UNIT, JOINT, flange_layout


def remade(data, theta, layout, rng, noise=1e-2, scatter=0.0):
    """The same cuts with lines of a model at `theta`: for tests of the optimiser and the statistics, not of the physics.

    `noise` and `scatter` are relative, per line; the data know of the first only. Returns the data and the true delays.
    """
    misfit = Misfit(data, Priors(), (0.0,) * len(data.axes))
    models = misfit.evaluate(theta, layout, np.zeros((len(data.cut_ids), 2))).models
    delay = rng.uniform(0.0, data.cut_prior.tooth_period)
    axes = []
    for axis, model in zip(data.axes, models, strict=True):
        draws = (rng.standard_normal((2, *model.shape)) + 1j * rng.standard_normal((2, *model.shape))) / np.sqrt(2.0)
        lines = model * (1.0 + noise * draws[0] + scatter * draws[1]) * np.exp(-1j * axis.omega * delay[axis.cut])[:, None]
        variance = 0.5 * max(noise, 1e-6) ** 2 * np.abs(model) ** 2
        axes.append(replace(axis, lines=np.stack([lines, np.zeros_like(lines)], axis=2), variance=variance))
    return replace(data, axes=tuple(axes)), delay


def vector_of(layout, frequency_hz, seed=1):
    """A vector of a layout with these natural frequencies (one list for each axis), all else as spindles have it."""
    rng = np.random.default_rng(seed)
    theta = np.zeros(layout.size)
    for i, (axis, hertz) in enumerate(zip(layout.axes, frequency_hz, strict=True)):
        m = axis.modes
        part = theta[layout.axis(i)]
        part[:m] = np.log(2.0 * np.pi * np.asarray(hertz))
        part[m : 3 * m] = rng.choice([-1.0, 1.0], 2 * m) * rng.uniform(0.2, 0.5, 2 * m)
        rows, cols = np.tril_indices(m)
        own = np.log(2.0 * 0.05 * np.exp(part[:m])) / 2.0 - np.log(DAMPING_UNIT)
        part[3 * m : axis.core - 3] = np.where(rows == cols, own[rows], 0.3 * rng.standard_normal(rows.size))
        part[axis.core - 3 : axis.core] = [1.0, 0.2, 0.8]
        for first in range(axis.core, axis.core + axis.places * (m + 2), m + 2):
            part[first : first + m] = 0.1 * rng.standard_normal(m)
            part[first + m : first + m + 2] = [0.3, -0.2]
        if axis.softening:
            part[axis.size - axis.pairs :] = 0.03 * rng.standard_normal(axis.pairs)
    theta[layout.joint] = np.log([2e9, 5e6, 1e3, 10.0])
    theta[layout.force] = 0.05 * rng.standard_normal(layout.coefficients)
    theta[layout.clamping] = rng.uniform(-1.0, 1.0, layout.clampings)
    return theta


def machine_vector(frequency_hz, seed=1):
    """A vector of one axis, its flange the only output."""
    return vector_of(flange_layout(len(frequency_hz)), (frequency_hz,), seed)


def own(theta):
    """The part of an only axis."""
    return theta[:-JOINT]
