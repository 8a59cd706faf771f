"""
From hits of a hammer to the best cuts
======================================

Five hits along X and five along Y, one of them a double hit, are recorded at the tip of a tool. They become
receptances with coherence, the receptances become lobes, and the lobes a list of cuts, the one that removes most
first.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import rcsa_ident as ri
from rcsa_ident.base.units import to_hz, to_rpm

rate, rng = 51_200.0, np.random.default_rng(1)
modes = {"x": ((800.0, 0.03, 0.25), (1900.0, 0.02, 0.09)), "y": ((870.0, 0.035, 0.22), (2100.0, 0.02, 0.1))}  # Hz, -, kg


def true(axis: str, omega: np.ndarray) -> np.ndarray:
    """Return the receptance [m/N] of the structure that is hit."""
    return sum(1.0 / (m * (ri.hz(f) ** 2 - omega**2 + 2j * z * ri.hz(f) * omega)) for f, z, m in modes[axis])


def hits(axis: str, starts: list[float]) -> np.ndarray:
    """Return time, force and acceleration of half sines of 0.3 ms at these instants, with a little noise."""
    time = np.arange(int(5 * 0.6 * rate)) / rate
    force = sum(np.where((time > s) & (time < s + 3e-4), 180.0 * np.sin(np.pi * (time - s) / 3e-4), 0.0) for s in starts)
    omega = 2.0 * np.pi * np.fft.rfftfreq(4 * time.size, 1.0 / rate)
    motion = np.fft.irfft(-(omega**2) * true(axis, omega) * np.fft.rfft(force, 4 * time.size))[: time.size]
    return np.stack([time, force + 0.05 * rng.standard_normal(time.size), motion + 0.3 * rng.standard_normal(time.size)], axis=1)


# %%
# The recordings are text tables; channels are told apart by themselves, and the double hit is left out.
with tempfile.TemporaryDirectory() as folder:
    for axis, double in (("x", []), ("y", [0.025])):
        table = hits(axis, [0.02 + 0.6 * k for k in range(5)] + double)
        np.savetxt(f"{folder}/{axis}.csv", table, delimiter=",", header="time (s),hammer (N),tip (m/s^2)", comments="")
        found = ri.tap(f"{folder}/{axis}.csv", axis=axis.upper())
        print(found)
        found.save(Path(folder) / f"{axis}.frf")
    tip = ri.read_tap_tests(x=f"{folder}/x.frf", y=f"{folder}/y.frf")

# %%
# Lobes and recommended cuts need the cutter alone, and what it cuts.
cut = ri.MillingProcess(ri.Cutter(4, 0.012), ri.material("5A06 aluminium").coefficients, ri.Engagement.from_immersion(0.5, "down"))
lobes = ri.stability_lobes(tip, cut, ri.rpm(4000, 20_000, 25), max_depth=6e-3)
best = lobes.best_speeds()[0]
print(best)

# %%
# Above: measured and true. Below: where the tool may cut.
fig, (top, bottom) = plt.subplots(2, 1, figsize=(7.2, 5.6), layout="constrained")
inside = (tip.omega > ri.hz(300.0)) & (tip.omega < ri.hz(3000.0))
frequency = to_hz(tip.omega[inside])
for axis in "xy":
    h = tip.between(f"tip.{axis}", f"tip.{axis}")[inside]
    top.semilogy(frequency, 1e6 * np.abs(true(axis, tip.omega[inside])), color="0.75", lw=4.0)
    top.semilogy(frequency, 1e6 * np.abs(h), label=f"{axis.upper()}, measured")
top.set(xlabel="frequency [Hz]", ylabel="receptance [µm/N]", title="Tap tests (grey: true)")
top.legend()
bottom.plot(to_rpm(lobes.spindle_speed), 1e3 * lobes.limit_depth, color="C2", label="stability limit")
bottom.plot(to_rpm(best.spindle_speed), 1e3 * best.limit_depth, "k*", ms=11, label="highest pocket")
bottom.set(xlabel="spindle speed [rev/min]", ylabel="axial depth [mm]", ylim=(0.0, 6.5), title="Stability lobes")
bottom.legend(loc="upper left")

# %%
# Between 300 and 3000 Hz the measured receptances are those of the structure to a percent.
errors = []
for axis in "xy":
    expected = true(axis, tip.omega[inside])
    errors.append(np.linalg.norm(tip.between(f"tip.{axis}", f"tip.{axis}")[inside] - expected) / np.linalg.norm(expected))
print("error:", [f"{100 * each:.2f} %" for each in errors])
assert max(errors) < 0.01
