"""Writing leaves the old file or the new one."""

from __future__ import annotations

import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.files import read_bytes, replacing, write_text


def interrupted(path):
    with replacing(path) as part:
        part.write_text("half")
        raise RuntimeError("stop")


def test_an_interrupted_write_leaves_the_old_file(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "old")
    with pytest.raises(RuntimeError, match="stop"):
        interrupted(path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_place_that_cannot_be_written(tmp_path):
    with pytest.raises(InputError, match="output file: found No such file or directory"):
        write_text(tmp_path / "none" / "a.txt", "x")


def test_newlines_are_kept(tmp_path):
    write_text(tmp_path / "a.txt", "a\r\nb\n")
    assert (tmp_path / "a.txt").read_bytes() == b"a\r\nb\n"


def test_too_large_or_strange(tmp_path):
    (tmp_path / "a").write_bytes(b"x" * 2_000_000)
    with pytest.raises(InputError, match="thing: found 2 MB, allowed is at most 1 MB"):
        read_bytes(tmp_path / "a", "thing", 1_000_000)
    with pytest.raises(InputError, match=r"thing: found (a path that cannot be opened|no such file)"):
        read_bytes(tmp_path / "a\0b", "thing", 10)
