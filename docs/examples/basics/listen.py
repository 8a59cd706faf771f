"""
Listen to one recording
=======================

A phone beside the machine records four teeth at 6000 rev/min that chatter. Without any setting but the number of
teeth, the sound tells the true spindle speed, the verdict, the chatter frequency, and the speeds that would put whole
waves between two teeth.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.io import wavfile

import rcsa_ident as ri
from rcsa_ident.base.units import to_rpm

# %%
# The sound is made up: orders of a spindle that wanders a little, a chatter line at 1234.5 Hz, noise.
rate, rng = 22_050, np.random.default_rng(1)
time = np.arange(4 * rate) / rate
angle = 2.0 * np.pi * 99.7 * (time + 2e-5 * np.sin(2.0 * np.pi * 0.7 * time))
signal = sum(a * np.cos(m * angle + m) for m, a in {1: 0.03, 4: 0.15, 8: 0.1, 12: 0.04}.items())
signal += 0.12 * np.cos(2.0 * np.pi * 1234.5 * time) + 0.02 * rng.standard_normal(time.size)
with tempfile.TemporaryDirectory() as folder:
    wavfile.write(Path(folder) / "cut.wav", rate, signal.astype(np.float32))
    heard = ri.listen(Path(folder) / "cut.wav", teeth=4)
print(heard)
print("speeds to try [rev/min]:", [round(to_rpm(each)) for each in heard.suggested_speeds])

# %%
# The spectrum over the orders of the speed that was heard: tooth passing at 4, 8, 12, and one line between them.
window = np.hanning(signal.size)
spectrum = 2.0 * np.abs(np.fft.rfft(signal * window)) / window.sum()
order = np.fft.rfftfreq(signal.size, 1.0 / rate) / (heard.spindle_speed / (2.0 * np.pi))
fig, ax = plt.subplots(layout="constrained")
ax.semilogy(order, spectrum, lw=0.8)
for tooth in (4, 8, 12):
    ax.axvline(tooth, color="0.75", lw=5, zorder=0)
place = heard.chatter[0] / (heard.spindle_speed / (2.0 * np.pi))
ax.annotate(
    f"chatter\n{heard.chatter[0]:.1f} Hz", (place, 0.12), (place + 1.0, 0.15), color="C1", arrowprops={"arrowstyle": "->", "color": "C1"}
)
ax.set(xlabel="order of the spindle frequency [-]", ylabel="amplitude [of full scale]", xlim=(0, 18), ylim=(1e-5, 0.5))
ax.set_title(f"{heard}; grey: tooth passing")

# %%
# The speed is right to 0.2 rev/min, the chatter frequency to half a hertz.
assert heard.verdict == "chatter"
assert abs(to_rpm(heard.spindle_speed) - 5982.0) < 0.2
assert abs(heard.chatter[0] - 1234.5) < 0.5
