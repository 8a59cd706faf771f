"""
Which moves of a program chatter
================================

A slot and a pocket are milled out of a block, move by move. What stands around the cutter comes from the stock as the
moves before have left it; every move then has its margin to chatter, and below one it chatters. The part is coloured
by the margin of the moves that made it.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import rcsa_ident as ri
from rcsa_ident.io.paths.tool_paths import read_tool_path
from rcsa_ident.report.part import save_coloured_part
from rcsa_ident.setup.tooling import BareCutter
from rcsa_ident.workflows.paths.removal import field_of, remove_along
from rcsa_ident.workflows.paths.stability import cuts_along, stations_along
from rcsa_ident.workflows.tool_change import ToolChange

# %%
# The program: a full slot along the middle, 6 mm deep, then both sides of the pocket 1.6 mm at a time.
program = """G21 G90
S8000 M3
G0 X-7 Y20 Z5
G1 Z-6 F1200
X48
Y18.4
X12
Y21.6
X48
Y16.8
X12
Y23.2
X48
Y20
G0 Z5
M30
"""
with tempfile.TemporaryDirectory() as folder:
    (Path(folder) / "pocket.nc").write_text(program, encoding="utf-8")
    path = read_tool_path(Path(folder) / "pocket.nc")

# %%
# A tip with one mode a direction, two teeth of Ø10 mm, aluminium; the block measures 60 by 40 by 10 mm.
modes = {}
for axis, hertz, kilogram in ((ri.Dof.X, 922.0, 0.5), (ri.Dof.Y, 1300.0, 0.4)):
    modes[axis] = ri.normal_modes([ri.hz(hertz)], [0.03], [[kilogram**-0.5]], (ri.Coordinate("tip", axis),))
machine = ri.KnownTip(ri.TipModes.of(modes))
tool = BareCutter("end mill", ri.Cutter(2, 0.01, np.radians(30.0)))
removal = remove_along(tool, path, field_of(tool, (np.array([0.0, 0.0, -0.01]), np.array([0.06, 0.04, 0.0]))), 1e-3)
print(removal)

cut = ri.CutSpec(feed_per_tooth=5e-5, coefficients={"tangential": 8e8, "radial_ratio": 0.3})
change = ToolChange(machine, tool, cut, np.array([ri.rpm(8000)]), 15e-3, ri.FullDiscretisation(), 0)
judged = cuts_along(change, removal.path, removal.engagement, stations_along(machine, tool, removal.path))

# %%
# The slot, immersed in full, is what chatters.
with tempfile.TemporaryDirectory() as folder:
    picture = Path(folder) / "part.png"
    save_coloured_part(picture, removal.part, removal.path, judged.margin, "margin to chatter [-]", (0.5, 1.5), 0.005)
    image = plt.imread(picture)
fig, ax = plt.subplots(figsize=(11.0, 4.8), layout="constrained")
ax.imshow(image)
ax.set_axis_off()

# %%
# Inside the block the slot is a cut like any other: its margin is that of the lobes.
slot = ri.MillingProcess(tool.cutter, ri.CuttingCoefficients(8e8, 0.3), ri.Engagement(0.0, np.pi))
limit = ri.stability_lobes(ri.TipModes.of(modes), slot, ri.rpm(8000), 15e-3, ri.FullDiscretisation()).limit_depth[0]
x = removal.path.places[:-1, 0]
inside = (removal.path.line[1:] == 5) & (x > 0.01) & (x < 0.04)
print(
    f"slot: limit {1e3 * limit:.2f} mm, margin {np.median(judged.margin[inside]):.2f}; {np.sum(judged.margin < 1.0)} moves of 1 mm chatter"
)
assert abs(np.median(judged.margin[inside]) / (limit / 6e-3) - 1.0) < 0.02
