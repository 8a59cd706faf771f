"""
Twelve recordings of two machining centres
==========================================

Accelerometers on two Hurco machining centres recorded cuts in steel and aluminium, a ramp of the speed, and one run
in the air (Yang51st/Machining-Chatter-Detection-Program on GitHub). Nothing is set: speed, teeth and verdict come out
of each file, and the speed that its name tells stands beside.
"""

import re

import matplotlib.pyplot as plt
import numpy as np
from kept import real_files

import rcsa_ident as ri
from rcsa_ident.base.units import to_rpm

parts = (
    "Di__Aluminum__End_Mill__0p5IN__7000RPM__SKF_UltiFlank_40pct",
    "SRTi__4140SteelCutsAlongX__EBI_F20IN_T100_D0p05IN_4000RPM",
    "SRTi__4140SteelCutsAlongX__EBI_F20IN_T25_D0p125IN_4000RPM",
    "SRTi__4140SteelCutsAlongX__EBI_F20IN_T50_D0p125IN_4000RPM",
    "SRTi__AluminumCutsAlongX__EBI_T100_0p375IN_12000RPM",
    "SRTi__AluminumCutsAlongX__EBI_T100_0p375IN_7000RPMto6000RPM",
    "SRTi__AluminumCutsAlongX__EBI_T50_0p125IN_12000RPM",
    "SRTi__CutsAlongX__EBI_T25_0p25IN_6900RPM",
    "SRTi__CutsAlongX__EBI_T50_0p25IN_6900RPM",
    "SRTi__CutsAlongX__PCB_6000RPM_AirCut",
    "SRTi__CutsAlongX__SKF_Test__EBI_F18IN_T25_D0p125IN_3000RPM_5A_SKF_ON_TABLE",
    "SRTi__CutsAlongX__SKF_Test__SKF_F18IN_T25_D0p125IN_3000RPM_5A_EBI_ON_TABLE",
)
address = "https://github.com/Yang51st/Machining-Chatter-Detection-Program"
files = real_files(address, "hurco.png", *(f"milling_acceleration/HurcoVMX42{part}.csv" for part in parts))
if files:
    heard = [ri.listen(file) for file in files]
    named = np.array([float(re.findall(r"(\d+)RPM", part)[0]) for part in parts])
    ramp = np.array(["to6000" in part for part in parts])
    speed = np.array([to_rpm(each.spindle_speed) for each in heard])
    away = 100.0 * (speed / named - 1.0)

    colours = {"stable": "C2", "chatter": "C1", "idle": "0.5"}
    fig, ax = plt.subplots(figsize=(8.6, 4.6), layout="constrained")
    rows = np.flatnonzero(~ramp)
    for row, k in enumerate(rows):
        share = heard[k].explained_share
        ax.barh(row, away[k], color=colours[str(heard[k].verdict)])
        ax.text(0.01, row, f"{heard[k].verdict}, orders explain {100 * share:.0f} %", va="center", fontsize=8)
    ax.set(yticks=range(rows.size), yticklabels=[parts[k].split("__")[-1][:34] for k in rows])
    ax.tick_params(axis="y", labelsize=8)
    ax.set(xlabel="true speed over programmed speed, minus 1 [%]", xlim=(-0.27, 0.2), title="Heard without any setting")
    ax.invert_yaxis()

    verdicts = [str(each.verdict) for each in heard]
    print({verdict: verdicts.count(verdict) for verdict in colours})
    print("the ramp runs from {:.0f} to {:.0f} rev/min".format(*to_rpm(np.array(heard[5].ramp))))
    assert [parts[k].split("__")[-1] for k, each in enumerate(verdicts) if each == "chatter"] == ["EBI_T50_0p25IN_6900RPM"]
    assert [parts[k].split("__")[-1] for k, each in enumerate(verdicts) if each == "idle"] == ["PCB_6000RPM_AirCut"]
    assert np.all(np.abs(away[~ramp]) < 0.25)
