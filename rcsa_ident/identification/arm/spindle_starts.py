"""Spindles that could exist: where a search for the one in a robot's hand begins.

A shaft of two diameters with a bore, on two bearings in a housing that is held, springs of X and Y in one ratio: eleven numbers draw all of
its modes, consistent with each other. Drawn ones are compared with the lines as they are; free modes begin at the best of them.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import scipy.linalg

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.units import from_hz
from rcsa_ident.identification.data import LEVER
from rcsa_ident.identification.modal_parameters import ModalParameters, flange_of
from rcsa_ident.identification.unknowns import DIRECTIONS
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment
from rcsa_ident.tool_holder.timoshenko import beam_matrices, section

#: Least and largest: length, diameter in front and behind, place of the front bearing [m], of the rear one as a share of the length;
#: logarithms of the bearings' stiffness in X [N/m], of that in Y over it, of the damping ratio; of the joint's stiffness [N/m, N m/rad].
_LEAST = np.array([0.25, 0.06, 0.05, 0.03, 0.5, *np.log([1e8, 5e7, 0.7, 0.015, 5e8, 1e6])])
_LARGEST = np.array([0.65, 0.11, 0.10, 0.12, 0.95, *np.log([2e9, 8e8, 1.4, 0.08, 8e9, 2e7])])
_ELEMENTS = 14
#: Share of the length that has the diameter in front, and of each diameter that is hollow.
_FRONT, _BORE = 0.25, 0.35
#: Modes up to here are modes, those above a residual compliance [Hz].
_HIGHEST = 6000.0
_LEAST_RESIDUAL = 1e-13


def drawn(count: int, rng: np.random.Generator) -> FloatArray:
    """Return what draws so many spindles, shape (count, 11)."""
    return _LEAST + (_LARGEST - _LEAST) * rng.random((count, _LEAST.size))


def spindle_of(numbers: FloatArray) -> tuple[ModalParameters, FloatArray]:
    """Return a drawn spindle, and the logarithms of its joint's translational and rotational stiffness, shape (2,)."""
    length, front, rear, first, second = numbers[:5].tolist()
    stiff, behind, ratio, zeta = np.exp(numbers[5:9]).tolist()
    places = (first, second * length)
    planes = [_plane(length, front, rear, places, (stiff * k, behind * k)) for k in (1.0, ratio)]
    omega_n = np.concatenate([plane[0] for plane in planes])
    psi, pull, residual = (scipy.linalg.block_diag(*(plane[k] for plane in planes)) for k in (1, 2, 3))
    damping = np.diag(np.sqrt(2.0 * zeta * omega_n))
    root = np.linalg.cholesky(residual + _LEAST_RESIDUAL * np.eye(DIRECTIONS))
    return replace(flange_of(omega_n, psi, damping, root), pull=pull), numbers[9:]


@lru_cache(maxsize=1)
def _whole_beam(length: float, front: float, rear: float) -> tuple[FloatArray, FloatArray]:
    """Mass and stiffness of the free shaft, the same in both planes."""
    mass, stiffness = np.zeros((2, 2 * _ELEMENTS + 2, 2 * _ELEMENTS + 2))
    step = length / _ELEMENTS
    for e in range(_ELEMENTS):
        diameter = front if e * step < _FRONT * length else rear
        m, k = beam_matrices(section(BeamSegment(step, diameter, MATERIALS["steel"], inner_diameter=_BORE * diameter)), step)
        own = slice(2 * e, 2 * e + 4)
        mass[own, own] += m
        stiffness[own, own] += k
    return mass, stiffness


def _plane(
    length: float, front: float, rear: float, places: tuple[float, float], springs: tuple[float, float]
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Natural frequencies, shapes and pulls (m, 2), and the residual compliance (2, 2), scaled by the lever."""
    mass, free = _whole_beam(length, front, rear)
    stiffness, step = free.copy(), length / _ELEMENTS
    for place, spring in zip(places, springs, strict=True):
        e = min(int(place / step), _ELEMENTS - 1)
        seen = np.zeros(mass.shape[0])
        # between two nodes a bearing holds both, by how near they are
        seen[2 * e + 2] = place / step - e
        seen[2 * e] = 1.0 - seen[2 * e + 2]
        stiffness += spring * np.outer(seen, seen)
    squares, shapes = scipy.linalg.eigh(stiffness, mass)
    omega_n, psi = np.sqrt(squares), shapes[:2].T * [1.0, LEVER]
    # the housing shifts, and turns about the flange
    along = np.arange(_ELEMENTS + 1) * step
    rigid = np.stack([np.tile([1.0, 0.0], _ELEMENTS + 1), np.stack([along, np.ones_like(along)], axis=1).ravel() / LEVER], axis=1)
    pull = shapes.T @ mass @ rigid
    low = omega_n < from_hz(_HIGHEST)
    return omega_n[low], psi[low], pull[low], (psi[~low].T / squares[~low]) @ psi[~low]
