"""
One real hit of a hammer
========================

A hit on the tip of an end mill on a machining centre, force and acceleration over one second, recorded by others
(leekunhwee/Vibration-Signal-Processing on GitHub). The recording becomes a receptance; beside it stands the one that
its authors made.
"""

import matplotlib.pyplot as plt
import numpy as np
from kept import real_files

import rcsa_ident as ri
from rcsa_ident.base.units import to_hz
from rcsa_ident.io.curves.frf_files import read_frfs

address = "https://github.com/leekunhwee/Vibration-Signal-Processing"
files = real_files(address, "one_hit.png", "hammer/raw_tap_tip_tip.txt", "hammer/frf_tip_from_point_1.txt")
if files:
    found = ri.tap(files[0])
    print(found)
    (theirs,) = read_frfs(files[1])
    time, force, _ = np.loadtxt(files[0]).T

    fig, (left, right) = plt.subplots(1, 2, figsize=(9.6, 4.0), width_ratios=(1.0, 1.6), layout="constrained")
    start = time[np.argmax(force)]
    left.plot(1e3 * (time - start), force)
    left.set(xlabel="time around the hit [ms]", ylabel="force [N]", xlim=(-1.0, 2.0), title="The hammer")
    right.semilogy(theirs.frequency, 1e6 * np.abs(theirs.values), color="0.7", lw=3.5, label="as published")
    right.semilogy(to_hz(found.omega), 1e6 * np.abs(found.receptance), lw=1.2, label="from the recording")
    right.set(xlabel="frequency [Hz]", ylabel="receptance [µm/N]", xlim=(200, 5000), ylim=(0.003, 2.0), title="At the tip")
    right.legend()

    inside = (found.omega > ri.hz(200.0)) & (found.omega < ri.hz(4000.0))
    peak = np.argmax(np.abs(np.where(inside, found.receptance, 0.0)))
    frequency, height = to_hz(found.omega[peak]), np.abs(found.receptance[peak])
    print(f"peak {1e6 * height:.3f} µm/N at {frequency:.0f} Hz (published: 0.676 µm/N at 1056 Hz)")
    assert abs(frequency - 1056.0) <= 1.0
    assert abs(height / 0.676e-6 - 1.0) < 0.01
