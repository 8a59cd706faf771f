"""The core beside programs and routes of others: receptances, coupling, lines of a record, polish, rational fits, draws, files.

Both sides get the same input and are asked for the same answer; how near they are stands in the row.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import tempfile
import warnings
from functools import cache, partial
from pathlib import Path
from typing import Any

import emcee
import numpy as np
import pyuff
import scipy.linalg
import scipy.optimize
from scipy.special import log_expit
from sdypy import EMA
from skrf import Network
from skrf.vectorFitting import VectorFitting

from benchmarks.lobes import TOOLING, lobes_machine
from benchmarks.timing import Race
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.rational import rational_fit
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.identification.levenberg_marquardt import refine
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.unknowns import flange_layout
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.io.uff import UffAxis, UffFunction, read_uff, write_uff
from rcsa_ident.signals.spectra import line_spectrum
from rcsa_ident.stability.labels.adaptive_importance import adaptive_importance
from rcsa_ident.tool_holder.geometry import BeamSegment, Material, ToolAssembly
from rcsa_ident.tool_holder.model import free_body, tool_holder_poles, tool_holder_receptance, tool_holder_structure
from rcsa_ident.tool_holder.turning import turning_pair
from tests.fixtures.virtual_shop import open_shop
from tests.identification.models import machine_vector, remade
from tests.oracles import ross_table


def run() -> list[dict[str, Any]]:
    """All of them, with best times."""
    return [race.row() for race in races()]


def races() -> list[Race]:
    """Those whose peer is installed."""
    found = [dense_holder(), turning_holder(), coupled_tip()]
    found += [lines_of_a_record(), polish(), vector_fit(), complex_frequency(), draws(), universal_file()]
    return [ross_shaft(), *found] if importlib.util.find_spec("ross") else found


def apart(found: np.ndarray, true: np.ndarray) -> str:
    """Difference of two answers over the norm of the second."""
    return f"{np.linalg.norm(found - true) / np.linalg.norm(true):.0e}"


def fresh(assembly: ToolAssembly, omega: np.ndarray) -> Receptance:
    """Receptances of a tool-holder that was never asked before: its poles are kept otherwise."""
    tool_holder_poles.cache_clear()
    return tool_holder_receptance(assembly, omega)


def ross_shaft() -> Race:
    """Free-free receptances of a stepped shaft at 400 frequencies, each side with the elements that give it four digits."""
    omega = 2.0 * np.pi * np.linspace(100.0, 6000.0, 400)
    own = Material(ross_table.MATERIAL["E"], ross_table.MATERIAL["rho"], ross_table.MATERIAL["Poisson"])
    shaft = ToolAssembly(tuple(BeamSegment(length, outer, own, inner) for length, outer, inner in ross_table.SEGMENTS), (), 0.0)
    exact = tool_holder_structure(shaft, 6000.0, refinement=8).receptance(omega).between("tip.x", "flange.x")

    def ours() -> np.ndarray:
        return fresh(shaft, omega).between("tip.x", "flange.x")

    def theirs(length: float = 0.005) -> np.ndarray:
        mass, stiffness = ross_table.plane_matrices(length)
        force = np.zeros(len(mass))
        force[-2] = 1.0
        return np.array([scipy.linalg.solve(stiffness - w**2 * mass, force, assume_a="sym")[0] for w in omega])

    told = f"to the converged mesh: ours {apart(ours(), exact)}, peer {apart(theirs(), exact)}"
    return Race("free shaft: elements to 400 receptances", "ROSS' elements, solved by SciPy", "ross-rotordynamics", ours, theirs, told)


def dense_holder() -> Race:
    """A clamped tool's receptances at 300 frequencies on the same mesh: reduced to poles, and solved frequency by frequency."""
    assembly = read_tooling(TOOLING).assembly
    omega = 2.0 * np.pi * np.linspace(300.0, 4300.0, 300)

    def theirs() -> np.ndarray:
        body = tool_holder_structure(assembly, 4300.0)
        stiff, ports = body.stiffness + 1j * body.structural_damping, np.eye(len(body.mass))[:, body.index]
        solved = (scipy.linalg.solve(stiff + 1j * w * body.damping - w**2 * body.mass, ports, assume_a="sym") for w in omega)
        return np.array([each[body.index] for each in solved])

    ours = partial(fresh, assembly, omega)
    told = f"same mesh, {apart(ours().values, theirs())} apart"
    return Race("tool-holder: drawing to 300 receptances", "SciPy, dense solution at each frequency", "scipy", ours, theirs, told)


def turning_holder() -> Race:
    """The same tool turning, both planes, at 352 tooth-passing lines, each at a speed of its own: what an identification asks for."""
    assembly = read_tooling(TOOLING).assembly
    teeth = np.repeat(4.0 * np.arange(1, 9), 44)
    omega = 2.0 * np.pi * np.linspace(300.0, 4300.0, teeth.size)

    def theirs() -> list[np.ndarray]:
        body = free_body(assembly, 4300.0)
        one, ports = body.structure, np.eye(len(body.rotary))[:, body.structure.index]
        stiff, found = one.stiffness + 1j * one.structural_damping, []
        for sense in (1.0, -1.0):
            mass = (one.mass + sense * 2.0 * body.rotary / n for n in teeth)
            both = zip(omega, mass, strict=True)
            solved = (scipy.linalg.solve(stiff + 1j * w * one.damping - w**2 * m, ports, assume_a="sym") for w, m in both)
            found.append(np.array([each[one.index] for each in solved]))
        return found

    def ours() -> tuple[np.ndarray, np.ndarray]:
        return turning_pair(assembly, omega, 1.0 / teeth)

    told = f"same mesh, {apart(np.array(ours()), np.array(theirs()))} apart"
    return Race("turning tool-holder: drawing to 352 lines, both planes", "SciPy, dense solution at each line", "scipy", ours, theirs, told)


def coupled_tip() -> Race:
    """A tip's receptances at 1000 frequencies; both sides keep the poles of the tool-holder."""
    tooling, machine = read_tooling(TOOLING), lobes_machine()
    omega = 2.0 * np.pi * np.linspace(300.0, 4300.0, 1000)

    joint = machine.joint
    springs, dampers = (
        np.array([getattr(joint, f"{way}_{what}") for way in ("translational", "rotational")]) for what in ("stiffness", "damping")
    )

    def theirs() -> np.ndarray:
        a, tips = tool_holder_receptance(tooling.assembly, omega).values, []
        for flange in machine.flanges:
            between = a[:, 2:, 2:] + flange.receptance(omega).values
            between[:, [0, 1], [0, 1]] += 1.0 / (springs + 1j * omega[:, None] * dampers)
            tips.append((a[:, :2, :2] - a[:, :2, 2:] @ np.linalg.solve(between, a[:, 2:, :2]))[:, 0, 0])
        return np.array(tips)

    def ours() -> Receptance:
        return machine.tip(tooling, omega)

    found = ours()
    told = f"{apart(np.array([found.between(f'tip.{axis}', f'tip.{axis}') for axis in 'xy']), theirs())} apart"
    return Race(
        "coupling: poles of the tool-holder and modes of the flange to a tip, X and Y, 1000 frequencies",
        "NumPy, all matrices at once",
        "numpy",
        ours,
        theirs,
        told,
    )


def lines_of_a_record() -> Race:
    """Amplitudes of all orders to 4300 Hz with a slow drift, two channels of 0.28 s."""
    rate, speed, count = 51200.0, 800.0, 14336
    time, rng = np.arange(count) / rate, np.random.default_rng(1)
    signal = sum(rng.normal() * np.cos(m * speed * time + m) for m in (1, 2, 4, 8, 12, 16, 20))
    samples = np.stack([signal, 0.5 * signal], axis=1) + 1e-2 * rng.standard_normal((count, 2))
    orders = np.arange(1, int(4300.0 * 2.0 * np.pi / speed) + 1)

    def theirs() -> np.ndarray:
        phase = np.outer(time, orders * speed)
        basis = np.concatenate([np.cos(phase), np.sin(phase), np.linspace(-1.0, 1.0, count)[:, None] ** np.arange(5)], axis=1)
        fitted = np.linalg.lstsq(basis, samples, rcond=None)[0]
        return fitted[: orders.size] - 1j * fitted[orders.size : 2 * orders.size]

    ours = partial(line_spectrum, samples, rate, speed, 4300.0)
    told = f"{apart(ours().amplitude[1:], theirs())} apart; ours with variances, hum and knocks looked for"
    return Race(
        "lines of a record: 33 orders, two channels, 0.28 s", "NumPy, lstsq of cosines, sines, polynomial", "numpy", ours, theirs, told
    )


@cache
def _problem() -> tuple[Misfit, Any, np.ndarray, np.ndarray]:
    """Two modes and a joint from 14 cuts along X with 1 % of noise, and a start beside them."""
    shop, layout = open_shop(), flange_layout(2)
    cuts, _ = shop.measurements(np.random.default_rng(1), runout=1e-7, fixture=False)
    truth = machine_vector((800.0, 1900.0))
    data, delay = remade(shop.prepare(cuts[::3]).only(Dof.X), truth, layout, np.random.default_rng(8))
    start = truth + 0.03 * np.random.default_rng(5).standard_normal(truth.size)
    return Misfit(data, Priors(), (1e-6,)), layout, start, np.stack([delay, 0.0 * delay], axis=1)


def polish() -> Race:
    """From a start beside the truth down to the nearest minimum."""
    misfit, layout, start, nuisance = _problem()
    unit = np.tile([1e-6, 1.0], nuisance.shape[0])

    def residual(x: np.ndarray) -> np.ndarray:
        found = misfit.residual_at(x[: start.size], layout, nuisance + (x[start.size :] * unit).reshape(-1, 2))
        return np.concatenate([*found.lines, found.own, found.cuts.ravel()])

    def theirs() -> float:
        begin = np.concatenate([start, np.zeros(unit.size)])
        return float(2.0 * scipy.optimize.least_squares(residual, begin, method="trf", x_scale="jac", ftol=1e-4).cost)

    def ours() -> float:
        return refine(misfit, start, layout, nuisance, 200).cost

    told = f"costs {ours():.2f} and {theirs():.2f}, both from the true delays"
    return Race(
        "polish: 16 unknowns and 28 of the cuts", "SciPy, least_squares by differences", "scipy", ours, theirs, told, (1, 1), "ms", 1e3
    )


@cache
def _modes() -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Frequencies [Hz], receptances of eight modes with noise of 1e-4 of the largest, without it, and the noise."""
    from benchmarks.validation_structures import eight_modes

    hertz = np.arange(100.0, 4301.0, 5.0)
    true = eight_modes().receptance(2.0 * np.pi * hertz).values
    noise, rng = 1e-4 * float(np.abs(true).max()), np.random.default_rng(1)
    return hertz, true + noise * (rng.standard_normal(true.shape) + 1j * rng.standard_normal(true.shape)), true, noise


def vector_fit() -> Race:
    """Sixteen poles of a 2 x 2 receptance with noise, the order told."""
    hertz, values, true, noise = _modes()
    scale = float(np.abs(values).max())

    def theirs() -> VectorFitting:
        fit = VectorFitting(Network(f=hertz, f_unit="hz", s=values / scale))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            fit.vector_fit(n_poles_real=0, n_poles_cmplx=8, fit_constant=True, fit_proportional=False)
        return fit

    ours = partial(rational_fit, 2.0 * np.pi * hertz, values, order=16, noise=noise)
    fit = theirs()
    other = scale * np.array([[fit.get_model_response(i, j, hertz) for j in range(2)] for i in range(2)]).transpose(2, 0, 1)
    told = f"to the truth: ours {apart(ours().response(2.0 * np.pi * hertz), true)}, peer {apart(other, true)}"
    return Race("rational fit: 16 poles, 2 x 2, 841 lines", "scikit-rf, vector fitting", "scikit-rf", ours, theirs, told, (1, 1), "ms", 1e3)


def complex_frequency() -> Race:
    """Natural frequencies of receptances without noise; the peer is told where they are."""
    hertz, _, true, _ = _modes()
    from benchmarks.validation_structures import eight_modes

    known = np.sort(np.abs(eight_modes().pole)) / (2.0 * np.pi)
    lines = np.arange(0.0, hertz[-1] + 1.0, 5.0)
    values = eight_modes().receptance(2.0 * np.pi * lines).values

    def theirs() -> np.ndarray:
        model = EMA.Model(values[:, :, 0].T, lines, lower=50, upper=hertz[-1], pol_order_high=60, frf_form="receptance")
        with contextlib.redirect_stderr(io.StringIO()):  # its bars of progress
            model.get_poles(method="lscf", show_progress=False)
            model.select_closest_poles(list(known))
        return np.sort(model.nat_freq)

    def ours() -> np.ndarray:
        return np.sort(np.abs(rational_fit(2.0 * np.pi * hertz, true[:, :, :1], order=16).pole)) / (2.0 * np.pi)

    told = f"frequencies: ours {np.max(np.abs(ours() / known - 1.0)):.0e}, peer {np.max(np.abs(theirs() / known - 1.0)):.0e}"
    return Race("modes of two receptances: eight", "sdypy-EMA, LSCF to order 60", "sdypy-EMA", ours, theirs, told, (1, 1), "ms", 1e3)


def draws() -> Race:
    """A bent posterior of two unknowns from labels: both until means are known to about 0.02."""
    depth, chatter = np.array([-1.0, -0.3, 0.2, 0.5, 1.2]), np.array([False, False, True, False, True])

    def log_likelihood(z: np.ndarray) -> np.ndarray:
        limit = z[:, 0] + 0.8 * z[:, 0] * z[:, 1] + 0.3 * z[:, 1] ** 2
        margin = (depth - limit[:, None]) / 0.15
        return np.sum(log_expit(np.where(chatter, margin, -margin)), axis=1)

    def ours(seed: int = 3) -> np.ndarray:
        rng = np.random.default_rng(seed)
        found = adaptive_importance(log_likelihood, rng.standard_normal((1500, 2)), rng, 700, 5)
        return found.weight @ found.z

    def theirs(seed: int = 4, steps: int = 1500) -> np.ndarray:
        chains = emcee.EnsembleSampler(40, 2, lambda z: log_likelihood(z) - 0.5 * np.sum(z**2, axis=1), vectorize=True)
        chains._random = np.random.RandomState(seed)
        chains.run_mcmc(np.random.default_rng(seed).standard_normal((40, 2)), steps)
        return chains.get_chain(discard=steps // 5, flat=True).mean(axis=0)

    grid = np.stack(np.meshgrid(*[np.linspace(-5.0, 5.0, 501)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
    weight = np.exp(log_likelihood(grid) - 0.5 * np.sum(grid**2, axis=1))
    exact = weight @ grid / weight.sum()
    errors = [np.sqrt(np.mean([(each(seed) - exact) ** 2 for seed in range(6)])) for each in (ours, theirs)]
    told = f"means of six runs to quadrature: ours {errors[0]:.3f}, peer {errors[1]:.3f} rms"
    return Race("draws of a bent posterior", "emcee, 40 walkers, 1500 steps", "emcee", ours, theirs, told, (1, 1), "ms", 1e3)


def universal_file() -> Race:
    """Twenty receptances of 4000 lines from a binary universal file."""
    rng, folder = np.random.default_rng(1), tempfile.TemporaryDirectory()
    path = Path(folder.name) / "frfs.uff"
    hertz = np.arange(1.0, 4001.0)
    values = rng.standard_normal((20, hertz.size)) + 1j * rng.standard_normal((20, hertz.size))
    axes: dict[str, Any] = {"abscissa_axis": UffAxis(18, "Hz"), "ordinate": UffAxis(8, "m"), "denominator": UffAxis(13, "N")}
    write_uff(path, [UffFunction(4, hertz, each, title=f"H{k}", **axes) for k, each in enumerate(values)], True)

    def theirs(kept: Any = folder) -> list[Any]:
        return [each for each in pyuff.UFF(str(path)).read_sets() if each["type"] == 58]

    def ours() -> list[UffFunction]:
        return read_uff(path)

    told = f"{apart(np.array([each.values for each in ours()]), np.array([each['data'] for each in theirs()]))} apart"
    return Race("universal file: 20 receptances of 4000 lines", "pyuff", "pyuff", ours, theirs, told, (1, 1), "ms", 1e3)
