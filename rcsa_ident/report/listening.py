"""A figure of a recording and what it says: the signal over time, its spectrogram with the tooth orders, its spectrum over orders."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import to_hz, to_rpm
from rcsa_ident.report.style import COLOURS, STYLE, TRUTH
from rcsa_ident.signals.listening import Listening
from rcsa_ident.signals.recording import Quantity
from rcsa_ident.signals.spectra import envelope, mean_spectrum, spectrogram

_UNITS = {Quantity.ACCELERATION: "m/s²", Quantity.DISPLACEMENT: "m", Quantity.FORCE: "N", Quantity.SOUND: "of full scale"}
_ORDER, _CHATTER = "#52606d", "#C8501A"
#: Points of the signal that are drawn, orders of the spectrum, columns and decibels of the spectrogram.
_POINTS, _ORDERS, _COLUMNS, _RANGE = 2000, 40, 400, 60.0


def listening_figure(answer: Listening) -> Figure:
    """Draw a recording and what it says. `answer`: with its record. Raises `InputError`: it has none."""
    if answer.record is None:
        raise InputError("record", "none", "what a recording says together with its samples")
    signal, rate, quantity, name = answer.record.loudest, answer.record.rate, answer.record.quantity, answer.record.name
    with mpl.rc_context(STYLE):
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
    width, low, high = envelope(signal, _POINTS)
    ax.fill_between(np.arange(low.size) * width / rate, low, high, color=COLOURS["X"], lw=0.3)
    ax.axvspan(*answer.part, color="#009E73", alpha=0.12, lw=0.0, label="judged")
    ax.set(xlim=(0.0, answer.duration), xlabel="time [s]", ylabel=f"signal [{unit}]", title="signal, and the part that was judged")
    ax.legend(loc="upper right")


def _spectrogram(ax: Axes, signal: FloatArray, rate: float, answer: Listening) -> None:
    step, level = spectrogram(signal, rate, _COLUMNS)
    high = min(answer.band, 0.5 * rate)
    rows = int(high / step) + 1
    level = level[:rows]
    ax.imshow(
        level,
        origin="lower",
        aspect="auto",
        cmap="viridis",
        extent=(0.0, signal.size / rate, 0.0, rows * step),
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
    frequency, amplitude = mean_spectrum(part, rate)
    spindle = None if answer.spindle_speed is None else to_hz(answer.spindle_speed)
    high = answer.band if spindle is None else min(answer.band, _ORDERS * spindle)
    shown = (frequency > 0.2 * (spindle or 0.0)) & (frequency <= high)
    ax.semilogy(frequency[shown] / (spindle or 1.0), amplitude[shown], color=TRUTH, lw=0.7)
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
