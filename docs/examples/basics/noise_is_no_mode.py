"""
Noise is no mode
================

Methods that march from tooth to tooth want the tip's modes, and a fit makes them of a tap test. A fit that is not told of the
noise makes modes of it, too: dozens of them, lightly damped, and each may chatter. What noise there is the lines tell themselves,
since it changes from one line to the next and a tool does not.
"""

import matplotlib.pyplot as plt
import numpy as np

import rcsa_ident as ri
from rcsa_ident.base.units import to_hz, to_rpm

# %%
# Three modes, and the same tip as an accelerometer shows it: noise that is alike at all lines in acceleration grows in the receptance
# towards low frequencies, where the tool does not move.
y = ri.Coordinate("tip", ri.Dof.Y)
exact = ri.TipModes.of(
    {ri.Dof.Y: ri.normal_modes([ri.hz(780.0), ri.hz(1350.0), ri.hz(2900.0)], [0.03, 0.02, 0.03], [[4.5], [3.5], [3.0]], (y,))}
)
omega, rng = ri.hz(80.0, 5000.0, 1.0), np.random.default_rng(1)
values = exact.response(omega)
largest = np.abs(values).max()
noise = 2e-3 * largest * (ri.hz(1000.0) / omega) ** 2 * (rng.standard_normal(omega.size) + 1j * rng.standard_normal(omega.size))
values[:, 1, 1] += noise
tip = (ri.Coordinate("tip", ri.Dof.X), y)
measured = ri.Receptance(omega, values, tip, tip)

# %%
# Limits of both by the same method, and what it says of the fit: the error is that of the lines, noise and all.
cut = ri.MillingProcess(ri.Cutter(3, 0.012), ri.CuttingCoefficients(7e8, 0.3), ri.Engagement.from_immersion(0.5, "down"))
speeds = ri.rpm(5000, 20_000, 500)
true, found = (ri.stability_lobes(each, cut, speeds, 15e-3, ri.FullDiscretisation()) for each in (exact, measured))
for warning in found.warnings:
    print(warning)

# %%
# Above, what was measured; below, both limits.
fig, (top, bottom) = plt.subplots(2, 1, figsize=(7.2, 5.6), layout="constrained")
top.semilogy(to_hz(omega), 1e6 * np.abs(measured.between("tip.y", "tip.y")), lw=0.8, label="measured")
top.semilogy(to_hz(omega), 1e6 * np.abs(exact.response(omega)[:, 1, 1]), color="k", lw=1.2, label="true")
top.set(xlabel="frequency [Hz]", ylabel="receptance [µm/N]", title="A tip, as an accelerometer shows it")
top.legend()
bottom.plot(to_rpm(speeds), 1e3 * true.limit_depth, color="0.75", lw=5.0, label="of the tip's own modes")
bottom.plot(to_rpm(speeds), 1e3 * found.limit_depth, color="C0", lw=1.2, label="of the measured tip")
bottom.set(xlabel="spindle speed [rev/min]", ylabel="stability limit [mm]", ylim=(0.0, None), title="Limits by full discretisation")
bottom.legend(loc="upper left")

# %%
# At all speeds the limits are those of the tip without noise.
error = np.abs(found.limit_depth / true.limit_depth - 1.0)
print(f"limits: {100.0 * error.max():.2f} % off at most")
assert error.max() < 0.01
