"""Write ross_free_free.csv: frequencies and receptances of a stepped free-free shaft by ROSS, a public rotor-dynamics package.

Run in an environment of its own (`pip install ross-rotordynamics "plotly<6"`); the table was made with version 2.3.0. ROSS's
shear coefficient is Cowper's for hollow sections; its rotation beta about y is dx/dz. Undamped; rows: kind, frequency [Hz],
value [SI].
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

SEGMENTS = ((0.030, 0.020, 0.0), (0.050, 0.050, 0.014), (0.040, 0.063, 0.020))  # length, outer, inner diameter [m], tip first
MATERIAL = {"E": 205e9, "rho": 7850.0, "Poisson": 0.3}
FREQUENCIES_HZ = (100.0, 700.0, 1500.0, 3000.0, 4500.0, 6000.0)
ELEMENT = 0.00025


def plane_matrices(element: float = ELEMENT) -> tuple[np.ndarray, np.ndarray]:
    """Mass and stiffness of one bending plane, of translation and slope at each node, from elements of about a length [m]."""
    import ross

    material = ross.Material(name="steel", **MATERIAL)
    elements = [
        ross.ShaftElement(L=length / count, idl=inner, odl=outer, material=material, shear_method_calc="cowper")
        for length, outer, inner in SEGMENTS
        for count in [round(length / element)]
        for _ in range(count)
    ]
    size = 6 * (len(elements) + 1)
    mass, stiffness = np.zeros((size, size)), np.zeros((size, size))
    for i, each in enumerate(elements):
        place = slice(6 * i, 6 * i + 12)
        mass[place, place] += each.M()
        stiffness[place, place] += each.K()
    kept = np.sort(np.concatenate([np.arange(0, size, 6), np.arange(4, size, 6)]))
    plane = np.ix_(kept, kept)
    return mass[plane], stiffness[plane]


def main() -> None:
    """Compute and write."""
    import scipy.linalg

    mass, stiffness = plane_matrices()
    squares = scipy.linalg.eigh(stiffness, mass, eigvals_only=True, subset_by_index=[2, 6])
    rows = [("natural frequency", np.sqrt(s) / (2.0 * np.pi), "") for s in squares]
    ports = {"tip.x": 0, "tip.x'": 1, "flange.x": len(mass) - 2, "flange.x'": len(mass) - 1}
    for frequency in FREQUENCIES_HZ:
        dynamic = stiffness - (2.0 * np.pi * frequency) ** 2 * mass
        force = np.eye(len(mass))[:, list(ports.values())]
        answer = scipy.linalg.solve(dynamic, force)[list(ports.values())]
        names = list(ports)
        rows += [(f"{names[i]} / {names[j]}", frequency, answer[i, j]) for i in range(4) for j in range(i, 4)]
    with (Path(__file__).parent / "ross_free_free.csv").open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([("kind", "frequency_hz", "value"), *rows])


if __name__ == "__main__":
    main()
