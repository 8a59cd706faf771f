"""
Tap tests of a face mill
========================

Hits of a hammer along X and Y at the tip of a face mill, measured by others (leekunhwee/Dynamics on GitHub), exported
as text as CutPro exchanges it. From the two files follow the stability lobes in steel; the lowest limit was published
with them.
"""

import matplotlib.pyplot as plt
import numpy as np
from kept import real_files

import rcsa_ident as ri
from rcsa_ident.base.units import to_hz, to_rpm

files = real_files("https://github.com/leekunhwee/Dynamics", "face_mill.png", "facemill_x.frf", "facemill_y.frf")
if files:
    tip = ri.read_tap_tests(x=files[0], y=files[1])
    # two teeth, Ø31.75 mm, half-immersed in down-milling; K_tc 1319.4 MPa, K_rc 788.8 MPa
    steel, half = ri.CuttingCoefficients(1319.4e6, 788.8 / 1319.4), ri.Engagement.from_immersion(0.5, "down")
    cut = ri.MillingProcess(ri.Cutter(2, 31.75e-3), steel, half)
    lobes = ri.stability_lobes(tip, cut, ri.rpm(2000, 20_000, 25), max_depth=20e-3)

    fig, (top, bottom) = plt.subplots(2, 1, figsize=(7.2, 5.6), layout="constrained")
    for axis in "xy":
        top.semilogy(to_hz(tip.omega), 1e6 * np.abs(tip.between(f"tip.{axis}", f"tip.{axis}")), label=axis.upper())
    top.set(xlabel="frequency [Hz]", ylabel="receptance [µm/N]", xlim=(100, 4000), ylim=(0.01, 4.0), title="Measured at the tip")
    top.legend()
    bottom.plot(to_rpm(lobes.spindle_speed), 1e3 * lobes.limit_depth, color="C2")
    bottom.axhline(
        1e3 * lobes.absolute_limit, color="0.4", ls="--", lw=1.0, label=f"stable at any speed: {1e3 * lobes.absolute_limit:.3f} mm"
    )
    bottom.set(
        xlabel="spindle speed [rev/min]", ylabel="stability limit [mm]", ylim=(0.0, 10.0), title="Half-immersion down-milling of steel"
    )
    bottom.legend()

    limit, frequency = 1e3 * lobes.absolute_limit, to_hz(lobes.absolute_frequency)
    print(f"lowest limit {limit:.3f} mm at {frequency:.0f} Hz (published: 1.015 mm, 1441 Hz)")
    assert abs(limit / 1.015 - 1.0) < 2e-3
    assert abs(frequency / 1441.0 - 1.0) < 1e-3
