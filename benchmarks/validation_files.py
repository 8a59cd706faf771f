"""What others recorded and published: tap tests, labelled cuts, hits, recordings of cuts, a dynamometer, hits on a holder.

The files lie beside the project, not in it (`benchmarks.real_files.FILES`).
"""

from __future__ import annotations

import re
import tempfile
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import dynamometer, labelled_cuts, real_files, real_machine, recordings
from benchmarks.validation_case import Case, Measure
from rcsa_ident.base.units import to_hz, to_rpm
from rcsa_ident.io.recordings.open_recording import open_recording
from rcsa_ident.io.recordings.readers import read_cut
from rcsa_ident.io.settings.setups import read_campaign
from rcsa_ident.io.uff import read_uff
from rcsa_ident.signals.listening import Heard, Listening
from rcsa_ident.signals.tap import tap
from rcsa_ident.workflows.calibrate import calibrate
from tests.signals.test_real_recordings import CUTS as CUTS_HEARD

FILES = real_files.FILES
FACE_MILL = "facemill_x.frf, facemill_y.frf (github.com/leekunhwee/Dynamics)"
CUTS = "labelled_cuts_118.csv, labelled_cuts_training_40.csv (github.com/gengxiangc/BSLD)"
HAMMER = "{} (github.com/leekunhwee/Vibration-Signal-Processing)"
CUT_FILES = "{} (github.com/Yang51st/Machining-Chatter-Detection-Program)"
SOUNDS = "{} (github.com/hafeztrimukti29/chatter-detection-using-accoustic-approach-and-once-per-revolution-variance)"
FORCES = "6-n6000f300|900|1500ap3ae25.csv (github.com/leekunhwee/ForceCalculation)"
#: Part of a file's name: what was recorded, as its name or its authors say.
RECORDED = {
    "HurcoVMX42Di__Aluminum__End_Mill__0p5IN__7000RPM__SKF_UltiFlank_40pct": Heard.STABLE,
    "4140SteelCutsAlongX__EBI_F20IN_T100_D0p05IN_4000RPM": Heard.STABLE,
    "4140SteelCutsAlongX__EBI_F20IN_T25_D0p125IN_4000RPM": Heard.STABLE,
    "4140SteelCutsAlongX__EBI_F20IN_T50_D0p125IN_4000RPM": Heard.STABLE,
    "AluminumCutsAlongX__EBI_T100_0p375IN_12000RPM": Heard.STABLE,
    "AluminumCutsAlongX__EBI_T100_0p375IN_7000RPMto6000RPM": Heard.STABLE,
    "AluminumCutsAlongX__EBI_T50_0p125IN_12000RPM": Heard.STABLE,
    "CutsAlongX__EBI_T25_0p25IN_6900RPM": Heard.STABLE,
    "CutsAlongX__EBI_T50_0p25IN_6900RPM": Heard.CHATTER,
    "CutsAlongX__PCB_6000RPM_AirCut": Heard.IDLE,
    "EBI_F18IN_T25_D0p125IN_3000RPM_5A_SKF_ON_TABLE": Heard.STABLE,
    "SKF_F18IN_T25_D0p125IN_3000RPM_5A_EBI_ON_TABLE": Heard.STABLE,
    "Chatter.wav": Heard.CHATTER,
    "Stable.wav": Heard.STABLE,
}


def path_of(part: str) -> Path:
    """The file whose name holds this."""
    (path,) = (each for each in FILES.rglob("*") if part in each.name)
    return path


@cache
def heard(part: str) -> Listening:
    """What a recording says."""
    return recordings.told(path_of(part))[0]


def speed(part: str) -> float:
    """The spindle's speed in a recording [rev/min]."""
    found = heard(part).spindle_speed
    assert found is not None
    return to_rpm(found)


def right() -> int:
    """Recordings whose verdict is what was recorded."""
    return sum(heard(part).verdict is verdict for part, verdict in RECORDED.items())


def advised() -> float:
    """Of the speeds that the sound of chatter suggests the one that is nearest to the one that ran stably [rev/min]."""
    speeds = [to_rpm(each) for each in heard("Chatter.wav").suggested_speeds]
    return min(speeds, key=lambda each: abs(each - 4494.0))


@cache
def hit() -> tuple[float, float]:
    """Size [m/N] and frequency [Hz] of the peak between 300 and 3000 Hz of one hit of a hammer."""
    opened = open_recording(FILES / "hammer" / "raw_tap_tip_tip.txt")
    force, response = (each.samples for each in opened.channels)
    found = tap(opened.rate, [(force, response)])
    near = (found.omega > 2.0 * np.pi * 300.0) & (found.omega < 2.0 * np.pi * 3000.0)
    size = np.abs(found.receptance[near])
    return float(size.max()), float(to_hz(found.omega[near][int(np.argmax(size))]))


@cache
def face_mill() -> Any:
    """Zero-order lobes of the face mill."""
    return real_files.face_mill()


def told_right(method: str) -> float:
    """Labelled cuts that the lobes of the published prior tell right [%]."""
    return 100.0 * real_files.labelled(real_files.METHODS[method]).share_right


def learnt() -> tuple[float, float]:
    """Shares of all 118 and of the 79 unseen cuts that are told right after the 40 training cuts [%], as their page has them."""
    row = next(line for line in labelled_cuts.PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("| after the 40 training"))
    right, unseen = (int(count) for count in re.findall(r"\| (\d+) \(", row))
    return 100.0 * right / 118, 100.0 * unseen / 79


@cache
def calibrated(signal: bool) -> Any:
    """Cutting coefficients of three slots, axes found."""
    with tempfile.TemporaryDirectory() as folder:
        setup = read_campaign(dynamometer.campaign(Path(folder)))
        return calibrate(setup, partial(read_cut, setup.sensors, setup.sampling_rate), signal, any_axes=True)


def coefficient(signal: bool, name: str = "K_tc") -> float:
    """One of them [MPa]."""
    return float(1e-6 * calibrated(signal).forces.of(name)[0])


def once_a_turn() -> float:
    """The largest force once per revolution [N]."""
    return max(float(m.once_per_revolution[:2].max()) for m in calibrated(False).used)


@cache
def carbide() -> real_machine.Answer:
    """The tip from two hits on the holder, drawn from a photograph as of carbide."""
    return real_machine.answer(real_machine.Drawing("carbide", 61.0, 6e6))


def measured_peak() -> tuple[float, float]:
    """Frequency [Hz] and size [m/N] of the measured tip's largest receptance."""
    frequency, measured = real_machine.measured_tip()
    at = int(np.argmax(np.abs(measured)))
    return float(frequency[at]), float(np.abs(measured[at]))


def universal_file(name: str, ours: bool) -> np.ndarray:
    """All values of a file of functions over their largest."""
    if ours:
        values = np.concatenate([np.ravel(each.values) for each in read_uff(FILES / name)])
    else:
        import pyuff

        sets = pyuff.UFF(str(FILES / name)).read_sets()
        sets = sets if isinstance(sets, list) else [sets]
        values = np.concatenate([np.ravel(each["data"]) for each in sets if each["type"] == 58])
    return values / np.max(np.abs(values))


_LISTEN, _HIT = "tests/signals/test_real_recordings.py", FILES / "hammer" / "raw_tap_tip_tip.txt"
_CUT, _LABELS = FILES / "milling_acceleration", real_files.CUTS
CASES = (
    Case(
        "face mill, half-immersion down-milling: zero-order least limit",
        FACE_MILL,
        1.015,
        lambda: 1e3 * face_mill().absolute_limit,
        "mm",
        1e-3,
        "tests/benchmarks/test_real_files.py::test_the_face_mill_has_its_published_minimum",
        needs=real_files.FACE_MILL[0],
    ),
    Case(
        "face mill: its chatter frequency",
        FACE_MILL,
        1441.0,
        lambda: to_hz(face_mill().absolute_frequency),
        "Hz",
        0.6,
        "tests/benchmarks/test_real_files.py::test_the_face_mill_has_its_published_minimum",
        Measure.ABSOLUTE,
        needs=real_files.FACE_MILL[0],
    ),
    *(
        Case(
            f"118 labelled cuts told right by lobes of the published prior, {method}",
            CUTS + ", accurate lobes of that prior",
            73.7,
            partial(told_right, method),
            "%",
            0.05,
            "tests/benchmarks/test_real_files.py::test_accurate_lobes_tell_the_published_share_of_the_labelled_cuts_right",
            Measure.ABSOLUTE,
            slow=True,
            needs=_LABELS,
        )
        for method in ("multi-frequency", "full-discretisation")
    ),
    *(
        Case(
            f"{what} told right after the 40 training cuts, at least as many as published",
            CUTS,
            value,
            lambda k=k: learnt()[k],  # type: ignore[misc]
            "%",
            0.0,
            "python -m benchmarks labelled_cuts",
            Measure.AT_LEAST,
        )
        for k, (what, value) in enumerate((("118 labelled cuts", 83.1), ("79 unseen ones", 79.7)))
    ),
    Case(
        "hit of a hammer on a tool's tip: size of the peak",
        HAMMER.format("raw_tap_tip_tip.txt") + ", its analyser's receptance",
        6.76e-7,
        lambda: hit()[0],
        "m/N",
        1e-2,
        f"{_LISTEN}::test_a_real_hit_gives_its_analysers_receptance",
        needs=_HIT,
    ),
    Case(
        "the same: its frequency",
        HAMMER.format("raw_tap_tip_tip.txt") + ", its analyser's receptance",
        1056.0,
        lambda: hit()[1],
        "Hz",
        1.0,
        f"{_LISTEN}::test_a_real_hit_gives_its_analysers_receptance",
        Measure.ABSOLUTE,
        needs=_HIT,
    ),
    Case(
        "tip of a real tool from two hits on its holder, told to be of carbide: frequency of the largest mode",
        HAMMER.format("frf_tip_from_point_1|3|5.txt") + ", measured at the tip",
        lambda: measured_peak()[0],
        lambda: carbide().peak[0],
        "Hz",
        1.5e-2,
        "tests/workflows/test_real_machine.py",
        slow=True,
        needs=_HIT,
    ),
    Case(
        "the same: its size",
        HAMMER.format("frf_tip_from_point_1|3|5.txt") + ", measured at the tip",
        lambda: measured_peak()[1],
        lambda: carbide().peak[1],
        "m/N",
        0.15,
        "tests/workflows/test_real_machine.py",
        slow=True,
        needs=_HIT,
    ),
    Case(
        "verdicts on fourteen recordings: stable, chatter, idle",
        CUT_FILES.format("12 recordings") + "; " + SOUNDS.format("Chatter.wav, Stable.wav"),
        float(len(RECORDED)),
        right,
        "recordings",
        0.0,
        _LISTEN,
        Measure.AT_LEAST,
        slow=True,
        needs=_CUT,
    ),
    *(
        Case(
            f"spindle speed in a recording: {part}",
            CUT_FILES.format(f"HurcoVMX42SRTi__…{part[-34:]}.csv") + "; windows of half a second, one by one, by another program",
            rpm,
            partial(speed, part),
            "rev/min",
            2e-4,
            f"{_LISTEN}::test_stable_cuts_tell_speed_and_teeth",
            slow=True,
            needs=_CUT,
        )
        for part, (rpm, _, _) in CUTS_HEARD.items()
    ),
    Case(
        "chatter in a sound: its frequency",
        SOUNDS.format("Chatter.wav") + ", authors' spectrum",
        898.8,
        lambda: heard("Chatter.wav").chatter[0],
        "Hz",
        0.5,
        f"{_LISTEN}::test_the_sound_of_chatter_advises_the_speed_that_ran_stably",
        Measure.ABSOLUTE,
        slow=True,
        needs=FILES / "milling_sound",
    ),
    Case(
        "the speed that this sound suggests, beside the lobe that its authors chose",
        SOUNDS.format("Chatter.wav") + ", 60 f/(N k)",
        4494.0,
        advised,
        "rev/min",
        2.0,
        f"{_LISTEN}::test_the_sound_of_chatter_advises_the_speed_that_ran_stably",
        Measure.ABSOLUTE,
        slow=True,
        needs=FILES / "milling_sound",
    ),
    Case(
        "spindle speed in the sound of the cut that was stable there",
        SOUNDS.format("Stable.wav") + ", harmonics of 74.81 Hz",
        4488.8,
        partial(speed, "Stable.wav"),
        "rev/min",
        3e-4,
        f"{_LISTEN}::test_the_sound_of_that_speed_is_stable",
        slow=True,
        needs=FILES / "milling_sound",
    ),
    *(
        Case(
            f"dynamometer, three slots, axes found: K_tc by {how}",
            FORCES + ", five feeds, axes put right by hand: 959 ± 140 MPa",
            959.0,
            partial(coefficient, signal),
            "MPa",
            allowed,
            f"tests/workflows/test_real_dynamometer.py::{test}",
            slow=signal,
            needs=FILES / "dynamometer",
        )
        for signal, how, allowed, test in (
            (False, "mean forces", 0.05, "test_mean_forces_of_three_feeds"),
            (True, "the force over time", 0.1, "test_the_whole_force_over_time"),
        )
    ),
    Case(
        "dynamometer: force once per revolution, the largest of the three",
        FORCES + ", 77 to 92 N",
        92.0,
        once_a_turn,
        "N",
        0.02,
        "tests/workflows/test_real_dynamometer.py::test_mean_forces_of_three_feeds",
        needs=FILES / "dynamometer",
    ),
    *(
        Case(
            f"functions of a universal file: {name}",
            f"{name} (github.com/ladisk/pyuff), read by pyuff",
            partial(universal_file, name, False),
            partial(universal_file, name, True),
            "of the largest",
            1e-12,
            "tests/io/test_uff.py",
            Measure.ABSOLUTE,
            needs=FILES / name,
        )
        for name in ("sample_58b_binary.uff", "psd_58.uff", "time_history.uff")
    ),
)
