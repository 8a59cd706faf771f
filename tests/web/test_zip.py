"""A dropped ZIP: what comes out is what went in, or it is said that it is not."""

from __future__ import annotations

import base64
import io
import struct
import zipfile
import zlib

import pytest

CONTENT = bytes(range(256)) * 400

#: Unpack in the page; names and contents, or the sentence of the refusal.
UNPACK = """async (text) => {
  const base = document.querySelector('script[type=module]').src.replace(/main\\.js$/, '');
  const { unzipped } = await import(base + 'zip.js');
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  try {
    const files = await unzipped(new File([bytes], 'dropped.zip'));
    const read = async (f) => btoa(String.fromCharCode(...new Uint8Array(await f.arrayBuffer()).slice(0, 1000)));
    return Promise.all(files.map(async (f) => [f.name, f.size, await read(f)]));
  } catch (error) { return error.message; }
}"""


def packed(names=("a/b/Fräse.csv",), method=zipfile.ZIP_DEFLATED, zip64=False) -> bytes:
    raw = io.BytesIO()
    with zipfile.ZipFile(raw, "w", method) as out:
        out.writestr("a/", b"")
        for name in names:
            info = zipfile.ZipInfo(name)
            info.compress_type = method
            with out.open(info, "w", force_zip64=zip64) as member:
                member.write(CONTENT)
    return raw.getvalue()


def unpacked(page, raw: bytes):
    return page.evaluate(UNPACK, base64.b64encode(raw).decode())


@pytest.mark.parametrize("method", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
@pytest.mark.parametrize("zip64", [False, True])
def test_what_went_in_comes_out(opened, method, zip64):
    found = unpacked(opened(), packed(("a/b/Fräse.csv", "x.h5"), method, zip64))
    assert [(name, size) for name, size, _ in found] == [("Fräse.csv", len(CONTENT)), ("x.h5", len(CONTENT))]
    assert base64.b64decode(found[1][2]) == CONTENT[:1000]


def test_names_of_old_windows(opened):
    """Without the flag of UTF-8 a name is in code page 437."""
    raw = packed(("Fr?se.csv",)).replace(b"Fr?se.csv", "Fräse.csv".encode("cp437"))
    assert unpacked(opened(), raw)[0][0] == "Fräse.csv"


@pytest.mark.parametrize("method", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_a_damaged_member_is_refused_by_its_name(opened, method):
    raw = bytearray(packed(("x.h5",), method))
    raw[raw.index(b"x.h5") + 60] ^= 1
    assert unpacked(opened(), bytes(raw)).startswith("x.h5 in dropped.zip is damaged")


def test_what_holds_more_than_it_says(opened):
    raw = packed(("x.h5",))
    said, less = struct.pack("<I", len(CONTENT)), struct.pack("<I", 100)
    assert raw.count(said) == 2
    assert unpacked(opened(), raw.replace(said, less)).startswith("x.h5 in dropped.zip is damaged")


def test_what_says_that_it_is_too_much(opened):
    raw = packed(("x.h5",)).replace(struct.pack("<I", len(CONTENT)), struct.pack("<I", 3_000_000_000))
    assert unpacked(opened(), raw) == "dropped.zip holds 3.0 GB; unpack it first"


@pytest.mark.parametrize("raw", [b"", b"PK\x03\x04", packed()[:-40], zlib.compress(CONTENT)])
def test_what_is_no_zip(opened, raw):
    assert "not a ZIP, or was cut off" in unpacked(opened(), raw)
