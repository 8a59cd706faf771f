"""A tool-holder whose drawing is only roughly right: its free receptances as smooth functions of the few numbers that nobody knows.

The finite-element matrices of `model` are affine or smooth in the numbers of an `Alteration`. They are projected once on what the
assembly does at frequencies of the band under forces at tip and flange, as drawn and with clearly other contacts, sections and
stickouts (proper orthogonal decomposition); after that a question costs one small system per frequency, and its slopes are exact.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import log

import numpy as np
import scipy.linalg

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.dynamics.structure import Structure
from rcsa_ident.tool_holder._kernels import reduced_receptances
from rcsa_ident.tool_holder.alteration import ALTERATIONS, Alteration, altered
from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.tool_holder.model import free_body

#: Vectors that the matrices are projected on; from 20 on the receptances are met to 1e-3 at alterations twice as large as usual spreads.
VECTORS = 20
#: Frequencies of the responses that span them, as shares of the highest one.
_SHARES = (0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95, 1.1)
#: Alterations at which they are taken: about twice what an honest drawing leaves open.
_FAR = {"fluted_diameter": 0.08, "youngs_modulus": 0.05, "stickout": 3e-4, "fluted_length": 3e-4, "holder_diameter": 0.01}
_CONTACTS = ((1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0))
#: What the matrices are polynomials of: the largest alteration between which each is laid, and its degree. `shank` is the change of the
#: shank's length in front of the holder, stickout less fluted length: a stretch's matrices know its own length alone.
_REACH = {"fluted_diameter": (0.12, 4), "fluted_length": (6e-4, 4), "shank": (6e-4, 4), "holder_diameter": (0.02, 2)}
#: Both belong to the fluted stretch, whose matrices hold their products, too, up to each one's square; laid through these alterations.
_PRODUCT = {"fluted_diameter": 0.08, "fluted_length": 3e-4}
_POWERS = ((1, 1), (1, 2), (2, 1), (2, 2))
#: Terms that the tool's modulus multiplies: those of the tool.
_OF_TOOL = ("fluted_diameter", "fluted_length", "shank")
_CONTACT = ("translational_stiffness", "rotational_stiffness", "translational_damping", "rotational_damping")


@dataclass(frozen=True, slots=True, eq=False)
class RoughToolHolder:
    """Reduced matrices of a tool-holder as a sum of terms, each a function of one alteration or of the modulus and one.

    `terms`, shape (t, 4, r, r): mass, damping, stiffness and structural damping of each term: see `_shares_of`
    `loads`, shape (3, r): unit force at the flange, unit slope there, unit force at the tip

    Examples
    --------
    >>> from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, Contact
    >>> carbide, steel = MATERIALS["carbide"], MATERIALS["steel"]
    >>> tool = (BeamSegment(0.030, 0.0096, carbide), BeamSegment(0.070, 0.012, carbide))
    >>> drawn = ToolAssembly(tool, (BeamSegment(0.060, 0.050, steel, inner_diameter=0.012),), 0.040, Contact(2e10, 6e5))
    >>> rough = rough_tool_holder(drawn, 4e3)
    >>> values, slopes = rough.receptances(Alteration(), 2e4 * np.ones(1), 1.0, ("youngs_modulus",))
    >>> values.shape, slopes.shape
    ((1, 5), (1, 5, 1))
    """

    terms: FloatArray
    loads: FloatArray

    def receptances(
        self, by: Alteration, omega: FloatArray, lever: float, unknowns: Sequence[str] = (), tip: bool = False
    ) -> tuple[ComplexArray, ComplexArray]:
        """Return the free receptances of the altered assembly and their slopes, shapes (n, 5) and (n, 5, u) [m/N].

        Columns: the flange's translation, translation and slope, slope; its translation and its slope per force at the tip; where `tip` is
        asked for a sixth, the tip's translation per force there.

        `omega` [rad/s], shape (n,)
        `lever` [m]: slopes are multiplied and moments divided by it
        `unknowns`: fields of `Alteration` along which slopes are told
        `tip`: whether the tip's own receptance is asked for, too
        """
        shares, slopes = _shares_of(by)
        matrices = np.tensordot(shares, self.terms, axes=1)
        chosen = [ALTERATIONS.index(name) for name in unknowns]
        changes = np.tensordot(slopes[:, chosen].T, self.terms, axes=1)
        values = np.empty((omega.size, 6 if tip else 5), dtype=complex)
        found = np.empty((omega.size if chosen else 0, values.shape[1], len(chosen)), dtype=complex)
        loads = self.loads * np.array([[1.0], [lever], [1.0]])
        reduced_receptances(matrices, loads, np.ascontiguousarray(omega), changes, values, found)
        return values, found


def rough_tool_holder(assembly: ToolAssembly, highest: float) -> RoughToolHolder:
    """Return the reduced matrices of a drawn assembly. `highest` [Hz]: frequency up to which the receptances are wanted."""

    @cache
    def structure(by: Alteration) -> Structure:
        return free_body(altered(assembly, by), highest, like=assembly).structure

    drawn = structure(Alteration())
    loads = np.zeros((3, drawn.mass.shape[0]))
    loads[[0, 1, 2], drawn.index[[2, 3, 0]]] = 1.0
    basis = _basis([structure(by) for by in _around(assembly)], loads, 2.0 * np.pi * highest)

    @cache
    def reduced(by: Alteration) -> FloatArray:
        s = structure(by)
        return np.array([basis.T @ each @ basis for each in (s.mass, s.damping, s.stiffness, s.structural_damping)])

    # twice as large by its logarithm: what is added is the term itself
    twice = log(2.0)

    def of_tool(by: Alteration) -> FloatArray:
        found: FloatArray = reduced(replace(by, youngs_modulus=twice)) - reduced(by)
        return found

    base, tool = reduced(Alteration()), of_tool(Alteration())
    terms = [base, tool]
    for of, start, names in ((reduced, base, tuple(_REACH)), (of_tool, tool, _OF_TOOL)):
        for name in names:
            terms += _polynomial(of, start, name)
        terms += _products(of, start)
    terms += [reduced(Alteration(**{name: twice})) - base for name in _CONTACT]
    return RoughToolHolder(frozen(np.array(terms)), frozen(loads @ basis))


def _around(assembly: ToolAssembly) -> list[Alteration]:
    """Alterations whose responses span what may be asked."""
    found = [Alteration(), *(Alteration(**{name: size}) for name, size in _FAR.items())]
    if assembly.contact is not None:
        found += [Alteration(translational_stiffness=k_t, rotational_stiffness=k_r) for k_t, k_r in _CONTACTS]
    return found


def _basis(structures: Sequence[Structure], loads: FloatArray, highest: float) -> FloatArray:
    """Vectors that hold the responses of all structures best, orthonormal over the first one's mass, shape (d, r)."""
    responses = []
    for s in structures:
        for share in _SHARES:
            w = share * highest
            dynamic = s.stiffness - w**2 * s.mass + 1j * (s.structural_damping + w * s.damping)
            x = scipy.linalg.solve(dynamic, loads.T, assume_a="sym", check_finite=False)
            # rigid motions, large below all modes, would hide what is sought
            x = x / np.linalg.norm(x, axis=0)
            responses += [x.real, x.imag]
    mass = structures[0].mass
    factor = np.linalg.cholesky(mass)
    vectors, _, _ = np.linalg.svd(factor.T @ np.hstack(responses), full_matrices=False)
    found: FloatArray = scipy.linalg.solve_triangular(factor.T, vectors[:, :VECTORS], check_finite=False)
    return found


def _at(**values: float) -> Alteration:
    """The alteration with these values of what the matrices are polynomials of."""
    shank = values.pop("shank", 0.0)
    return Alteration(stickout=shank + values.get("fluted_length", 0.0), **values)


def _polynomial(matrices: Callable[[Alteration], FloatArray], base: FloatArray, name: str) -> list[FloatArray]:
    """Coefficients of the matrices' change with one variable, first power to last."""
    reach, degree = _REACH[name]
    places = reach * np.arange(-degree // 2, degree // 2 + 1) / (degree // 2)
    places = places[places != 0.0]
    changes = np.array([matrices(_at(**{name: float(place)})) - base for place in places])
    powers = places[:, None] ** np.arange(1, degree + 1)
    return list(np.tensordot(np.linalg.inv(powers), changes, axes=1))


def _products(matrices: Callable[[Alteration], FloatArray], base: FloatArray) -> list[FloatArray]:
    """Coefficients of x y, x y^2, x^2 y and x^2 y^2 in the matrices' change with two variables at once."""
    (one, x), (other, y) = _PRODUCT.items()
    places = [(a, b) for a in (-x, x) for b in (-y, y)]
    changes = [matrices(_at(**{one: a, other: b})) - matrices(_at(**{one: a})) - matrices(_at(**{other: b})) + base for a, b in places]
    powers = np.array([[a**i * b**j for i, j in _POWERS] for a, b in places])
    return list(np.tensordot(np.linalg.inv(powers), np.array(changes), axes=1))


def _shares_of(by: Alteration) -> tuple[FloatArray, FloatArray]:
    """How much of each term an alteration asks for, shape (t,), and how that changes with each of its fields, shape (t, 9)."""
    values = {name: by.stickout - by.fluted_length if name == "shank" else getattr(by, name) for name in _REACH}
    stiffer = float(np.expm1(by.youngs_modulus))
    shares, slopes = [1.0, stiffer], [{}, {"youngs_modulus": stiffer + 1.0}]
    for names, factor, modulus in ((tuple(_REACH), 1.0, 0.0), (_OF_TOOL, stiffer, stiffer + 1.0)):
        for name in names:
            x = values[name]
            for i in range(1, _REACH[name][1] + 1):
                shares.append(factor * x**i)
                slopes.append({name: factor * i * x ** (i - 1), "youngs_modulus": modulus * x**i})
        (one, other), (x, y) = _PRODUCT, (values[name] for name in _PRODUCT)
        for i, j in _POWERS:
            shares.append(factor * x**i * y**j)
            along = {one: i * x ** (i - 1) * y**j, other: j * x**i * y ** (j - 1)}
            slopes.append({name: factor * slope for name, slope in along.items()} | {"youngs_modulus": modulus * x**i * y**j})
    for name in _CONTACT:
        shares.append(float(np.expm1(getattr(by, name))))
        slopes.append({name: float(np.exp(getattr(by, name)))})
    rows = []
    for slope in slopes:
        shank = slope.pop("shank", 0.0)
        slope["stickout"], slope["fluted_length"] = shank, slope.get("fluted_length", 0.0) - shank
        rows.append([slope.get(name, 0.0) for name in ALTERATIONS])
    return np.array(shares), np.array(rows)
