"""Closed forms of beams, rods, rotors, coupling, modes and rational fits: exact solutions share no code with the package."""

from __future__ import annotations

import csv
from dataclasses import replace
from functools import cache, partial
from typing import Any

import control
import numpy as np
import scipy.linalg

from benchmarks.page import DOCS
from benchmarks.validation_case import Case, Measure
from rcsa_ident.coupling.assembly import assemble
from rcsa_ident.coupling.decoupling import decouple
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.modal import ModalModel, damped_modes, normal_modes
from rcsa_ident.dynamics.rational import rational_fit
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.structure import natural_frequencies
from rcsa_ident.tool_holder.geometry import BeamSegment, Contact, Material, ToolAssembly
from rcsa_ident.tool_holder.model import tool_holder_receptance, tool_holder_structure
from rcsa_ident.tool_holder.rods import rod_poles
from rcsa_ident.tool_holder.timoshenko import hutchinson
from rcsa_ident.tool_holder.turning import both_planes, turning_pair
from rcsa_ident.virtual.machine import Bearing, FlangeJoint
from rcsa_ident.virtual.rotor import frequency_response, rotor
from tests.coupling import test_rcsa as coupling
from tests.oracles import analytic, literature, naive, ross_table
from tests.tool_holder import exact_rods, test_model, test_rods, test_turning
from tests.virtual import test_rotor

ROSS = DOCS.parent / "tests" / "oracles" / "ross_free_free.csv"


def beam_frequencies(name: str) -> np.ndarray:
    """Natural frequencies of a uniform beam, clamped or free [Hz]."""
    case = literature.TIMOSHENKO[name]
    material = Material(case["youngs_modulus"], case["density"], case["poisson"])  # type: ignore[arg-type]
    rod = ToolAssembly((BeamSegment(case["length"], case["diameter"], material),), (), 0.0)  # type: ignore[arg-type]
    structure = tool_holder_structure(rod, 60e3, shear_coefficient=hutchinson, refinement=4)
    if "free_free" in case:
        return natural_frequencies(structure)[2:7] / (2.0 * np.pi)
    kept = np.setdiff1d(np.arange(structure.mass.shape[0]), structure.index[2:])
    squares = scipy.linalg.eigvalsh(structure.stiffness[np.ix_(kept, kept)], structure.mass[np.ix_(kept, kept)])
    return np.sqrt(squares[:5]) / (2.0 * np.pi)


def per_entry(values: np.ndarray, of: np.ndarray) -> np.ndarray:
    """Receptances over each entry's largest value in the band."""
    return values / np.max(np.abs(of), axis=0)


@cache
def continuous(name: str) -> np.ndarray:
    """Receptances of continuous beams and layer by transfer matrices."""
    return np.asarray(test_model.exact(test_model.ASSEMBLIES[name], test_model.BAND))


def assembly_case(name: str, what: str) -> Case:
    """A tool-holder's receptances beside the transcendental solution."""
    return Case(
        f"free tool-holder, {what}: 16 receptances at 50 frequencies to 5 kHz",
        "[cowper1966], transfer matrices of continuous Timoshenko beams",
        lambda: per_entry(continuous(name), continuous(name)),
        lambda: per_entry(tool_holder_receptance(test_model.ASSEMBLIES[name], test_model.BAND).values, continuous(name)),
        "of the entry's largest",
        4e-4,
        "tests/tool_holder/test_model.py::test_transcendental_solution",
        Measure.ABSOLUTE,
    )


def cone(refinement: int) -> float:
    """Deflection per force at the thin end of a clamped cone [m/N]."""
    steel = test_model.STEEL
    found = tool_holder_structure(ToolAssembly((BeamSegment(0.08, 0.01, steel, end_diameter=0.05),), (), 0.0), 1.0, refinement=refinement)
    kept = np.arange(found.index[2])
    return float(np.linalg.inv(found.stiffness[np.ix_(kept, kept)])[0, 0])


@cache
def peer_rows() -> list[dict[str, str]]:
    """The table that ROSS wrote."""
    with ROSS.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


@cache
def peer_shaft() -> Any:
    """The shaft of the peer's table."""
    material = Material(ross_table.MATERIAL["E"], ross_table.MATERIAL["rho"], ross_table.MATERIAL["Poisson"])
    shaft = ToolAssembly(tuple(BeamSegment(length, outer, material, inner) for length, outer, inner in ross_table.SEGMENTS), (), 0.0)
    return tool_holder_structure(shaft, 50e3)


def peer_receptances(ours: bool) -> np.ndarray:
    """Receptances at six frequencies, each over the median of its entry."""
    found = peer_shaft().receptance(2.0 * np.pi * np.array(ross_table.FREQUENCIES_HZ))
    values = []
    for row in (r for r in peer_rows() if r["kind"] != "natural frequency"):
        entry = found.between(*row["kind"].split(" / "))
        own = entry[ross_table.FREQUENCIES_HZ.index(float(row["frequency_hz"]))].real
        values.append((own if ours else float(row["value"])) / np.median(np.abs(entry)))
    return np.array(values)


def rod(ours: bool) -> np.ndarray:
    """Receptances of a stepped rod along its axis, each frequency over the norm of all entries there."""
    truth = exact_rods.exact((*test_rods.TOOL, *test_rods.HOLDER), test_rods.OMEGA)
    body = ToolAssembly(test_rods.TOOL, test_rods.HOLDER, insertion=0.0)
    found = rod_poles(body, float(test_rods.OMEGA[-1])).receptance(test_rods.OMEGA).values if ours else truth
    return found / np.linalg.norm(truth, axis=(1, 2))[:, None, None]


def whirl(ours: bool) -> np.ndarray:
    """Backward and forward whirl of a rigid disc on two springs that soften with the speed [Hz]."""
    speed = 200.0
    if ours:
        hertz = np.arange(2.0, 130.0, 0.02)
        size = np.abs(test_rotor.tilt_response(hertz, speed)[:, 0, 0])
        return hertz[1:-1][(size[1:-1] > size[:-2]) & (size[1:-1] > size[2:])]
    mass = 7850.0 * np.pi / 4.0 * 0.24**2 * 0.03
    across, polar = mass * (3.0 * 0.12**2 + 0.03**2) / 12.0, 0.5 * mass * 0.12**2
    stiffness, half = 2.0 * 2e7 * (1.0 - 1e-3 * speed) * 0.015**2, 0.5 * polar * speed / across
    return (np.sqrt(half**2 + stiffness / across) + np.array([-half, half])) / (2.0 * np.pi)


def gyroscopic(ours: bool) -> np.ndarray:
    """Receptances of a turning tool-holder in both planes over the motions of their coordinates."""
    assembly, omega = test_model.ASSEMBLIES["contact"], test_turning.BAND
    full = test_turning.naive(assembly, omega, np.full(omega.size, test_turning.FASTEST))
    found = both_planes(*turning_pair(assembly, omega, test_turning.FASTEST / omega)) if ours else full
    size = np.sqrt(np.abs(np.einsum("nii->ni", full)))
    return found / size[:, :, None] / size[:, None, :]


@cache
def two_planes() -> tuple[Any, Any, Any, np.ndarray]:
    """Tool-holder and spindle with cross terms, coupled, and the size of each entry."""
    tool = coupling.tool_in_both_planes()
    spindle = coupling.spindle_structure(np.random.default_rng(7), tuple(c.dof for c in coupling.FLANGES))
    coupled = couple(tool.receptance(coupling.W), spindle.receptance(coupling.W), coupling.JOINT).values
    size = np.sqrt(np.abs(np.einsum("nii->ni", coupled)))
    return tool, spindle, coupled, size[:, :, None] * size[:, None, :]


def coupled_by(road: str) -> np.ndarray:
    """The coupled receptances by another road, over the size of each entry."""
    tool, spindle, coupled, size = two_planes()
    if road == "couple":
        return coupled / size
    if road == "assemble":
        return assemble(tool, spindle, coupling.JOINT).receptance(coupling.W).values / size
    a, b = tool.receptance(coupling.W).values, spindle.receptance(coupling.W).values
    directions = tuple(c.dof for c in coupling.FLANGES)
    written = getattr(coupling, road)
    return np.array([written(a[i], b[i], coupling.joint_stiffness(w, directions)) for i, w in enumerate(coupling.W)]) / size


def decoupled(ours: bool) -> np.ndarray:
    """The spindle out of the coupled tip, over the size of each entry."""
    tool, spindle, coupled, _ = two_planes()
    true = spindle.receptance(coupling.W).values
    size = np.sqrt(np.abs(np.einsum("nii->ni", true)))
    if ours:
        a = tool.receptance(coupling.W)
        tips = tuple(c for c in a.rows if c.point == "tip")
        true = decouple(Receptance(coupling.W, coupled[:, :4, :4], tips, tips), a, coupling.JOINT).values
    return true / size[:, :, None] / size[:, None, :]


_LINES = np.linspace(100.0, 30000.0, 83)
_OMEGA_N, _PSI = np.array([3000.0, 7000.0, 12000.0]), np.array([[0.3, 4.0], [-0.2, 3.0], [0.5, -2.0]])
_DAMPING = 1500.0 * np.array([[1.0, 0.0, 0.0], [0.6, 0.8, 0.0], [-0.4, 0.5, 1.2]])
_DAMPING = _DAMPING @ _DAMPING.T / 1500.0


def direct() -> np.ndarray:
    """psi^T (Omega^2 + i w D - w^2)^-1 psi with a full damping matrix, one solution per frequency."""
    found = [_PSI.T @ np.linalg.solve(np.diag(_OMEGA_N**2) + 1j * w * _DAMPING - w**2 * np.eye(3), _PSI) for w in _LINES]
    return np.array(found)


def published_sum(ours: bool) -> np.ndarray:
    """The ten printed complex modes of X, summed."""
    f, zeta, tr, ti, rr, ri = literature.PUBLISHED_MODES["X"].T
    omega_n, phi = 2.0 * np.pi * f, 1e-4 * np.stack([tr + 1j * ti, rr + 1j * ri], axis=1)
    if ours:
        return ModalModel(omega_n, zeta / 100.0, phi, np.zeros((2, 2)), plane("flange")).receptance(_LINES).values.reshape(-1, 4)
    pole = omega_n * (-zeta / 100.0 + 1j * np.sqrt(1.0 - (zeta / 100.0) ** 2))
    residue = np.array([np.outer(p, p).ravel() for p in phi])
    return naive.pole_sum(_LINES, np.concatenate([pole, pole.conj()]), np.concatenate([residue, residue.conj()]))


@cache
def eight_modes() -> ModalModel:
    """Eight modes of a tip."""
    frequency = 2.0 * np.pi * np.array([180.0, 420.0, 650.0, 900.0, 1250.0, 1600.0, 2100.0, 2900.0])
    rng = np.random.default_rng(3)
    psi = rng.choice([-1.0, 1.0], (8, 2)) * rng.uniform(0.5, 1.5, (8, 2))
    zeta = np.array([0.03, 0.04, 0.02, 0.05, 0.02, 0.03, 0.015, 0.01])
    return normal_modes(frequency, zeta, psi, (plane("tip", Dof.X)[0], plane("tip", Dof.Y)[0]))


def fitted_poles() -> np.ndarray:
    """By the rational fit of receptances."""
    omega = 2.0 * np.pi * np.arange(100.0, 4301.0, 5.0)
    return np.sort_complex(rational_fit(omega, eight_modes().receptance(omega).values, order=16).pole)


def realized_poles() -> np.ndarray:
    """By python-control's realization of the impulse response."""
    rate, model = 20000.0, eight_modes()
    impulse = np.einsum("im,mk,mj->ijk", model.phi.T, np.exp(model.pole[:, None] * np.arange(400) / rate), model.phi)
    found, _ = control.eigensys_realization(2.0 * impulse.real, 16, m=150, n=150, dt=1.0 / rate)
    poles = np.log(np.linalg.eigvals(found.A).astype(complex)) * rate
    return np.sort_complex(poles[poles.imag > 0.0])


def cantilever(ours: bool) -> float:
    """Bar of 20 x 150 mm on a spindle that does not move, by the virtual machine [m/N]."""
    if not ours:
        area, inertia, kappa = np.pi * 1e-4, np.pi / 4.0 * 1e-8, 6.0 * 1.3 / (7.0 + 6.0 * 0.3)
        return float(0.15**3 / (3.0 * 205e9 * inertia) + 0.15 / (kappa * 205e9 / 2.6 * area))
    held = tuple(Bearing(z, (1e15, 1e15), (0.0, 0.0)) for z in (0.0, 0.03))
    still = replace(test_rotor.disc(False), bearings=held, joint=FlangeJoint(1e14, 0.0, 1e13, 0.0))
    bar = ToolAssembly((BeamSegment(0.15, 0.02, Material(205e9, 7850.0, 0.3)),), (), 0.0)
    return float(frequency_response(rotor(still, bar), np.array([1e-3]), outputs=("tip.x",))[0, 0, 0].real)


def shear_lag(ours: bool) -> float:
    """Stretch of a shank that a layer holds along its insertion, per force [m/N]."""
    k, length, steel = 4e9, 0.03, test_rods.STEEL
    areas = [np.pi / 4.0 * 0.012**2, np.pi / 4.0 * (0.03**2 - 0.012**2)]
    if not ours:
        a, b = (steel.youngs_modulus * each for each in areas)
        beta = np.sqrt(k * (1.0 / a + 1.0 / b))
        cosh, sinh = np.cosh(beta * length), np.sinh(beta * length)
        return float(0.02 / a + (length + (a / b + b / a) * cosh / (beta * sinh) + 2.0 / (beta * sinh)) / (a + b))
    light = Material(steel.youngs_modulus, 1.0, steel.poisson)
    tool, holder = BeamSegment(length + 0.02, 0.012, light), BeamSegment(length, 0.03, light, inner_diameter=0.012)
    body = rod_poles(ToolAssembly((tool,), (holder,), length, Contact(k, 1e6)), 6e5).receptance(np.array([2.0e3])).values[0].real
    return float(body[0, 0] - body[0, 1] - body[1, 0] + body[1, 1])


_MODEL, _RCSA = "tests/tool_holder/test_model.py", "tests/coupling/test_rcsa.py"
_ROADS = "entries over the motions of their coordinates"
CASES = (
    Case(
        "uniform beam of carbide, clamped and free, five modes",
        "[hutchinson2001], roots of the frequency determinant in 30 digits",
        literature.TIMOSHENKO["carbide_d12_L100"]["clamped_free"],
        partial(beam_frequencies, "carbide_d12_L100"),
        "Hz",
        5e-8,
        "tests/tool_holder/test_timoshenko.py::test_closed_form_frequencies",
    ),
    Case(
        "uniform beam of steel, free at both ends, five modes",
        "[hutchinson2001], roots of the frequency determinant in 30 digits",
        literature.TIMOSHENKO["steel_d10_L125"]["free_free"],
        partial(beam_frequencies, "steel_d10_L125"),
        "Hz",
        5e-8,
        "tests/tool_holder/test_timoshenko.py::test_closed_form_frequencies",
    ),
    assembly_case("contact", "tool held by springs along its insertion"),
    assembly_case("rigid", "tool and holder as one along the insertion"),
    assembly_case("stepped", "steps of tool and holder inside the contact"),
    assembly_case("tool alone", "tool without a holder"),
    Case(
        "clamped cone of steel, deflection at its thin end",
        "[cowper1966], quadrature of the flexibility integral",
        partial(analytic.cone_tip_compliance, 0.08, 0.01, 0.05, 205e9, 0.3),
        partial(cone, 1),
        "m/N",
        2e-2,
        f"{_MODEL}::test_order_on_a_taper_is_two",
    ),
    Case(
        "bar clamped to a spindle that stands still, by the virtual machine",
        "[cowper1966], F L³/(3 E I) + F L/(κ G A)",
        partial(cantilever, False),
        partial(cantilever, True),
        "m/N",
        1e-4,
        "tests/virtual/test_rotor.py::test_static_compliance_of_a_cantilever",
    ),
    Case(
        "stepped free shaft, five natural frequencies",
        "ROSS 2.3.0, 480 elements (tests/oracles/ross_free_free.csv)",
        lambda: [float(r["frequency_hz"]) for r in peer_rows() if r["kind"] == "natural frequency"],
        lambda: natural_frequencies(peer_shaft())[2:7] / (2.0 * np.pi),
        "Hz",
        2e-5,
        f"{_MODEL}::test_peer_table",
    ),
    Case(
        "the same shaft, ten receptances at six frequencies",
        "ROSS 2.3.0, 480 elements (tests/oracles/ross_free_free.csv)",
        partial(peer_receptances, False),
        partial(peer_receptances, True),
        "of the entry's median",
        3e-5,
        f"{_MODEL}::test_peer_table",
    ),
    Case(
        "stepped rod along its axis with loss, 400 frequencies to 12 kHz",
        "rods in closed form, carried from end to end",
        partial(rod, False),
        partial(rod, True),
        "of all entries there",
        1e-4,
        "tests/tool_holder/test_rods.py::test_a_stepped_rod",
        Measure.ABSOLUTE,
    ),
    Case(
        "shank pulled out of a springy layer, stretch",
        "shear lag of two rods and a layer in closed form",
        partial(shear_lag, False),
        partial(shear_lag, True),
        "m/N",
        1e-3,
        "tests/tool_holder/test_rods.py::test_a_contact_gives_way_as_a_spring_along_the_shank",
    ),
    Case(
        "rigid disc that whirls at 200 rad/s, backward and forward",
        "√((g/2)² + k/I) ∓ g/2",
        partial(whirl, False),
        partial(whirl, True),
        "Hz",
        2e-3,
        "tests/virtual/test_rotor.py::test_disc_whirls_as_the_closed_form_says",
        slow=True,
    ),
    Case(
        "tool-holder that turns at 20 000 rev/min, both planes",
        "full equations with gyroscopic moments, one dense solution per frequency",
        partial(gyroscopic, False),
        partial(gyroscopic, True),
        _ROADS,
        1e-6,
        "tests/tool_holder/test_turning.py::test_full_equations",
        Measure.ABSOLUTE,
        slow=True,
    ),
    *(
        Case(
            f"tool-holder coupled to a spindle, both planes with cross terms, {what}",
            source,
            partial(coupled_by, road),
            partial(coupled_by, "couple"),
            _ROADS,
            allowed,
            f"{_RCSA}::test_four_roads",
            Measure.ABSOLUTE,
        )
        for road, what, source, allowed in (
            ("textbook", "by elimination of the joint's force", "[schmitz2000], [park2003]", 1e-9),
            ("assemble", "by one system of equations", "mass, damping and stiffness of both, assembled", 1e-8),
        )
    ),
    Case(
        "the spindle decoupled from the coupled tip, both planes with cross terms",
        "[park2003]; the spindle that was coupled",
        partial(decoupled, False),
        partial(decoupled, True),
        _ROADS,
        1e-5,
        "tests/coupling/test_decoupling.py::test_both_planes_at_once",
        Measure.ABSOLUTE,
    ),
    Case(
        "printed complex modes, receptance at 83 frequencies",
        "[inprocess], table A.4: sum over poles, term by term",
        partial(published_sum, False),
        partial(published_sum, True),
        "m/N, rad/N, rad/(N m)",
        1e-11,
        "tests/dynamics/test_modal.py::test_complex_modes_as_the_formula_is_written",
    ),
    Case(
        "real modes with a full damping matrix, receptance at 83 frequencies",
        "one dense solution per frequency",
        direct,
        lambda: damped_modes(_OMEGA_N, _DAMPING, _PSI, np.zeros((2, 2)), plane("flange")).receptance(_LINES).values,
        "m/N, rad/N, rad/(N m)",
        1e-9,
        "tests/dynamics/test_modal.py::test_damped_modes",
    ),
    Case(
        "poles of eight modes by a rational fit of their receptances",
        "python-control, realization of the impulse response",
        realized_poles,
        fitted_poles,
        "rad/s",
        1e-6,
        "tests/dynamics/test_rational_peers.py::test_the_same_poles_as_a_realization_of_the_impulse_response",
    ),
)
