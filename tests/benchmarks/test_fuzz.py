"""The fuzzer's own parts: seeds that are taken, changes that keep a file's form, and the readers under both for a moment."""

from __future__ import annotations

import json
import random
import tomllib

import pytest

from benchmarks import fuzz
from benchmarks.fuzz_changes import CHANGES, json_changed, toml_changed
from benchmarks.fuzz_readers import TARGETS, refusals

#: Readers whose calls cost a tenth of a second, or whose seeds take a command to be made.
DEAR = ("listen", "learnt", "backup")


@pytest.mark.slow
def test_no_change_of_a_seed_costs_more_than_a_sentence(tmp_path):
    """Every reader takes one of its seeds at least, and refuses what it does not take."""

    def read(raw):
        try:
            target.read(raw, folder)
        except refusals():
            return False
        return True

    for name in TARGETS.keys() - set(DEAR):
        target, rng, folder = TARGETS[name], random.Random(name), tmp_path / name
        folder.mkdir()
        seeds = target.sown(folder)
        assert [raw for raw in seeds if read(raw)] != [], name
        for _ in range(12):
            read(CHANGES[rng.choice(["bytes", target.kind])](rng.choice(seeds), rng))


def test_changed_settings_stay_toml_and_changed_results_json():
    rng = random.Random(1)
    raw = b'a = 1.5\n[b]\nc = [1, 2]\n[[d]]\ne = "x"\n'
    changed = [toml_changed(raw, rng) for _ in range(60)]
    parsed = [tomllib.loads(each.decode()) for each in changed]
    assert len({repr(each) for each in parsed}) > 30
    for _ in range(30):
        json.loads(json_changed(b'{"a": [1, {"b": null}], "c": 2.5}', rng))


def test_a_find_is_kept_once_and_as_small_as_it_was_met(tmp_path):
    (tmp_path / "finds").mkdir()
    kept = [fuzz._keep(tmp_path, "csv", b"x" * size, "ValueError a.py:1", "what happened") for size in (5, 9, 3)]
    assert kept == [1, 0, 0]
    (find,) = (tmp_path / "finds").glob("*.bin")
    assert find.read_bytes() == b"xxx"
    assert find.with_suffix(".txt").read_text() == "ValueError a.py:1\nwhat happened"


def test_an_exception_is_told_by_the_projects_own_line():
    from rcsa_ident.io.paths.gcode import gcode_of

    with pytest.raises(TypeError) as caught:
        gcode_of(5, "given")  # type: ignore[arg-type]
    assert fuzz.place(caught.value).startswith("TypeError gcode")


def test_the_account_adds_up_over_turns(tmp_path):
    for name in ("csv", "tdms"):
        (tmp_path / f"{name}.json").write_text('{"seconds": 90.0, "calls": 7}')
    assert fuzz.table(tmp_path).splitlines()[2:] == [
        "| csv | 1.5 | 7 | 0 | 0 |",
        "| tdms | 1.5 | 7 | 0 | 0 |",
        "| all | 3.0 | 14 | 0 | 0 |",
    ]
