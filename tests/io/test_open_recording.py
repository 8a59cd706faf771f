"""Files of the shapes that recorders write, made here; real ones in `tests/signals/test_real_recordings.py`."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.errors import InputError
from rcsa_ident.io.open_recording import open_recording
from rcsa_ident.signals.recording import Quantity

TIME = np.arange(400) / 2000.0
X, Y = 3.0 * np.sin(300.0 * TIME), 2.0 * np.cos(300.0 * TIME)


def table(columns, delimiter=",", form="{:.9f}"):
    return [delimiter.join(form.format(value) for value in row) for row in zip(*columns, strict=True)]


def written(folder, lines, name="record.csv", encoding="utf-8", end="\n"):
    path = folder / name
    path.write_bytes((end.join(lines) + end).encode(encoding))
    return path


SHAPES = {
    "units in brackets": (["Time (s),Accel X (m/s^2),Accel Y (m/s^2)", *table([TIME, X, Y])], {}),
    "square brackets and g": (["t [ms];a_x [g];a_y [g]", *table([1e3 * TIME, X / 9.80665, Y / 9.80665], ";")], {}),
    "microseconds": (["Time (µs)\tX Axis (m/s²)\tY Axis (m/s²)", *table([1e6 * TIME, X, Y], "\t")], {}),
    "decimal comma": (["Zeit (s);X (m/s^2);Y (m/s^2)", *[line.replace(".", ",") for line in table([TIME, X, Y], ";")]], {}),
    "byte order mark": (["Time (s),X (m/s^2),Y (m/s^2)", *table([TIME, X, Y])], {"encoding": "utf-8-sig"}),
    "quotes": (['"Time (s)","X (m/s^2)","Y (m/s^2)"', *table([TIME, X, Y])], {}),
    "comments": (["# made by a recorder", "# on a Monday", "Time (s),X (m/s^2),Y (m/s^2)", *table([TIME, X, Y])], {}),
    "trailing blanks": ([line + " ," for line in ["Time (s),X (m/s^2),Y (m/s^2)", *table([TIME, X, Y])]], {}),
    "header again": (
        [
            line
            for part in (slice(0, 200), slice(200, 400))
            for line in ["Time (s),X (m/s^2),Y (m/s^2)", *table([TIME[part], X[part], Y[part]])]
        ],
        {},
    ),
    "windows line ends": (["Time (s),X (m/s^2),Y (m/s^2)", *table([TIME, X, Y])], {"end": "\r\n"}),
    "units below the names": (["Recorder,Version 2.5", "Sampling rate [Hz]:,2000", "Time,X,Y", "s,m/s^2,m/s^2", *table([TIME, X, Y])], {}),
    "rate above the table": (["Sampling rate [Hz]: 2000", "X (m/s^2),Y (m/s^2)", *table([X, Y])], {}),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_a_table_tells_itself(tmp_path, shape):
    lines, options = SHAPES[shape]
    opened = open_recording(written(tmp_path, lines, **options))
    assert opened.rate == pytest.approx(2000.0)
    quantity, channels = opened.of()
    assert quantity is Quantity.ACCELERATION
    assert len(channels) == 2
    for channel, expected in zip(channels, (X, Y), strict=True):
        np.testing.assert_allclose(channel.samples, expected, atol=2e-8)


def test_times_that_jitter_by_less_than_a_sample_are_even(tmp_path):
    jitter = 1e-4 * np.random.default_rng(1).uniform(-1.0, 1.0, TIME.size)
    opened = open_recording(written(tmp_path, ["Time (s),X (m/s^2)", *table([TIME + jitter, X])]))
    assert opened.rate == pytest.approx(2000.0, rel=1e-3)
    np.testing.assert_allclose(opened.channels[0].samples, X, atol=1e-8)
    assert any("taken as even" in remark for remark in opened.remarks)


def test_a_table_without_names_has_its_time_in_front(tmp_path):
    opened = open_recording(written(tmp_path, table([TIME, X, Y], " "), "record.txt"))
    assert opened.rate == pytest.approx(2000.0)
    assert any("column 1" in remark for remark in opened.remarks)
    with pytest.raises(InputError, match="told: no unit"):
        opened.of()
    quantity, channels = opened.of(Quantity.FORCE, ["column 2"])
    assert quantity is Quantity.FORCE
    np.testing.assert_allclose(channels[0].samples, X, atol=1e-8)


def test_what_does_not_move_and_what_is_no_motion_is_left_aside(tmp_path):
    lines = ["Time (s),X (m/s^2),Load (%),Fx [N],Indicator", *table([TIME, X, 0.0 * X, 10.0 * Y, np.abs(X)])]
    opened = open_recording(written(tmp_path, lines))
    assert [each.name for each in opened.channels] == ["X", "Fx", "Indicator"]
    assert [each.name for each in opened.of()[1]] == ["X"]
    assert [each.name for each in opened.of(Quantity.FORCE)[1]] == ["Fx"]
    with pytest.raises(InputError, match=r"X \[m/s\^2\]"):
        opened.of(Quantity.FORCE, ["X"])


def test_lost_samples_are_where_they_were(tmp_path):
    keep = np.ones(TIME.size, dtype=bool)
    keep[100:105] = False
    opened = open_recording(written(tmp_path, ["Time (s),X (m/s^2)", *table([TIME[keep], X[keep]])]))
    assert opened.channels[0].samples.size == TIME.size
    assert np.flatnonzero(np.isnan(opened.channels[0].samples)).tolist() == [100, 101, 102, 103, 104]


@pytest.mark.parametrize(
    ("lines", "field"),
    [
        (["X (m/s^2),Y (m/s^2)", *table([X, Y])], "sampling_rate_hz"),
        (["Time (parsec),X (m/s^2)", *table([TIME, X])], "unit of column Time"),
        (["only words", "and more"], "recording"),
        (["Time (s),X (m/s^2)", *table([TIME[::-1], X])], "column Time"),
        (["Time (s),X (m/s^2)", *table([TIME, X]), "0.2,abc"], "recording"),
    ],
)
def test_what_cannot_be_told_is_named(tmp_path, lines, field):
    with pytest.raises(InputError) as found:
        open_recording(written(tmp_path, lines))
    assert found.value.field == field
    assert "record.csv" in str(found.value)
