"""Cost of one candidate: the search's kernel against the same algebra in vectorised NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.timing import Race
from rcsa_ident.identification._kernels.frf import cross_frf, cross_frf_gradient
from rcsa_ident.identification._kernels.lines import modal_cross_frf
from rcsa_ident.identification.genetic_algorithm import modal_fractions
from rcsa_ident.signals.motion import FLANGE_ALONE, GAP_AND_FIXTURE

LINES, TOOLINGS, MODES = 164, 2, 10


def run() -> list[dict[str, Any]]:
    """2 toolings x 164 frequencies of their own x 10 modes."""
    return [race.row() for race in races()]


def races() -> list[Race]:
    """Complex modes; passive form with one output and with two."""
    rng = np.random.default_rng(1)
    n = LINES * TOOLINGS
    omega = 2.0 * np.pi * rng.uniform(500.0, 4300.0, n)
    omega_n = 2.0 * np.pi * np.sort(rng.uniform(600.0, 3500.0, MODES))
    zeta = rng.uniform(0.01, 0.2, MODES)
    phi = (rng.standard_normal((MODES, 2)) + 1j * rng.standard_normal((MODES, 2))) * 1e-3
    flange = (rng.standard_normal((n, 3)) + 1j * rng.standard_normal((n, 3))) * 1e-8
    tip = (rng.standard_normal((n, 2)) + 1j * rng.standard_normal((n, 2))) * 1e-8
    joint = np.array([3e9, 6e8, 2e3, 1e3])
    fractions = modal_fractions(omega_n, zeta, phi[:, 0], phi[:, 1])
    flange_rows = np.ascontiguousarray(np.concatenate([[c.real, c.imag] for c in flange.T]))
    tip_rows = np.ascontiguousarray(np.concatenate([[c.real, c.imag] for c in tip.T]))
    out = np.empty((2, n))

    def kernel() -> None:
        modal_cross_frf(fractions, joint, omega, flange_rows, tip_rows, out)

    def vectorised() -> np.ndarray:
        pole = -zeta * omega_n + 1j * omega_n * np.sqrt(1.0 - zeta**2)
        one = 1.0 / (1j * omega[:, None] - pole)
        two = 1.0 / (1j * omega[:, None] - pole.conj())
        residues = np.stack([phi[:, 0] ** 2, phi[:, 0] * phi[:, 1], phi[:, 1] ** 2], axis=1)
        b = one @ residues + two @ residues.conj()
        e_tt = flange[:, 0] + 1.0 / (joint[0] + 1j * omega * joint[2]) + b[:, 0]
        e_rr = flange[:, 2] + 1.0 / (joint[1] + 1j * omega * joint[3]) + b[:, 2]
        e_tr = flange[:, 1] + b[:, 1]
        determinant = e_tt * e_rr - e_tr**2
        x0 = (e_rr * tip[:, 0] - e_tr * tip[:, 1]) / determinant
        x1 = (e_tt * tip[:, 1] - e_tr * tip[:, 0]) / determinant
        return b[:, 0] * x0 + b[:, 1] * x1

    kernel()
    reference = vectorised()
    error = float(np.max(np.abs(out[0] + 1j * out[1] - reference)) / np.max(np.abs(reference)))
    first = Race(
        "candidate, complex modes (2 x 164 lines x 10 modes)", "NumPy, vectorised", "numpy", kernel, vectorised, f"{error:.0e} apart"
    )
    return [first, *(passive(rng, omega, omega_n, flange, tip, joint, outputs) for outputs in (1, 2))]


def passive(
    rng: np.random.Generator,
    omega: np.ndarray,
    omega_n: np.ndarray,
    flange: np.ndarray,
    tip: np.ndarray,
    joint: np.ndarray,
    outputs: int,
) -> Race:
    """The polish's kernel with all derivatives; with two outputs gap and fixture, and the stiffness changes with speed."""
    n, m, pairs = omega.size, MODES, MODES * (MODES + 1) // 2
    psi = rng.standard_normal((m, 3)) * 0.2
    factor = np.tril(rng.standard_normal((m, m))) * 3.0 + np.diag(np.full(m, 20.0))
    residual = np.array([[3e-5, 0.0], [1e-5, 2e-5], [1e-10, -2e-10]])
    shapes = np.vstack([psi, residual.T])[:, : 1 + outputs].copy()
    shares = FLANGE_ALONE if outputs == 1 else GAP_AND_FIXTURE
    softening = 0.01 * rng.standard_normal((m, m)) if outputs == 2 else np.zeros((0, 0))
    softening = softening + softening.T
    points = np.column_stack([omega, np.ones(n), np.zeros(n), np.ones(n), rng.uniform(-1.0, 1.0, n)])
    holder = np.concatenate([flange, tip, np.zeros((n, 3))], axis=1)
    columns = 3 * m + pairs + 7 + (outputs == 2) * (m + 2 + pairs)
    weight, scale, gradient = np.ones((n, outputs), dtype=complex), np.ones(columns), np.empty((columns, 2 * n * outputs))

    def kernel() -> np.ndarray:
        values, kept, _ = cross_frf(omega_n, shapes, factor, softening, joint, (shares, np.zeros(2)), points, holder)
        cross_frf_gradient(omega_n, factor, softening, joint, (shares, np.zeros(2)), points, kept, weight, scale, gradient)
        return values

    def vectorised() -> np.ndarray:
        stiffness = np.broadcast_to(np.diag(omega_n**2), (n, m, m)).copy()
        if softening.size:
            stiffness += points[:, 4, None, None] * softening * np.outer(omega_n, omega_n)
        dynamic = stiffness + 1j * omega[:, None, None] * (factor @ factor.T)
        dynamic[:, np.arange(m), np.arange(m)] -= omega[:, None] ** 2
        u = np.linalg.solve(dynamic, np.broadcast_to(psi[:, :2].astype(complex), (n, m, 2)))
        block = psi[:, :2].T @ u + residual[:2] @ residual[:2].T
        e = np.zeros((n, 2, 2), dtype=complex)
        e[:, 0, 0], e[:, 0, 1], e[:, 1, 0], e[:, 1, 1] = flange[:, 0], flange[:, 1], flange[:, 1], flange[:, 2]
        e[:, 0, 0] += 1.0 / (joint[0] + 1j * omega * joint[2])
        e[:, 1, 1] += 1.0 / (joint[1] + 1j * omega * joint[3])
        x = np.linalg.solve(e + block, tip[:, :, None])
        whole = (block @ x)[:, 0]
        if outputs == 1:
            return whole
        fixture = ((psi[:, 2:].T @ u + residual[2]) @ x)[:, 0]
        return np.concatenate([whole - fixture, fixture], axis=1)

    reference = vectorised()
    error = float(np.max(np.abs(kernel() - reference)) / np.max(np.abs(reference)))
    what = "flange" if outputs == 1 else "gap and fixture, stiffness over speed"
    name = f"candidate, passive form, {what}, with all {columns} derivatives (NumPy: values only)"
    return Race(name, "NumPy, vectorised", "numpy", kernel, vectorised, f"{error:.0e} apart")
