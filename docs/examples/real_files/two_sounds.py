"""
Two sounds of a face mill
=========================

Others recorded a face mill with six teeth by a microphone, once chattering and once not
(hafeztrimukti29/chatter-detection-using-accoustic-approach-and-once-per-revolution-variance on GitHub). What does the
first sound advise, and did the second follow it?
"""

import matplotlib.pyplot as plt
import numpy as np
import scipy.signal
from kept import real_files

import rcsa_ident as ri
from rcsa_ident.base.units import to_rpm

address = "https://github.com/hafeztrimukti29/chatter-detection-using-accoustic-approach-and-once-per-revolution-variance"
files = real_files(address, "two_sounds.png", "milling_sound/Chatter.wav", "milling_sound/Stable.wav")
if files:
    heard = [ri.listen(file, teeth=6) for file in files]
    fig, panels = plt.subplots(2, 1, figsize=(7.6, 5.6), layout="constrained")
    for ax, file, each in zip(panels, files, heard, strict=True):
        signal, rate, turn = each.record.loudest, each.record.rate, each.spindle_speed / (2.0 * np.pi)
        frequency, power = scipy.signal.welch(signal, rate, nperseg=int(2 * rate))
        level = 10.0 * np.log10(power / power.max())
        ax.plot(frequency, level, lw=0.8)
        for tooth in 6.0 * turn * np.arange(1, 30):
            ax.axvline(tooth, color="C2", lw=3.0, alpha=0.25, zorder=0)
        for line in each.chatter:
            ax.plot(line, 3.0, "v", color="C1", ms=9, clip_on=False)
        ax.set(xlim=(0, 2500), ylim=(-50, 3), xlabel="frequency [Hz]", ylabel="level [dB]", title=f"{file.name}: {each}")
    panels[0].text(heard[0].chatter[0] + 30.0, -4.0, f"chatter, {heard[0].chatter[0]:.0f} Hz", color="C1")
    panels[1].text(2480, -4.0, "green: tooth passing", color="C2", ha="right")

    advised, second = to_rpm(np.array(heard[0].suggested_speeds)), to_rpm(heard[1].spindle_speed)
    print("speeds to try after the first sound [rev/min]:", np.round(advised).astype(int).tolist())
    print(f"speed of the second: {second:.0f} rev/min, {heard[1].verdict}")
    assert (heard[0].verdict, heard[1].verdict) == ("chatter", "stable")
    assert abs(advised[0] / second - 1.0) < 2e-3
