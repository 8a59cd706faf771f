"""Files of uploads: what is there is whole, under its hash, in its group's own folder; a crash leaves nothing but what is swept."""

from __future__ import annotations

import hashlib
import os
import shutil
import time

import pytest

import api.files
from api.files import NORMALISED, PARTS, STALE_FILE, STALE_PART, UPLOADS, Files, Full, Part, Partial, TooLarge


@pytest.fixture
def files(tmp_path):
    return Files(tmp_path / "files")


def everything(files):
    return sorted(str(p.relative_to(files.folder)) for p in files.folder.rglob("*") if p.is_file())


def kept(files, group, content, kind=UPLOADS):
    part = files.part(group)
    part.write(content)
    part.sync()
    key = part.sha256()
    files.keep(group, kind, key, part.path)
    part.drop()
    return key


def test_a_part_takes_its_place_under_its_hash(files):
    key = kept(files, "A", b"12345")
    assert key == hashlib.sha256(b"12345").hexdigest()
    assert files.path("A", UPLOADS, key).read_bytes() == b"12345"
    # the same again is one file
    assert kept(files, "A", b"12345") == key
    assert len(everything(files)) == 1
    with files.lock:
        files.remove("A", [(UPLOADS, key), (UPLOADS, "0" * 64)])
    assert everything(files) == []


def test_groups_share_no_file_and_their_names_no_folder(files):
    names = ["A", "../A", "a/b", "x" * 5000, "\x00", "ä"]
    keys = [kept(files, name, b"same") for name in names]
    assert len(set(keys)) == 1
    assert len(everything(files)) == len(names)
    with files.lock:
        files.remove("A", [(UPLOADS, keys[0])])
    assert files.path("../A", UPLOADS, keys[0]).is_file()
    assert {p.parent for p in files.folder.iterdir()} == {files.folder}


@pytest.mark.parametrize("key", ["../../x", "", "0" * 63, "0" * 65, "G" * 64, "0" * 63 + "\n"])
@pytest.mark.parametrize("kind", [UPLOADS, NORMALISED])
def test_nothing_but_a_hash_is_a_key(files, key, kind):
    with pytest.raises(ValueError, match="no key"):
        files.path("A", kind, key)


def test_nothing_but_uploads_and_their_samples_is_kept(files):
    for kind in (PARTS, "..", "x"):
        with pytest.raises(ValueError, match="no key"):
            files.path("A", kind, "0" * 64)


def test_everything_is_synced_before_it_counts(files, monkeypatch):
    """File, then rename, then the folder that knows its name: in this order, or a loss of power loses it."""
    done = []
    fsync, rename = os.fsync, os.replace
    kind = {True: "folder", False: "file"}
    monkeypatch.setattr(os, "fsync", lambda handle: (done.append(kind[os.path.isdir(f"/proc/self/fd/{handle}")]), fsync(handle))[1])
    monkeypatch.setattr(os, "replace", lambda *pair: (done.append("rename"), rename(*pair))[1])
    files.of_group("A", UPLOADS)
    assert done == ["folder"] * 3
    done.clear()
    kept(files, "A", b"1")
    assert [each for each in done if each != "folder"] == ["file", "rename"]
    assert done[-1] == "folder"
    done.clear()
    path, _ = files.partial("A", "c/n")
    files.note(path, Partial(1, 2))
    assert done == ["file", "rename", "folder"]


def test_a_part_that_is_dropped_is_gone(files):
    part = files.part("A")
    part.write(b"123")
    part.drop()
    part.drop()
    assert everything(files) == []


def test_a_part_goes_on_where_it_was_noted(files):
    path, state = files.partial("A", "c/n.h5")
    assert state is None
    part = Part(path)
    part.write(b"12345")
    part.sync()
    files.note(path, Partial(3, 10))
    part.write(b"lost")
    part.close()
    # as after a crash: what was noted counts
    path, state = files.partial("A", "c/n.h5")
    assert state == Partial(3, 10)
    again = Part(path, state.offset)
    again.write(b"456")
    again.sync()
    assert (again.size, path.read_bytes()) == (6, b"123456")
    assert again.sha256() == hashlib.sha256(b"123456").hexdigest()
    again.close()
    files.forget(path)
    assert files.partial("A", "c/n.h5")[1] is None
    assert everything(files) == []


@pytest.mark.parametrize("text", ["", "{", "[]", '{"offset": 1}', '{"offset": "1", "length": 2}', '{"offset": 5, "length": 9}', "\xff"])
def test_a_note_that_is_none_begins_anew(files, text):
    path, _ = files.partial("A", "c/n")
    path.write_bytes(b"123")
    path.with_suffix(".json").write_bytes(text.encode("latin-1"))
    assert files.partial("A", "c/n")[1] is None


def test_uploads_of_one_name_in_two_campaigns_are_apart(files):
    assert files.partial("A", "c/n")[0] != files.partial("A", "d/n")[0]
    assert files.partial("A", "c/n")[0] != files.partial("B", "c/n")[0]


def test_what_nobody_refers_to_is_swept_once_it_is_old(files):
    now = time.time()
    kept(files, "A", b"kept")
    orphan, fresh = kept(files, "A", b"orphan"), kept(files, "B", b"fresh")
    samples = kept(files, "A", b"samples", NORMALISED)
    part, old = files.part("A"), files.part("B")
    part.close()
    old.close()
    age = {files.path("A", UPLOADS, orphan): STALE_FILE, files.path("A", NORMALISED, samples): STALE_FILE, old.path: STALE_PART}
    for path, seconds in {**age, files.path("A", UPLOADS, hashlib.sha256(b"kept").hexdigest()): 1e7}.items():
        os.utime(path, (now - seconds - 10.0, now - seconds - 10.0))
    rows = {"A": {(UPLOADS, hashlib.sha256(b"kept").hexdigest()), (NORMALISED, samples)}}
    assert files.sweep(rows, now) == 2
    assert not files.path("A", UPLOADS, orphan).exists()
    assert not old.path.exists()
    assert files.path("A", NORMALISED, samples).exists()
    assert files.path("B", UPLOADS, fresh).exists()
    assert part.path.exists()
    assert files.sweep(rows, now) == 0
    assert files.sweep({}, now + 2 * STALE_PART) == 4
    assert everything(files) == []


@pytest.mark.parametrize("jump", [-1e8, -STALE_PART, 2.0 * STALE_PART, 1e8])
def test_a_clock_that_jumps_makes_no_part_old(tmp_path, monkeypatch, jump):
    clock, steady, wall = time.time, time.monotonic, [0.0]
    passed = [0.0]
    monkeypatch.setattr(time, "time", lambda: clock() + passed[0] + wall[0])
    monkeypatch.setattr(time, "monotonic", lambda: steady() + passed[0])
    files = Files(tmp_path / "files")

    def part():
        found = files.part("A")
        found.close()
        os.utime(found.path, (time.time(), time.time()))
        return found.path

    before, wall[0] = part(), jump
    after = part()
    assert files.sweep({}) == 0
    # both grow old all the same, the one on the other side of the jump later
    passed[0] = 1.1 * STALE_PART
    assert files.sweep({}) == 1
    passed[0] += abs(jump)
    assert files.sweep({}) == 1
    assert not before.exists()
    assert not after.exists()


def test_sweeping_before_anything_came(files):
    assert files.sweep({}) == 0


def test_a_group_may_keep_so_much(tmp_path):
    files = Files(tmp_path, group_bytes=100)
    kept(files, "A", bytes(60))
    part = files.part("A")
    part.write(bytes(30))
    part.sync()
    files.check_space("A", 10)
    with pytest.raises(TooLarge, match="keeps 90 bytes, and may keep 100"):
        files.check_space("A", 11)
    files.check_space("B", 100)
    part.drop()
    files.check_space("A", 40)


def test_room_is_counted_without_asking_every_file_again(files, monkeypatch):
    asked = []
    size = api.files._size
    monkeypatch.setattr("api.files._size", lambda path: (asked.append(path.name), size(path))[1])
    first, second = kept(files, "A", b"12345"), kept(files, "A", b"123", NORMALISED)
    assert files.usage("A") == {UPLOADS: 5, NORMALISED: 3, PARTS: 0}
    third = kept(files, "A", b"1234567")
    assert files.usage("A")[UPLOADS] == 12
    assert sorted(asked) == sorted([first, f"{second}.h5", third])
    # a whole one in the place of a damaged one, one that is gone, and a service that starts anew
    files.path("A", UPLOADS, third).write_bytes(b"1")
    assert Files(files.folder).usage("A")[UPLOADS] == 6
    kept(files, "A", b"1234567")
    with files.lock:
        files.remove("A", [(UPLOADS, first)])
    assert files.usage("A") == Files(files.folder).usage("A") == {UPLOADS: 7, NORMALISED: 3, PARTS: 0}


def test_the_disk_keeps_what_it_has_to(tmp_path, monkeypatch):
    files = Files(tmp_path, free_bytes=1000)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(5000, 3500, 1500))
    files.check_space("A", 500)
    with pytest.raises(Full):
        files.check_space("A", 501)
