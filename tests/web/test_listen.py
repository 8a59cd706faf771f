"""Listen, the door that needs no machine: a recording dropped or made with the microphone, and hits of a hammer."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import soundfile
from playwright.sync_api import Browser, Page, expect
from scipy.io import wavfile

from rcsa_ident.io.curves.frf_files import read_frfs
from tests.api.test_listening import CHATTER, samples, text_of_hits
from tests.fixtures.service import Served
from tests.signals.test_tap import receptance
from tests.web.conftest import drop, hearing
from tests.web.test_accessibility import faults

RATE = 48000


def plain(text: str) -> str:
    return text.replace("\u202f", "").replace("\u00a0", " ")


@pytest.fixture(scope="module")
def browser(launch: Callable[..., Browser], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """One whose microphone hears a cut that chatters."""
    path = tmp_path_factory.mktemp("microphone") / "heard.wav"
    wavfile.write(path, RATE, (30000.0 * 0.6 * samples(12.0, rate=RATE)).astype(np.int16))
    found = launch(*hearing(path))
    yield found
    found.close()


@pytest.fixture
def sound(tmp_path: Path) -> Path:
    path = tmp_path / "cut.wav"
    wavfile.write(path, 22050, samples().astype(np.float32))
    return path


def chatters(page: Page, within: float) -> None:
    """What is said of the cut."""
    answer = page.locator(".heard")
    expect(answer).to_have_attribute("data-verdict", "chatter", timeout=60_000)
    words = plain(answer.inner_text())
    (frequency,) = re.findall(r"chatter\s+([\d.]+)\s+Hz", words)
    assert abs(float(frequency) - CHATTER) < within, words
    expect(page.locator("main .chart .main-svg").first).to_be_visible()


def test_the_microphone_hears_chatter(opened, served: Served):
    """It is asked for when the button is pressed and not before; what is recorded comes back as chatter at its frequency."""
    page = opened()
    page.evaluate(
        "() => { window.asked = []; const media = navigator.mediaDevices, real = media.getUserMedia.bind(media);"
        " media.getUserMedia = (wanted) => { window.asked.push(wanted.audio); return real(wanted); }; }"
    )
    page.get_by_role("link", name="Listen", exact=True).first.click()
    page.get_by_label("Teeth of the cutter").fill("4")
    page.get_by_label("Programmed speed").fill("6000")
    page.get_by_label("Length").select_option("5")
    assert page.evaluate("window.asked") == []
    with page.expect_request("**/v1/listen?*") as sent:
        page.get_by_role("button", name="Record with the microphone").press("Enter")
        expect(page.get_by_role("button", name="Stop and listen")).to_be_focused()
        expect(page.locator(".countdown")).to_have_text(re.compile(r"[0-4]\.\d s"))
        expect(page.get_by_label("Level", exact=True)).to_be_visible()
    (wanted,) = page.evaluate("window.asked")
    assert [wanted[name] for name in ("echoCancellation", "noiseSuppression", "autoGainControl")] == [False] * 3
    chatters(page, 2.0)
    expect(page.locator("main")).to_contain_text("Echo cancellation, noise suppression and automatic gain are off.")
    heard = plain(page.locator("main").inner_text())
    # the device's own, whatever the file's behind it is
    assert re.search(r"The microphone gives (44100|48000) samples a second", heard), heard
    assert "try next" in heard
    assert sent.value.url.count("name=recording-") == 1


def test_stop_ends_it_before_its_time(opened, served: Served):
    page = opened("#/listen?teeth=4&speed_rpm=6000")
    page.get_by_label("Length").select_option("30")
    page.get_by_role("button", name="Record with the microphone").click()
    expect(page.locator(".countdown")).to_have_text(re.compile(r"2[0-7]\.\d s"))
    page.get_by_role("button", name="Stop and listen").click()
    chatters(page, 5.0)
    expect(page.get_by_role("button", name="Record with the microphone")).to_be_enabled()


def test_the_microphone_goes_with_the_view(opened, served: Served):
    page = opened("#/listen")
    page.evaluate(
        "() => { const media = navigator.mediaDevices, real = media.getUserMedia.bind(media);"
        " media.getUserMedia = async (wanted) => (window.stream = await real(wanted)); }"
    )
    page.get_by_role("button", name="Record with the microphone").click()
    expect(page.get_by_role("button", name="Stop and listen")).to_be_visible()
    assert page.evaluate("window.stream.getAudioTracks()[0].readyState") == "live"
    page.get_by_role("link", name="Hammer hits").click()
    page.get_by_role("heading", name="Hammer hits", level=1).wait_for()
    assert page.evaluate("window.stream.getAudioTracks()[0].readyState") == "ended"
    assert not [each for each in opened.watch.requests if "/v1/listen" in each.url]


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        ("Object.defineProperty(window, 'isSecureContext', { value: false })", "https"),
        ("Object.defineProperty(window, 'AudioWorkletNode', { value: undefined })", "This browser cannot record"),
    ],
)
def test_why_not(opened, spoil, words):
    page = opened()
    page.evaluate(f"() => {{ {spoil}; }}")
    page.get_by_role("link", name="Listen", exact=True).first.click()
    expect(page.locator("main .note")).to_contain_text(words)
    expect(page.get_by_role("button", name="Record with the microphone")).to_be_disabled()


def test_it_may_be_refused(opened):
    page = opened("#/listen")
    page.evaluate("() => { navigator.mediaDevices.getUserMedia = async () => { throw new DOMException('no', 'NotAllowedError'); }; }")
    page.get_by_role("button", name="Record with the microphone").click()
    expect(page.locator("main .note")).to_contain_text("was not allowed")
    expect(page.get_by_role("button", name="Record with the microphone")).to_be_enabled()


def test_a_dropped_recording_on_a_phone(opened, sound: Path):
    """Nothing is told; then the teeth are, and a speed to try comes."""
    page = opened("#/listen?speed_rpm=6000", viewport={"width": 390, "height": 844})
    drop(page, "h1", [sound])
    chatters(page, 1.0)
    page.get_by_label("Teeth of the cutter").fill("4")
    page.get_by_role("button", name="Listen again").click()
    expect(page.locator(".heard")).to_contain_text("try next")
    assert "9259" in plain(page.locator(".heard").inner_text())
    assert "teeth=4" in page.url
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    for title in ("Spectrum over orders of the spindle", "Spectrogram", "Signal"):
        expect(page.get_by_role("img", name=re.compile(f"^{title}: chatter"))).to_have_count(1)
    expect(page.locator(".chart image")).to_have_count(1)


def test_what_is_wrong_stands_beside_its_field(opened, sound: Path):
    page = opened("#/listen?teeth=0")
    drop(page, "h1", [sound])
    expect(page.locator('[data-field="teeth"] .fault')).to_contain_text("greater than or equal to 1")
    page.get_by_label("Teeth of the cutter").fill("")
    sound.write_bytes(b"RIFF")
    drop(page, "h1", [sound])
    expect(page.locator("main .note.bad")).to_be_visible()


def test_a_lossy_file_gives_no_damping(opened, tmp_path: Path):
    soundfile.write(tmp_path / "cut.ogg", samples(), 22050)
    page = opened("#/listen?teeth=4&speed_rpm=6000")
    drop(page, "h1", [tmp_path / "cut.ogg"])
    chatters(page, 1.0)
    expect(page.locator("main")).to_contain_text("Nothing is said of damping")


def test_hits_to_an_frf(opened, tmp_path: Path):
    (tmp_path / "one.csv").write_bytes(text_of_hits())
    (tmp_path / "two.csv").write_bytes(text_of_hits(1, seed=3))
    page = opened("#/tap")
    drop(page, "h1", [tmp_path / "one.csv", tmp_path / "two.csv"])
    expect(page.locator("main")).to_contain_text("3 of 3", timeout=60_000)
    expect(page.get_by_role("table", name="Hits and what became of them").get_by_role("row")).to_have_count(4)
    expect(page.get_by_role("img", name=re.compile("^Receptance X from 3 of 3 hits"))).to_have_count(1)
    for name in ("FRF.csv", "FRF.uff"):
        with page.expect_download() as got:
            page.get_by_role("button", name=name).click()
        got.value.save_as(tmp_path / name)
        (test,) = read_frfs(tmp_path / name)
        inside = (test.frequency > 300.0) & (test.frequency < 3000.0)
        true = receptance(2.0 * np.pi * test.frequency[inside])
        assert np.linalg.norm(test.values[inside] - true) < 0.03 * np.linalg.norm(true)


def test_everybody_can_use_it(opened, served: Served, sound: Path, tmp_path: Path):
    """Before and after an answer: nothing that axe-core finds."""
    found = {}
    (tmp_path / "hits.csv").write_bytes(text_of_hits())
    page = opened("#/listen?teeth=4&speed_rpm=6000")
    for address, file, shown in (("#/listen?teeth=4&speed_rpm=6000", sound, ".heard"), ("#/tap", tmp_path / "hits.csv", "table")):
        page.goto(f"{served.url}/{address}")
        drop(page, "h1", [file])
        page.locator(shown).wait_for(timeout=60_000)
        expect(page.locator("main .chart .main-svg").last).to_be_visible()
        found |= {f"{address}, {look}": each for look, each in faults(page).items()}
    assert found == {}


def test_the_file_holds_what_was_heard(opened, tmp_path: Path):
    """32-bit floats at the device's rate, beyond full scale, too: other programs read the same samples."""
    page = opened("#/listen")
    numbers = page.evaluate(
        "async () => { const { wavFile } = await import(new URL('microphone.js', document.querySelector('script[type=module]').src));"
        " const file = wavFile([new Float32Array([0, 0.1, -1.5]), new Float32Array([1e-9])], 44100, 'x.wav');"
        " return [...new Uint8Array(await file.arrayBuffer())]; }"
    )
    (tmp_path / "x.wav").write_bytes(bytes(numbers))
    rate, heard = wavfile.read(tmp_path / "x.wav")
    assert (rate, heard.dtype) == (44100, np.float32)
    np.testing.assert_array_equal(heard, np.array([0.0, 0.1, -1.5, 1e-9], np.float32))
