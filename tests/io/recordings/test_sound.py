"""Sound files through libsndfile: every kind gives the same samples, cut-off ones are told, damaged ones cost a sentence."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
import soundfile
from hypothesis import given, settings
from hypothesis import strategies as st

from api.reading.samples import read_normalised, write_normalised
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import says
from rcsa_ident.io.channels import notes_of
from rcsa_ident.io.recordings.readers import read_recording, read_signals
from rcsa_ident.signals.recording import Quantity, Sensor
from rcsa_ident.signals.verdict import RecordCode, examined

SENSORS = (Sensor("ch2", Quantity.TRIGGER), Sensor("ch1", Quantity.TRIGGER))
RATE = 48000
#: Suffix, the library's format and encoding, and the largest error of a sample: encoders cut what lies below the last bit.
KINDS = {
    "flac": (".flac", "FLAC", "PCM_24", 2.0**-23),
    "aiff": (".aiff", "AIFF", "PCM_24", 2.0**-23),
    "aiff-float": (".aif", "AIFF", "FLOAT", 1e-7),
    "caf": (".caf", "CAF", "PCM_16", 2.0**-15),
    "w64": (".w64", "W64", "PCM_24", 2.0**-23),
    "rf64": (".rf64", "RF64", "PCM_24", 2.0**-23),
    "mu-law": (".wav", "WAV", "ULAW", 0.02),
    "A-law": (".wav", "WAV", "ALAW", 0.02),
}
LOSSY = {
    "vorbis": (".ogg", "OGG", "VORBIS", 0.02),
    "opus": (".opus", "OGG", "OPUS", 0.02),
    "mp3": (".mp3", "MP3", "MPEG_LAYER_III", 0.02),
    "adpcm": (".wav", "WAV", "IMA_ADPCM", 0.02),
}


def tones(samples: int = 20_000) -> np.ndarray:
    time = np.arange(samples) / RATE
    return np.stack([0.5 * np.sin(2.0 * np.pi * 440.0 * time), 0.25 * np.cos(2.0 * np.pi * 900.0 * time)], axis=1)


def written(folder: Path, kind: str, table: np.ndarray) -> Path:
    suffix, form, subtype, _ = {**KINDS, **LOSSY}[kind]
    path = folder / f"cut{suffix}"
    soundfile.write(path, table, RATE, format=form, subtype=subtype)
    return path


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_gives_the_samples(tmp_path, kind):
    table = tones()
    found = read_recording(written(tmp_path, kind, table), SENSORS)
    assert (found.rate, found.notes) == (RATE, ())
    np.testing.assert_allclose(found.samples, table[:, ::-1], rtol=0.0, atol=KINDS[kind][3])


@pytest.mark.parametrize("kind", LOSSY)
def test_lossy_ones_say_so_wherever_they_are_read(tmp_path, kind):
    path = written(tmp_path, kind, tones())
    found = read_recording(path, SENSORS)
    # an encoder may delay the samples
    steady = found.samples[4000:16_000]
    waves = np.exp(-2j * np.pi * np.outer([900.0, 440.0], np.arange(12_000)) / RATE)
    np.testing.assert_allclose(2.0 * np.abs(np.sum(waves.T * steady, axis=0)) / 12_000, [0.25, 0.5], atol=LOSSY[kind][3])
    assert [note.code for note in found.notes] == [RecordCode.LOSSY]
    assert "no damping from it" in found.notes[0]
    assert says(examined(found).notes, RecordCode.LOSSY)
    rate, signals = read_signals(path, ["ch2", "ch1"])
    write_normalised(tmp_path / "stored.h5", rate, signals, SENSORS)
    assert read_normalised(tmp_path / "stored.h5").notes == found.notes


@pytest.mark.parametrize("kind", [*KINDS, *(kind for kind in LOSSY if kind != "adpcm")])
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_file_that_is_cut_off_is_refused_or_noted(tmp_path, kind):
    rng = np.random.default_rng(3)
    table = tones(100_000) + 1e-3 * rng.standard_normal((100_000, 2))
    path = written(tmp_path, kind, table)
    raw = path.read_bytes()
    path.write_bytes(raw[: int(0.6 * len(raw))])
    with pytest.raises(InputError) as caught:
        read_recording(path, SENSORS)
    assert "\n" not in str(caught.value)
    if kind == "caf":  # the library opens none that is cut off
        return
    assert "cut off" in str(caught.value)
    found = read_recording(path, SENSORS, cut_off="note")
    assert says(found.notes, RecordCode.CUT_OFF)
    assert 40_000 <= len(found.samples) <= 70_000
    np.testing.assert_allclose(found.samples[1000:40_000], table[1000:40_000, ::-1], rtol=0.0, atol=0.05)


@pytest.mark.parametrize("length", [0xFFFFFFFF, 0x80000000, 0x7FFFFF00, 0x7FFFF000])
@pytest.mark.parametrize("subtype", ["PCM_16", "ULAW"])
def test_what_a_pipe_wrote_is_read_to_its_end(tmp_path, length, subtype):
    path = tmp_path / "cut.wav"
    soundfile.write(path, tones(500), RATE, subtype=subtype)
    raw = path.read_bytes()
    place = raw.index(b"data") + 4
    path.write_bytes(raw[:4] + b"\xff" * 4 + raw[8:place] + struct.pack("<I", length) + raw[place + 4 :] + b"\1")
    found = read_recording(path, SENSORS)
    assert found.notes == ()
    np.testing.assert_allclose(found.samples, tones(500)[:, ::-1], rtol=0.0, atol=0.02)


def test_a_flac_of_a_pipe_does_not_know_its_length(tmp_path):
    path = written(tmp_path, "flac", tones())
    raw = bytearray(path.read_bytes())
    raw[21] &= 0xF0
    raw[22:26] = bytes(4)
    path.write_bytes(raw)
    np.testing.assert_allclose(read_recording(path, SENSORS).samples, tones()[:, ::-1], rtol=0.0, atol=2.0**-23)


def test_silence_that_stands_for_gigabytes_is_refused(tmp_path):
    path = tmp_path / "cut.flac"
    with soundfile.SoundFile(path, "w", RATE, 1, "PCM_16", format="FLAC") as file:
        for _ in range(40):
            file.write(np.zeros(1 << 20))
    with pytest.raises(InputError, match="at most 200 times the file's size"):
        read_recording(path, SENSORS[1:])


def test_tracks_of_a_companded_wav_are_named(tmp_path):
    path = written(tmp_path, "mu-law", tones(500))
    names = b"<x><TRACK><INTERLEAVE_INDEX>2</INTERLEAVE_INDEX><NAME>mic</NAME></TRACK></x>"
    path.write_bytes(path.read_bytes() + b"iXML" + struct.pack("<I", len(names)) + names)
    found = read_recording(path, (Sensor("mic", Quantity.TRIGGER),))
    np.testing.assert_allclose(found.samples[:, 0], tones(500)[:, 1], atol=0.02)


def test_an_unknown_way_with_cut_off_files_is_refused(tmp_path):
    with pytest.raises(InputError, match="cut_off: found ignore, allowed is refuse or note"):
        read_recording(written(tmp_path, "flac", tones(500)), SENSORS, cut_off="ignore")


def mutated(raw: bytes, rng: np.random.Generator) -> bytes:
    """Up to four bytes of the head or the tail replaced by values that parsers stumble over."""
    out = bytearray(raw)
    reach = min(len(raw), 160)
    for _ in range(rng.integers(1, 5)):
        place = int(rng.integers(0, reach)) if rng.random() < 0.8 else int(rng.integers(len(raw) - reach, len(raw)))
        out[place] = rng.choice([0, 1, 0x7F, 0x80, 0xFF, rng.integers(0, 256)])
    return bytes(out)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [*KINDS, *LOSSY])
def test_damage_costs_a_sentence(tmp_path, kind):
    path = written(tmp_path, kind, tones(600))
    raw = path.read_bytes()
    rng = np.random.default_rng(11)
    sentences, read = [], 0
    for _ in range(250):
        path.write_bytes(mutated(raw, rng))
        try:
            read += len(read_recording(path, SENSORS, cut_off="note").samples) > 0
        except InputError as error:
            sentences.append(str(error))
    assert read > 0
    assert not [sentence for sentence in sentences if "\n" in sentence]


@settings(max_examples=200, deadline=None)
@given(
    head=st.sampled_from([b"FORM\0\0\0\xc8AIFF", b"caff\0\1\0\0", b"fLaC", b"OggS\0\2", b"ID3\3\0\0", b"\xff\xfb"]),
    raw=st.binary(max_size=200),
)
def test_noise_behind_a_head_costs_a_sentence(tmp_path_factory, head, raw):
    path = tmp_path_factory.mktemp("noise") / "cut.flac"
    path.write_bytes(head + raw)
    with pytest.raises(InputError) as caught:
        notes_of(read_signals(path, ["ch1000"], cut_off="note")[1])
    assert "\n" not in str(caught.value)
