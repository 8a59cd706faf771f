"""
From hits on the holder to the tip
==================================

On a real machining centre the hammer hit the collet's nut and the holder's flange, with the accelerometer at the tip
(leekunhwee/Vibration-Signal-Processing on GitHub). From these two FRFs alone the machine behind the flange is
identified, and the tip's own FRF predicted; the hit on the tip itself is laid beside it. The drawing is read off a
photograph, and that the tool is of carbide is told.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from kept import real_files

import rcsa_ident as ri
from rcsa_ident.base.units import to_hz
from rcsa_ident.io.curves.frf_files import read_frfs
from rcsa_ident.setup.campaign import Campaign, HammerTest
from rcsa_ident.tool_holder.geometry import Material

address = "https://github.com/leekunhwee/Vibration-Signal-Processing"
files = real_files(address, "holder_to_tip.png", *(f"hammer/frf_tip_from_point_{point}.txt" for point in (3, 5, 1)))
if files:
    # lengths in metres from the tip: a two-flute end mill of 20 mm in a collet chuck BT40-ER32
    carbide, steel = Material(550e9, 14_500.0, 0.25, 0.002), ri.MATERIALS["steel"]
    tool = (ri.BeamSegment(0.038, 0.016, carbide), ri.BeamSegment(0.068, 0.020, carbide))
    lengths, outer, inner = (0.037, 0.017, 0.003, 0.032, 0.026), (0.05, 0.039, 0.044, 0.047, 0.063), (0.02, 0.02, 0.02, 0.02, 0.016)
    holder = tuple(ri.BeamSegment(each, a, steel, b) for each, a, b in zip(lengths, outer, inner, strict=True))
    assembly = ri.clamped(tool, holder, 0.061, insertion=0.045, contact=ri.Contact(2e10, 6e6, 1e5, 40.0))
    tooling = ri.Tooling("BT40-ER32", ri.Cutter(2, 0.02), assembly)

    # each test: the response at the tip, the force so far from it; by reciprocity the same as the other way around
    places = {"nut": (0.090, files[0]), "V-flange": (0.165, files[1])}
    tests = tuple(HammerTest(name, "T", ri.Dof.X, 0.0, place, Path(file), band=(200.0, 3300.0)) for name, (place, file) in places.items())
    found = ri.identify(Campaign("real machine", None, (), None, {"T": tooling}, (), tests=tests), seed=1, processes=1)
    print(found)

    (measured,) = read_frfs(files[2])
    inside = (measured.frequency >= 200.0) & (measured.frequency <= 3300.0)
    frequency, true = measured.frequency[inside], measured.values[inside]
    tip = found.machine.tip(tooling, ri.hz(1.0) * frequency)
    h = tip.between("tip.x", "tip.x")

    fig, ax = plt.subplots(layout="constrained")
    ax.semilogy(frequency, 1e6 * np.abs(true), color="0.2", label="measured at the tip")
    ax.semilogy(to_hz(tip.omega), 1e6 * np.abs(h), label="predicted from hits on the holder")
    ax.set(xlabel="frequency [Hz]", ylabel="tip receptance [µm/N]", title="A real machining centre")
    ax.legend()

    peak, height = frequency[np.argmax(np.abs(h))], np.abs(h).max()
    at, size = frequency[np.argmax(np.abs(true))], np.abs(true).max()
    print(f"largest mode: predicted {peak:.0f} Hz, {1e6 * height:.3f} µm/N; measured {at:.0f} Hz, {1e6 * size:.3f} µm/N")
    assert found.status == "suspect"  # two hits on one tooling do not tell everything, and the answer says so
    assert abs(peak / at - 1.0) < 0.01
    assert abs(height / size - 1.0) < 0.1
