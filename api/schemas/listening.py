"""What one recording says, and hits of a hammer."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from api.schemas.common import Answer
from api.schemas.machines import Curve


class ListenEvent(Answer):
    """Something that happens in a recording."""

    event: Literal["entry", "exit", "overload", "drop-out"]
    time_s: float | None = Field(description="Null where it is not told.")


class SignalCurve(Answer):
    """Smallest and largest value of the loudest channel in intervals of equal length."""

    step_s: float
    low: list[float]
    high: list[float]


class SpectrumCurve(Answer):
    """Amplitudes over the judged part; of neighbouring lines the largest."""

    frequency_hz: list[float]
    amplitude: list[float]


class Spectrogram(Answer):
    """Level over time, in rows from the lowest frequency on, in dB below the loudest."""

    duration_s: float
    highest_hz: float
    row_hz: float
    level_db: list[list[int]]


class ListenCurves(Answer):
    """What a page draws of a recording."""

    unit: str
    signal: SignalCurve
    spectrum: SpectrumCurve
    spectrogram: Spectrogram


class ListenAnswer(Answer):
    """What a recording says."""

    recording: str
    channels: list[str] = Field(description="That were listened to.")
    quantity: Literal["acceleration", "sound", "displacement", "force"]
    verdict: Literal["stable", "chatter", "idle", "no cut", "unsteady"]
    reasons: list[str] = Field(description="Sentences: why, and what was taken as given.")
    spindle_speed_rpm: float | None
    spindle_speed_std_rpm: float | None
    other_speeds_rpm: list[float] = Field(description="That may be the spindle's instead.")
    speed_probabilities: list[float] = Field(description="Of the spindle's speed and of the others, in this order.")
    chatter_probability: float | None = Field(description="Of chatter, by the lines beside the orders.")
    speed_wander_percent: float | None
    ramp: tuple[float, float] | None = Field(description="First and last speed where it changes on purpose [rev/min].")
    teeth: int | None = Field(description="As told, or as heard.")
    explained_share: float | None = Field(description="Of the variance, by lines at multiples of the followed speed.")
    folded_orders: bool
    chatter_frequencies_hz: list[float] = Field(description="The structure's.")
    chatter_aliases_hz: list[float] = Field(description="All frequencies that the sampling cannot tell apart from it.")
    chatter_lines_hz: list[float] = Field(description="Other lines beside the orders.")
    suggested_speeds_rpm: list[float] = Field(description="They put whole numbers of tooth passages on the chatter's period.")
    events: list[ListenEvent]
    duration_s: float
    part_s: tuple[float, float] = Field(description="What was judged: the longest stretch that is loud.")
    band_hz: float
    curves: ListenCurves | None = Field(description="Where they are asked for.")


class HitAnswer(Answer):
    """A hit of the hammer."""

    recording: str
    time_s: float
    force_n: float
    left_out: str | None = Field(description="Why; null where it is used.")


class TapAnswer(Answer):
    """A receptance from hits of a hammer."""

    hits: list[HitAnswer]
    used: int
    band_hz: tuple[float, float] = Field(description="As far as the hammer excites.")
    window_decay_per_s: float = Field(description="By which every mode decays faster here; 0 where the responses end by themselves.")
    remarks: list[str] = Field(description="What was taken as given.")
    frequency_hz: list[float] = Field(description="Of neighbouring lines the one with the largest receptance.")
    axes: dict[str, Curve]
    coherence: list[float] | None = Field(description="Null of a single hit.")
