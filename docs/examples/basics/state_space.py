"""
Active damping designed with python-control
===========================================

The tip's modes leave as a state space, an actuator there feeds the filtered velocity back in both directions, and the
closed loop comes back as modes that every lobe method takes. A force -c v on a mode adds c / (2 m ω) to its damping
ratio.
"""

import control
import matplotlib.pyplot as plt
import numpy as np

import rcsa_ident as ri
from rcsa_ident.base.units import to_rpm

natural, zeta, mass, added = ri.hz(922.0), 0.011, 0.03993, 0.03
tip = (ri.Coordinate("tip", ri.Dof.X), ri.Coordinate("tip", ri.Dof.Y))
machine = ri.normal_modes([natural, natural], [zeta, zeta], np.eye(2) / np.sqrt(mass), tip)

# %%
# From displacement to force c s / (1 + s / corner): a damper whose actuator follows up to its corner.
damper, corner = 2.0 * mass * natural * added, 20.0 * natural
feedback = control.ss(control.tf([damper, 0.0], [1.0 / corner, 1.0]))
bare = ri.TipModes.joined([machine.pole_residue()])
damped = ri.TipModes.from_control(control.feedback(machine.to_control(), control.append(feedback, feedback)))

cut = ri.MillingProcess(ri.Cutter(2, diameter=0.012), ri.CuttingCoefficients(6e8, 1.0 / 3.0), ri.Engagement.from_immersion(0.5, "down"))
speeds, exact = ri.rpm(1.0) * np.array([6000.0, 9000.0, 13_000.0]), ri.FullDiscretisation()
lobes = [ri.stability_lobes(each, cut, ri.rpm(5000, 20_000, 25), 5e-3) for each in (bare, damped)]
limits = [ri.stability_lobes(each, cut, speeds, 5e-3, exact).limit_depth for each in (bare, damped)]

# %%
# Lobes by the zero-order method, dots by full discretisation.
fig, ax = plt.subplots(layout="constrained")
for each, points, name in zip(lobes, limits, ("bare, damping ratio 1.1 %", "with the actuator, 4.1 %"), strict=True):
    (line,) = ax.plot(to_rpm(each.spindle_speed), 1e3 * each.limit_depth, label=name)
    ax.plot(to_rpm(speeds), 1e3 * points, "o", color=line.get_color())
ax.set(xlabel="spindle speed [rev/min]", ylabel="stability limit [mm]", ylim=(0.0, 2.2), title="Half-immersion down-milling")
ax.legend(loc="upper left")

# %%
# The closed loop is H / (1 + K H), its damping the sum of both, and the lowest limit, nearly proportional to damping, rises with it.
omega = natural * np.linspace(0.1, 3.0, 200)
h, k = machine.receptance(omega).values[:, 0, 0], 1j * omega * damper / (1.0 + 1j * omega / corner)
np.testing.assert_allclose(damped.response(omega)[:, 0, 0], h / (1.0 + k * h), rtol=1e-7)
mode = damped.pole[np.argmax(damped.strength)]
assert abs(-mode.real / abs(mode) / (zeta + added) - 1.0) < 0.01
assert np.all(limits[1] > 1.4 * limits[0])
gain = lobes[1].absolute_limit / lobes[0].absolute_limit
print(f"the lowest limit is {gain:.2f} times as high")
assert abs(gain / ((zeta + added) / zeta) - 1.0) < 0.1
