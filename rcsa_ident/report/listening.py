"""A figure of a recording and what it says: the signal over time, its spectrogram with the tooth orders, its spectrum over orders."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rcsa_ident.arrays import FloatArray
from rcsa_ident.report.figures import _STYLE, _TRUTH, COLOURS
from rcsa_ident.signals.listening import Listening
from rcsa_ident.signals.recording import Quantity
from rcsa_ident.signals.steady_part import hann
from rcsa_ident.units import to_hz, to_rpm

_UNITS = {Quantity.ACCELERATION: "m/s²", Quantity.DISPLACEMENT: "m", Quantity.FORCE: "N", Quantity.SOUND: "of full scale"}
_ORDER, _CHATTER = "#52606d", "#C8501A"
#: Points of the signal that are drawn, orders of the spectrum, and decibels of the spectrogram.
_POINTS, _ORDERS, _RANGE = 2000, 40, 60.0


def listening_figure(samples: FloatArray, rate: float, answer: Listening, quantity: Quantity, name: str = "") -> Figure:
    """Draw a recording and what it says.

    Parameters
    ----------
    samples : array, shape (n, c)
        Those that were judged; the loudest channel is drawn.
    rate : float [Hz]
    answer : Listening
    quantity : Quantity
    name : str
        Of the recording, for the title.
    """
    signal = samples[:, int(np.argmax(samples.var(axis=0)))]
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(8.4, 8.6), layout="constrained")
        top, middle, bottom = figure.subplots(3, 1, height_ratios=(1.0, 1.4, 1.4))
        figure.suptitle(f"{name}\n{_headline(answer)}" if name else _headline(answer), fontsize=11, fontweight="bold")
        _signal(top, signal, rate, answer, _UNITS.get(quantity, ""))
        _spectrogram(middle, signal, rate, answer)
        _orders(bottom, signal, rate, answer, _UNITS.get(quantity, ""))
    return figure


def _headline(answer: Listening) -> str:
    speed = "" if answer.spindle_speed is None else f" at {to_rpm(answer.spindle_speed):.1f} rev/min"
    chatter = f", {answer.chatter[0]:.1f} Hz" if answer.chatter else ""
    return f"{answer.verdict}{speed}{chatter}"


def _signal(ax: Axes, signal: FloatArray, rate: float, answer: Listening, unit: str) -> None:
    width = max(signal.size // _POINTS, 1)
    parts = signal[: signal.size // width * width].reshape(-1, width)
    time = np.arange(parts.shape[0]) * width / rate
    ax.fill_between(time, parts.min(axis=1), parts.max(axis=1), color=COLOURS["X"], lw=0.3)
    ax.axvspan(*answer.part, color="#009E73", alpha=0.12, lw=0.0, label="judged")
    ax.set(xlim=(0.0, answer.duration), xlabel="time [s]", ylabel=f"signal [{unit}]", title="signal, and the part that was judged")
    ax.legend(loc="upper right")


def _spectrogram(ax: Axes, signal: FloatArray, rate: float, answer: Listening) -> None:
    length = int(min(max(0.1 * rate, 64), signal.size))
    starts = np.linspace(0, signal.size - length, min(400, max(signal.size // max(length // 4, 1), 1))).astype(int)
    window = hann(length)
    power = np.array([np.abs(np.fft.rfft((signal[s : s + length] - signal[s : s + length].mean()) * window)) ** 2 for s in starts]).T
    high = min(answer.band, 0.5 * rate)
    rows = int(high * length / rate) + 1
    level = 10.0 * np.log10(power[:rows] + 1e-300)
    ax.imshow(
        level,
        origin="lower",
        aspect="auto",
        cmap="viridis",
        extent=(0.0, signal.size / rate, 0.0, rows * rate / length),
        vmin=level.max() - _RANGE,
        vmax=level.max(),
    )
    ax.grid(visible=False)
    if answer.spindle_speed is not None:
        first, last = answer.ramp or (answer.spindle_speed, answer.spindle_speed)
        teeth = answer.teeth or 1
        for m in range(1, int(high / to_hz(teeth * max(first, last))) + 1):
            ax.plot(answer.part, [to_hz(m * teeth * first), to_hz(m * teeth * last)], color="white", lw=0.7, ls=":", alpha=0.8)
    for frequency in answer.chatter:
        ax.axhline(frequency, color=_CHATTER, lw=1.2)
    ax.set(xlim=(0.0, answer.duration), ylim=(0.0, high), xlabel="time [s]", ylabel="frequency [Hz]")
    ax.set_title(f"spectrogram; dotted: multiples of {'the tooth passing frequency' if answer.teeth else 'the spindle frequency'}")


def _orders(ax: Axes, signal: FloatArray, rate: float, answer: Listening, unit: str) -> None:
    part = signal[int(answer.part[0] * rate) : int(answer.part[1] * rate)]
    length = int(min(2.0 * rate, part.size))
    window = hann(length)
    starts = range(0, part.size - length + 1, max(length // 2, 1))
    parts = [np.abs(np.fft.rfft((part[s : s + length] - part[s : s + length].mean()) * window)) ** 2 for s in starts]
    amplitude = 2.0 * np.sqrt(np.mean(parts, axis=0)) / window.sum()
    frequency = np.arange(amplitude.size) * rate / length
    spindle = None if answer.spindle_speed is None else to_hz(answer.spindle_speed)
    high = answer.band if spindle is None else min(answer.band, _ORDERS * spindle)
    shown = (frequency > 0.2 * (spindle or 0.0)) & (frequency <= high)
    ax.semilogy(frequency[shown] / (spindle or 1.0), amplitude[shown], color=_TRUTH, lw=0.7)
    if spindle is not None:
        teeth = answer.teeth
        for order in range(1, int(high / spindle) + 1):
            passing = teeth is not None and order % teeth == 0
            ax.axvline(
                order, color=COLOURS["X"] if passing else _ORDER, lw=1.0 if passing else 0.3, alpha=0.6 if passing else 0.5, zorder=0
            )
        for each in answer.chatter:
            ax.axvline(each / spindle, color=_CHATTER, lw=1.5, label=f"chatter, {each:.1f} Hz")
        if answer.chatter:
            ax.legend(loc="upper right")
    ax.set_xlabel("frequency [Hz]" if spindle is None else f"order of the spindle, {spindle:.2f} Hz")
    ax.set(ylabel=f"amplitude [{unit}]", title="spectrum of the judged part" + ("; blue: tooth passages" if answer.teeth else ""))
