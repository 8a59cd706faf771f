"""Modes of a tip that is known by its receptance alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rcsa_ident.arrays import ComplexArray, FloatArray
from rcsa_ident.dynamics.rational import RationalFit, rational_fit
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.errors import InputError
from rcsa_ident.stability.tip_modes import TipModes

#: What a fit of a receptance may be beside it, root mean square.
FIT_TOLERANCE = 2e-3
#: Damping ratio of a fitted pole outside the band.
STRANGE = 0.1


def fitted_modes(tip: Receptance) -> tuple[TipModes, float]:
    """Return modes that stand for the tip's receptance, and how far they are beside it: the norm of what is left, as a share.

    Notes
    -----
    A rational fit, by planes where these do not feel each other. Poles outside the band stand for many modes and are nobody's:
    lightly damped, they would chatter. They are damped by `STRANGE`, and all residues are fitted again.
    """
    kept = tip.omega > 0.0
    omega, values = tip.omega[kept], tip.values[kept]
    coupled = bool(np.any(values[:, 0, 1]) or np.any(values[:, 1, 0]))
    parts = []
    for rows in [[0, 1]] if coupled else [[i] for i in range(2) if np.any(values[:, i, i])]:
        block = values[:, rows][:, :, rows]
        own = _damp_poles_outside_band(rational_fit(omega, block, tolerance=FIT_TOLERANCE), omega, block).modes()
        unit = np.eye(2)[:, rows]
        parts.append((own.pole, unit @ own.outputs, own.inputs @ unit.T, unit @ own.constant @ unit.T))
    if not parts:
        raise InputError("tip receptance", "zero at every frequency", "at least one flexible direction")
    pole, outputs, inputs, constant = zip(*parts, strict=True)
    modes = TipModes(np.concatenate(pole), np.concatenate(outputs, axis=1), np.concatenate(inputs), np.sum(constant, axis=0))
    return modes, float(np.linalg.norm(modes.at(omega) - values) / np.linalg.norm(values))


def _damp_poles_outside_band(fit: RationalFit, omega: FloatArray, values: ComplexArray) -> RationalFit:
    """The fit with well damped poles outside the band: residues by least squares, so that the peaks of the band stay what they are."""
    size = np.abs(fit.pole)
    strange = ((size < omega[0]) | (size > omega[-1])) & (-fit.pole.real < STRANGE * size)
    if not strange.any():
        return fit
    pole = np.where(strange, size * complex(-STRANGE, np.sqrt(1.0 - STRANGE**2)), fit.pole)
    first, second = (1.0 / (1j * omega[:, None] - p) for p in (pole, pole.conj()))
    # the columns differ by many powers of ten
    basis = np.hstack([first + second, 1j * (first - second), np.ones((omega.size, 1))])
    scale = np.linalg.norm(basis, axis=0) + 1e-300
    residue, constant = np.empty(fit.residue.shape, dtype=complex), np.empty(fit.constant.shape)
    for place in np.ndindex(fit.constant.shape):
        value = values[:, *place]
        columns, right = basis / scale, value
        both = np.linalg.lstsq(np.vstack([columns.real, columns.imag]), np.concatenate([right.real, right.imag]), rcond=1e-13)[0] / scale
        residue[:, *place], constant[place] = both[: pole.size] + 1j * both[pole.size : -1], both[-1]
    return replace(fit, pole=pole, residue=residue, constant=constant)
