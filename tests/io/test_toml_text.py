"""TOML of strangers: nothing in it costs more than its length, and what is wrong is found in its line and column. What is written reads
back the same."""

import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings.toolings import tooling_text
from rcsa_ident.io.toml_text import keys_of_toml, read_toml, toml_of
from tests.fixtures.paths import ROOT

FILES = sorted(path for folder in ("data", "api/examples", "rcsa_ident") for path in (ROOT / folder).rglob("*.toml"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_every_file_means_what_the_standard_library_says(path):
    assert read_toml(path, "file") == tomllib.loads(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    "text",
    [
        "a" + ".a" * 20_000 + " = 1",  # 1.5 GB in the standard library's parser
        "[a" + ".a" * 20_000 + "]",
        "a = " + "[" * 100_000,
        "a = " + "[" * 2000 + "]" * 2000,
        "a = " + "{a = " * 2000 + "1" + "}" * 2000,
    ],
)
def test_depth_is_refused_before_it_costs_anything(text):
    with pytest.raises(InputError, match=r"nested too deeply.*at most 80 levels"):
        keys_of_toml(text, "tooling")


def test_the_last_level_that_is_allowed():
    assert keys_of_toml("a = " + "[" * 80 + "]" * 80, "x").keys() == {"a"}
    with pytest.raises(InputError, match="nested too deeply"):
        keys_of_toml("a = " + "[" * 81 + "]" * 81, "x")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a = 1\nb = = 2", "in line 2, column 5"),
        ("a = 1\na = 2", "duplicate key.*in line 2, column 1"),
        ("a = " + "9" * 1_000_000, "integer number overflowed.*in line 1, column 5"),
        ("a = 1e400", "floating-point number overflowed"),
        ("a = 2020-13-40", "invalid date"),
        ("a = 0000-01-01", "year 0"),
        ('a = "\0"', "invalid basic string"),
        ('a = 1\n\nb = "\ud800"', "not Unicode in line 3"),
        ("a = 1\rb = 2", "carriage return"),
    ],
)
def test_what_is_wrong_is_found_in_its_place(text, words):
    with pytest.raises(InputError, match=f"^tooling: found .*{words}"):
        keys_of_toml(text, "tooling")


def test_a_file_is_named_with_line_and_column(tmp_path):
    path = tmp_path / "S1.toml"
    path.write_bytes(b"\xef\xbb\xbfa = 1\r\nb = [1,,2]\r\n")
    with pytest.raises(InputError, match=r"S1\.toml line 2, column 8: tooling: found a TOML error \(") as found:
        read_toml(path, "tooling")
    assert found.value.found.count("line") == 0


def test_numbers_beyond_64_bit_are_whole():
    keys = keys_of_toml("a = 99999999999999999999999\nb = -9223372036854775809", "x")
    assert keys == {"a": 99999999999999999999999, "b": -9223372036854775809}


#: What JSON's and a hand's quoting took for ordinary: DEL, a line's end, a tag of plane 14, quotes, keys that need them.
ODD = ["a\x7fb", "two\nlines", "U+E0001 \U000e0001", 'a "b" \\', "", "a.b", "Ü"]

texts = st.text(st.characters(exclude_categories=["Cs"]))
values = st.recursive(
    texts | st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(texts, inner, max_size=3),
    max_leaves=12,
)


@given(st.dictionaries(texts, values, max_size=5))
def test_anything(keys):
    assert tomllib.loads(toml_of(keys, ["made\nby a test"])) == keys


@pytest.mark.parametrize("text", ODD)
def test_odd_texts(text):
    assert tomllib.loads(tooling_text({"name": text, "materials": {text: {"density": 1.0}}}, [text]))["name"] == text
    assert list(tomllib.loads(toml_of({"toolings": {text: "a.toml"}}))["toolings"]) == [text]


def test_digits():
    assert tomllib.loads(toml_of({"a": 1e3 * 0.0705, "b": [2.0 / 3.0], "n": 7}, digits=3)) == {"a": 70.5, "b": [0.667], "n": 7}
    assert tomllib.loads(toml_of({"a": 1.0 / 3.0})) == {"a": 1.0 / 3.0}
