"""Text recordings in the dialects of devices and programs: written by a generator, and read back to 1e-12 or refused in words.

The layouts are written after manuals and memory, the samples are drawn here: no file of anybody else.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.io.recordings.open_recording import open_recording
from rcsa_ident.io.recordings.readers import read_recording
from rcsa_ident.signals.recording import Quantity, Sensor

RATE, N = 25_600.0, 400
#: A binary fraction, so that times have few decimals.
TIMES = np.arange(N) / RATE
ACCELERATION, FORCE = np.random.default_rng(43).normal(size=(2, N)) * [[30.0], [200.0]]
G = 9.80665
SI = {"m/s²": 1.0, "g": G, "N": 1.0, "kN": 1e3, "V": 1.0, "mV": 1e-3, "um": 1e-6}


def rows(*columns: np.ndarray, delimiter: str = ",", decimal: str = ".", behind: str = "") -> str:
    """Lines of numbers that hold every bit; a text stays as it is."""

    def cell(value: object) -> str:
        return value if isinstance(value, str) else repr(float(value)).replace(".", decimal)

    return "\n".join(delimiter.join(map(cell, row)) + behind for row in zip(*columns, strict=True)) + "\n"


def stamps(form: Callable[[int, int, float], str], start: float = 43_200.0) -> list[str]:
    told = []
    for time in start + TIMES:
        minutes, seconds = divmod(round(time, 7) % 86_400.0, 60.0)
        told.append(form(int(minutes) // 60, int(minutes) % 60, seconds))
    return told


def lvm(columns: str, *, decimal: str = ".", step: tuple[str, str] = ("3.906250E-5", "3.906250E-5")) -> str:
    head = ["LabVIEW Measurement\t", "Writer_Version\t2", f"Decimal_Separator\t{decimal}", f"X_Columns\t{columns}", "***End_of_Header***\t"]
    head += ["\t", "Channels\t2\t", f"Samples\t{N}\t{N}\t", "Y_Unit_Label\tg\tN\t", "X_Dimension\tTime\tTime\t"]
    head += ["X0\t0.0E+0\t0.0E+0\t", f"Delta_X\t{step[0]}\t{step[1]}\t".replace(".", decimal), "***End_of_Header***\t\t\t"]
    if columns == "No":
        names, body = "X_Value\tAcceleration\tForce\tComment", rows([""] * N, ACCELERATION, FORCE, delimiter="\t", decimal=decimal)
    elif columns == "Multi":
        names = "X_Value\tAcceleration\tX_Value\tForce\tComment"
        body = rows(TIMES, ACCELERATION, TIMES, FORCE, delimiter="\t", decimal=decimal, behind="\t")
    else:
        names, body = (
            "X_Value\tAcceleration\tForce\tComment",
            rows(TIMES, ACCELERATION, FORCE, delimiter="\t", decimal=decimal, behind="\t"),
        )
    return "\n".join([*head, names, body])


def tektronix(shift: float = 0.0) -> str:
    """Settings beside the numbers, one block of six columns a channel."""
    settings = [("Record Length", str(N)), ("Sample Interval", "3.90625e-05"), ("Trigger Point", "0"), ("Vertical Units", "V")]
    settings += [("Horizontal Units", "s"), ("Vertical Scale", "0.5")]
    lines = []
    for i in range(N):
        cells = []
        for k, values in enumerate((ACCELERATION, FORCE)):
            source = [*settings, ("Source", f"CH{k + 1}")]
            key, value = source[i] if i < len(source) else ("", "")
            cells += [key, value, "", repr(float(TIMES[i] + k * shift)), repr(float(values[i])), ""]
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"


PLAIN = rows(TIMES, ACCELERATION, FORCE)
BARE = rows(ACCELERATION, FORCE)
NUMBERS = rows(np.arange(N), ACCELERATION, FORCE)
#: Text, and names and units of its two channels.
DIALECTS: dict[str, tuple[str, str, str]] = {
    "brackets": ("Time (s),acc (m/s²),force (N)\n" + PLAIN, "acc m/s²", "force N"),
    "square brackets": ("Time [s],acc [g],force [kN]\n" + PLAIN, "acc g", "force kN"),
    "DIN, behind a stroke": (
        "Zeit / ms;a / m/s²;F / N\n" + rows(1e3 * TIMES, ACCELERATION, FORCE, delimiter=";", decimal=","),
        "a m/s²",
        "F N",
    ),
    "in": ("Time in s,CH1 in V,CH2 in mV\n" + PLAIN, "CH1 V", "CH2 mV"),
    "in milliseconds": ("Time in ms,acc in g,force in N\n" + rows(1e3 * TIMES, ACCELERATION, FORCE), "acc g", "force N"),
    "in, without a name": ("in s,CH1 in V,CH2 in mV\n" + PLAIN, "CH1 V", "CH2 mV"),
    "in quotes, behind a comma": ('"Time, s","acc, g","force, N"\n' + PLAIN, "acc g", "force N"),
    "a line of units": ("Time,acc,force\ns,g,N\n" + PLAIN, "acc g", "force N"),
    "units first": ("s,g,N\nTime,acc,force\n" + PLAIN, "acc g", "force N"),
    "units in brackets": (
        "Time,Channel A,Channel B\n(ms),(mV),(V)\n\n" + rows(1e3 * TIMES, ACCELERATION, FORCE),
        "Channel A mV",
        "Channel B V",
    ),
    "a label before the units": (
        "Kanal;Zeit;Kraft;Weg\nEinheit;s;N;um\n" + rows(TIMES, FORCE, ACCELERATION, delimiter=";", decimal=","),
        "Weg um",
        "Kraft N",
    ),
    "milliseconds": ("time_ms,acc (g),force (N)\n" + rows(1e3 * TIMES, ACCELERATION, FORCE), "acc g", "force N"),
    "microseconds": ("t_us,acc (g),force (N)\n" + rows(1e6 * TIMES, ACCELERATION, FORCE), "acc g", "force N"),
    "nanoseconds": ("Time [ns],acc (g),force (N)\n" + rows(1e9 * TIMES, ACCELERATION, FORCE), "acc g", "force N"),
    "units with a micro sign": ("Time (μs),x (um),force (N)\n" + rows(1e6 * TIMES, ACCELERATION, FORCE), "x um", "force N"),
    "tabs": ("Time (s)\tAI 1 (g)\tAI 2 (N)\n" + rows(TIMES, ACCELERATION, FORCE, delimiter="\t"), "AI 1 g", "AI 2 N"),
    "blanks": ("Time [s] acc [m/s²] force [N]\n" + rows(TIMES, ACCELERATION, FORCE, delimiter="   "), "acc m/s²", "force N"),
    "a preamble": (
        "Data file info\nFile name: C:\\data\\cut, 3.dxd\nSample rate: 25600\nStart time: 1.2.2024 12:00\n\nTime (s)\tAI 1 (g)\tAI 2 (N)\n"
        + rows(TIMES, ACCELERATION, FORCE, delimiter="\t"),
        "AI 1 g",
        "AI 2 N",
    ),
    "LabVIEW": (lvm("One"), "Acceleration g", "Force N"),
    "LabVIEW without times": (lvm("No"), "Acceleration g", "Force N"),
    "LabVIEW, times side by side": (lvm("Multi"), "Acceleration g", "Force N"),
    "LabVIEW, decimal comma": (lvm("One", decimal=","), "Acceleration g", "Force N"),
    "Tektronix, side by side": (tektronix(), "CH1 V", "CH2 V"),
    "Tektronix": (
        "Model,MSO46\nHorizontal Units,s\nHorizontal Scale,4e-05\nSample Interval,3.90625e-05\nRecord Length,400\nVertical Units,V,V\n"
        "Vertical Offset,0,0\n,,\nLabel,,\nTIME,CH1,CH2\n" + PLAIN,
        "CH1 V",
        "CH2 V",
    ),
    "Siglent": (
        "Record Length,Analog:400\nSample Interval,3.90625e-05\nVertical Scale,CH1:0.5\nSource,CH1,CH2\nSecond,Volt,Volt\n" + PLAIN,
        "Volt Volt",
        "Volt Volt",
    ),
    "Rigol": ("X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,-6.0e-03,3.906250e-05\n" + NUMBERS, "CH1 Volt", "CH2 Volt"),
    "Rigol, by one line": ("Time(s),CH1(V),CH2(V),t0 = 0s, tInc = 3.906250e-05,\n" + PLAIN, "CH1 V", "CH2 V"),
    "Keysight": ("x-axis,1,2\nsecond,Volt,Volt\n" + PLAIN, "1 Volt", "2 Volt"),
    "LeCroy": (
        "LECROYWS3024,12345,Waveform\nSegments,1,SegmentSize,400\nSegment,TrigTime,TimeSinceSegment1\n#1,01-Feb-2024 12:00:00,0\n"
        "Time,acc (V),force (V)\n" + PLAIN,
        "acc V",
        "force V",
    ),
    "DynoWare": ("DynoWare\nSampling rate [Hz]:,25600\nCycles:,1\nCycle No:,1\nTime,Ax,Fx\ns,g,N\n" + PLAIN, "Ax g", "Fx N"),
    "ISO 8601": (
        "Timestamp,acc (g),force (N)\n" + rows(stamps(lambda h, m, s: f"2024-02-01T{h:02d}:{m:02d}:{s:010.7f}Z"), ACCELERATION, FORCE),
        "acc g",
        "force N",
    ),
    "a clock": (
        "Time,acc (g),force (N)\n" + rows(stamps(lambda h, m, s: f"{h:02d}:{m:02d}:{s:010.7f}"), ACCELERATION, FORCE),
        "acc g",
        "force N",
    ),
    "past midnight": (
        "Uhrzeit;acc (g);force (N)\n"
        + rows(
            stamps(lambda h, m, s: f"01.02.2024 {h:02d}:{m:02d}:{s:010.7f}".replace(".", ",").replace("01,02,", "01.02."), 86_399.995),
            ACCELERATION,
            FORCE,
            delimiter=";",
            decimal=",",
        ),
        "acc g",
        "force N",
    ),
    "before and after noon": (
        "Time,acc (g),force (N)\n"
        + rows(
            stamps(lambda h, m, s: f"2/1/2024 {(h - 1) % 12 + 1}:{m:02d}:{s:010.7f} {'PM' if h >= 12 else 'AM'}", 43_199.995),
            ACCELERATION,
            FORCE,
        ),
        "acc g",
        "force N",
    ),
    "minutes and seconds": (
        "Time,acc (g),force (N)\n" + rows(stamps(lambda h, m, s: f"{m:02d}:{s:010.7f}"), ACCELERATION, FORCE),
        "acc g",
        "force N",
    ),
    "date and clock between blanks": (
        "date_time acc [g] force [N]\n"
        + rows(stamps(lambda h, m, s: f"2024-02-01 {h:02d}:{m:02d}:{s:010.7f}"), ACCELERATION, FORCE, delimiter=" "),
        "acc g",
        "force N",
    ),
    "a column of dates": (
        "Date,Time,acc (g),force (N)\n"
        + rows(["2024-02-01"] * N, stamps(lambda h, m, s: f"{h:02d}:{m:02d}:{s:010.7f}"), ACCELERATION, FORCE),
        "acc g",
        "force N",
    ),
    "sample numbers and a rate": ("Sampling rate: 25600 Hz\nSample,acc (g),force (N)\n" + NUMBERS, "acc g", "force N"),
    "times that count samples": ("Sampling rate: 25600 Hz\nTime,acc (g),force (N)\n" + NUMBERS, "acc g", "force N"),
    "times in a unit that the rate tells": (
        "Sampling rate: 25600 Hz\nTime,acc (g),force (N)\n" + rows(1e3 * TIMES, ACCELERATION, FORCE),
        "acc g",
        "force N",
    ),
    "a rate in a comment": ("# Sampling rate: 25.6 kHz\nacc (g),force (N)\n" + BARE, "acc g", "force N"),
    "delimiters behind the last cell": (
        "Time (s);acc (g);force (N)\n" + rows(TIMES, ACCELERATION, FORCE, delimiter=";", behind=";;"),
        "acc g",
        "force N",
    ),
    "names of channels that are numbered": ("Time (s),acc (1),acc (2)\n" + PLAIN, "acc (1) ", "acc (2) "),
}


def check(channels: dict[str, tuple[str, np.ndarray]], acceleration: str, force: str) -> None:
    for told, values in ((acceleration, ACCELERATION), (force, FORCE)):
        name, unit = told.rsplit(" ", 1)
        found, samples = channels[name]
        assert found == unit
        np.testing.assert_allclose(samples, SI.get(unit, 1.0) * values, rtol=1e-12)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("name", DIALECTS)
def test_a_dialect_is_read_to_the_last_digit(tmp_path, name, encoding):
    text, *told = DIALECTS[name]
    path = tmp_path / "record.txt"
    path.write_text(text, encoding=encoding)
    found = open_recording(path)
    assert found.rate == pytest.approx(RATE, rel=1e-9)
    assert len(found.channels) == 2
    if told[0] == told[1]:  # two columns of one name
        for channel, values in zip(found.channels, (ACCELERATION, FORCE), strict=True):
            assert (channel.name, channel.unit) == tuple(told[0].split())
            np.testing.assert_allclose(channel.samples, values, rtol=1e-12)
    else:
        check({each.name: (each.unit, each.samples) for each in found.channels}, *told)


def sensor(told: str) -> Sensor:
    name, unit = told.rsplit(" ", 1)
    quantity = {"N": Quantity.FORCE, "kN": Quantity.FORCE, "um": Quantity.DISPLACEMENT}.get(unit, Quantity.ACCELERATION)
    return Sensor(name, quantity, Dof.X, 0.1 if unit in ("V", "mV", "Volt") else 1.0)


@pytest.mark.parametrize("name", [name for name, (_, *told) in DIALECTS.items() if told[0] != told[1]])
def test_a_campaign_reads_a_dialect_as_well(tmp_path, name):
    """A wrong rate of the campaign does not count where the file tells its own."""
    text, *told = DIALECTS[name]
    path = tmp_path / "record.csv"
    path.write_text(text, encoding="utf-8")
    found = read_recording(path, tuple(map(sensor, told)), 51_200.0)
    assert found.rate == pytest.approx(RATE, rel=1e-9)
    for k, values in enumerate((ACCELERATION, FORCE)):
        unit = told[k].rsplit(" ", 1)[1]
        np.testing.assert_allclose(found.samples[:, k], SI.get(unit, 1.0) * values / sensor(told[k]).sensitivity, rtol=1e-12)


@pytest.mark.parametrize("name", ["flange_x", "flange_x (um)"])
def test_a_campaign_calls_a_channel_with_its_unit_or_without(tmp_path, name):
    """Before, a header of one line counted as names alone: micrometres were metres, and the file's own times nothing."""
    path = tmp_path / "record.csv"
    path.write_text("Time (s),flange_x (um)\n" + rows(TIMES, ACCELERATION))
    found = read_recording(path, (Sensor(name, Quantity.DISPLACEMENT, Dof.X),), 51_200.0)
    assert found.rate == RATE
    np.testing.assert_allclose(found.samples[:, 0], 1e-6 * ACCELERATION, rtol=1e-12)


RATES = {
    "2.56E+04 Hz": 25_600.0,
    "25600": 25_600.0,
    "25,600 Hz": 25_600.0,
    "25 600 Hz": 25_600.0,
    "25'600 Hz": 25_600.0,
    "1,025,600.5 Hz": 1_025_600.5,
    "25.6 kS/s": 25_600.0,
    "25.6kHz": 25_600.0,
    "25,6 kHz": 25_600.0,
    "0.0256 MS/s": 25_600.0,
    "25600 samples/s": 25_600.0,
    "25600 samples per second": 25_600.0,
    "25600 Sa/s, 16 bit": 25_600.0,
    "51200.0 Hz (per channel)": 51_200.0,
}
WORDS = [
    "Sampling rate: {}",
    "Sample Rate = {}",
    "sampling frequency\t{}",
    "Fs = {}",
    "fs={}",
    "Abtastrate;{}",
    "# Scan rate: {}",
    "SampleRate {}",
]


@pytest.mark.parametrize("number", RATES)
@pytest.mark.parametrize("words", WORDS)
def test_a_rate_is_read_as_it_is_written(tmp_path, words, number):
    path = tmp_path / "record.txt"
    path.write_text(words.format(number) + "\nSampling rate divider: 1\nacc (g)\tforce (N)\n" + rows(ACCELERATION, FORCE, delimiter="\t"))
    assert open_recording(path).rate == pytest.approx(RATES[number], rel=1e-12)


@pytest.mark.parametrize(
    ("line", "rate"),
    [
        ("Sampling rate CH1 [Hz]: 25600", 25_600.0),
        ("CH1 [Hz]: 25600", 25_600.0),
        ("Sampling rate [kHz],25.6,25.6", 25_600.0),
        ("sampling_rate_hz: 25600", 25_600.0),
        ("Max. sampling rate: 102400 Hz\nSampling rate: 25600 Hz", 25_600.0),
        ("Samples per second: 25600", 25_600.0),
        ("Fréquence d'échantillonnage : 25600 Hz", 25_600.0),
        ("Frecuencia de muestreo: 25.6k", 25_600.0),
        ("Sampling interval: 3.90625E-05 s", 25_600.0),
        ("Sample Interval,39.0625 us", 25_600.0),
        ("dt = 0.0390625 ms", 25_600.0),
        ("delta t [ms]: 0.0390625", 25_600.0),
        ("X Increment: 2.267574e-05", 44_100.0),
        ("Sampling period: 3 ms", 1000.0 / 3.0),
        ("time step: 0.01", 100.0),
    ],
)
def test_an_interval_and_a_channel_s_rate(tmp_path, line, rate):
    path = tmp_path / "record.csv"
    path.write_text(f"{line}\nacc (g),force (N)\n{BARE}")
    assert open_recording(path).rate == pytest.approx(rate, rel=1e-12)


@pytest.mark.parametrize(
    ("line", "decimal", "rate"),
    [("Abtastrate: 25.600 Hz", ",", 25_600.0), ("Abtastrate: 25,6 kHz", ",", 25_600.0), ("Sampling rate: 25.600 Hz", ".", 25.6)],
)
def test_the_decimal_sign_of_the_table_is_that_of_the_lines_above(tmp_path, line, decimal, rate):
    path = tmp_path / "record.txt"
    path.write_text(f"{line}\nacc (g);force (N)\n{rows(ACCELERATION, FORCE, delimiter=';', decimal=decimal)}")
    assert open_recording(path).rate == pytest.approx(rate, rel=1e-12)


def test_whole_numbers_in_front_hide_no_decimal_comma(tmp_path):
    path = tmp_path / "record.txt"
    path.write_text("fs = 1000\na (g);b (N)\n0;1\n1;2\n0,5;3\n2;4,5\n")
    assert [each.samples.tolist() for each in open_recording(path).channels] == [[0.0, G, 0.5 * G, 2.0 * G], [1.0, 2.0, 3.0, 4.5]]


@pytest.mark.parametrize("gap", ["1,7", ""])
def test_a_row_with_decimal_commas_above_the_table_is_no_header_that_comes_again(tmp_path, gap):
    """Found by fuzzing: a row above the table by itself, also one with an empty cell, was taken for a header, and none was left."""
    path = tmp_path / "record.txt"
    path.write_text(f"a;b;c\n0,002;{gap};2\nnote\n0,002;{gap};2\n0,002;{gap};2\n0,003;1,8;3\n")
    found = {each.name: each.samples for each in open_recording(path, default_rate=1000.0).channels}
    np.testing.assert_array_equal(found["a"], [0.002, 0.002, 0.003])
    np.testing.assert_array_equal(found["b"], [1.7, 1.7, 1.8] if gap else [np.nan, np.nan, 1.8])
    np.testing.assert_array_equal(found["c"], [2.0, 2.0, 3.0])


def test_a_row_that_ends_before_its_date_is_read(tmp_path):
    """Found by fuzzing."""
    (tmp_path / "record.csv").write_text("clock,acc (g),day\n0:00:01,1,2024-01-01\n0:00:02,2\n0:00:03,4,2024-01-01\n")
    opened = open_recording(tmp_path / "record.csv")
    assert (opened.rate, opened.channels[0].samples.tolist()) == (1.0, [G, 2.0 * G, 4.0 * G])


def test_a_line_of_quotes_alone_says_nothing(tmp_path):
    """Found by fuzzing: between blanks such a line has no cell."""
    (tmp_path / "record.txt").write_text('"\n1.,\n1\n3\n')
    assert open_recording(tmp_path / "record.txt", default_rate=1000.0).channels[0].samples.tolist() == [1.0, 1.0, 3.0]


def test_empty_cells_are_lost_samples_and_no_row_goes(tmp_path):
    path = tmp_path / "record.csv"
    path.write_text("Time (s),acc (m/s²),slow (N)\n0,1,\n0.001,2,\n0.002,3,7\n0.003,,8\n")
    found = open_recording(path)
    np.testing.assert_array_equal(found.channels[0].samples, [1.0, 2.0, 3.0, np.nan])
    np.testing.assert_array_equal(found.channels[1].samples, [np.nan, np.nan, 7.0, 8.0])


def test_one_column_is_a_recording(tmp_path):
    path = tmp_path / "record.txt"
    path.write_text("Sampling rate: 25600 Hz\nacc (g)\n" + rows(ACCELERATION))
    found = open_recording(path)
    assert (found.rate, found.channels[0].name) == (RATE, "acc")
    np.testing.assert_allclose(found.channels[0].samples, G * ACCELERATION, rtol=1e-12)


REMARKS = {
    "samples are counted": (DIALECTS["sample numbers and a rate"][0], "column Sample counts samples and was left out"),
    "times are counted": (DIALECTS["times that count samples"][0], "column Time counts samples and was left out"),
    "milliseconds": (DIALECTS["times in a unit that the rate tells"][0], "Time has no unit: milliseconds are assumed"),
    "two rates": ("Sampling rate: 25600 Hz\nSample rate 2: 51200 Hz\nacc,force\n" + BARE, "25600 Hz, 51200 Hz: the first one counts"),
    "times against a rate": ("Sampling rate: 51200 Hz\nTime (s),acc,force\n" + PLAIN, "the times give 25600 Hz"),
    "no names": ("Rig 4\nSampling rate: 25600 Hz\n" + rows(ACCELERATION, FORCE, delimiter="\t"), "names their 2 columns"),
    "no unit": ("Date: today\nTime,acc,force\n" + PLAIN, "Time has no unit"),
}


@pytest.mark.parametrize("name", REMARKS)
def test_what_is_assumed_is_said(tmp_path, name):
    text, words = REMARKS[name]
    path = tmp_path / "record.txt"
    path.write_text(text)
    found = open_recording(path)
    assert found.rate == pytest.approx(RATE)
    assert any(words in remark for remark in found.remarks), found.remarks


REFUSED = {
    "a unit of time": ("Time (furlongs),acc (g),force (N)\n" + PLAIN, "unit of column Time: found furlongs, allowed is s, ms, us, ns"),
    "a unit of a rate": ("Sampling rate: 25600 rpm\nacc,force\n" + BARE, "sampling_rate_hz: found 25600 rpm, allowed is a number in Hz"),
    "a rate of zero": ("Sampling rate: 0 Hz\nacc,force\n" + BARE, "sampling_rate_hz: found 0 Hz"),
    "rates of channels": ("Sampling rate [Hz],25600,51200\nacc,force\n" + BARE, "found 25600, 51200 of several channels"),
    "no rate": ("acc (g),force (N)\n" + BARE, "sampling_rate_hz: found nothing"),
    "sample numbers alone": ("Sample,acc (g),force (N)\n" + NUMBERS, "sampling_rate_hz: found nothing, and column Sample counts samples"),
    "a first column that counts": ("k,acc (g),force (N)\n" + NUMBERS, "sampling_rate_hz: found nothing"),
    "numbers in quotes": (
        "Sampling rate: 25600\nacc (g),force (N)\n" + rows(*([f'"{v:.3f}"'.replace(".", ",") for v in c] for c in (ACCELERATION, FORCE))),
        "no two lines of numbers",
    ),
    "fewer names than columns": ("Sampling rate: 25600\nacc,force\n" + PLAIN, "found 2 in 'acc force' above 3 columns of numbers"),
    "more names than columns": ("Sampling rate: 25600\nacc,force,x,y\n" + BARE, "found 4 in 'acc force x y' above 2 columns"),
    "times of two clocks": (tektronix(shift=1e-6), "channels that were sampled together"),
    "a word among the numbers": ("fs = 100\nacc\tforce\n" + rows(ACCELERATION, FORCE, delimiter="\t") + "over\t1\n", "2 numbers"),
    "two decimal signs": ("fs = 100\nacc;force\n1,5;2,5\n2,5;1,5\n2,5;1.250,5\n", "2 numbers"),
    "thousands": ("fs = 100\nacc\tforce\n1,250.5\t2\n1,300.5\t3\n1,400.5\t3\n", "no two lines of numbers"),
    "a clock that stops": ("Time,acc (g)\n12:00:00.0,1\n12:00:00.1,2\nlater,3\n", "found later, allowed is a clock as h:m:s"),
    "no numbers": ("Time,acc\nnone,at all\n", "no two lines of numbers"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_understood_is_refused_by_its_words(tmp_path, name):
    text, words = REFUSED[name]
    path = tmp_path / "record.txt"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        open_recording(path)
    assert words in str(caught.value)
    assert "record.txt" in str(caught.value)


def test_a_campaign_s_rate_stands_in_for_sample_numbers(tmp_path):
    path = tmp_path / "record.csv"
    path.write_text("Rig: 4\nSample,acc (g),force (N)\n" + NUMBERS)
    found = read_recording(path, (Sensor("acc", Quantity.ACCELERATION, Dof.X),), RATE)
    assert found.rate == RATE
    np.testing.assert_allclose(found.samples[:, 0], G * ACCELERATION, rtol=1e-12)
