"""Every text, key and number that is written reads back the same."""

import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcsa_ident.io.toml_text import toml_of
from rcsa_ident.io.toolings import tooling_text

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
