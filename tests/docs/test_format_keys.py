"""The page of keys is what the readers say now."""

import pytest

from benchmarks import formats
from rcsa_ident.io.settings.schemas import SCHEMAS


def test_the_page_is_as_the_code_says():
    assert formats.PAGE.read_text("utf-8") == formats.page(), "run python -m benchmarks formats"


def test_every_file_has_its_rows():
    for name in SCHEMAS:
        rows = formats.rows_of(name)
        assert len(rows) > 10, name
        assert len({row.key for row in rows}) >= len(rows) - 3, name
    by_key = {row.key: row for row in formats.rows_of("tooling")}
    assert by_key["tool.stickout_mm"] == ("tool.stickout_mm", "mm", "number", "0.5 to 5000", "2 to 500", "needed")
    assert by_key["cutter.teeth"][2:4] == ("whole number", "1 to 100")
    assert by_key["spread.fluted_diameter_percent"].default == "`3`"


@pytest.mark.parametrize(
    ("key", "found"),
    [
        ("tool.segments[].material", ("any", "segments[].material")),
        ("contact.rotational_damping", ("tooling", "contact.rotational_damping")),
        ("cutter.unheard_of", None),
    ],
)
def test_the_longest_ending_tells_the_meaning(key, found):
    meanings = {"any": {"segments[].material": "a"}, "tooling": {"contact.rotational_damping": "b", "damping": "c"}}
    assert formats.meaning_of("tooling", key, meanings) == found


def test_a_key_without_a_meaning_and_a_meaning_without_a_key_are_errors(tmp_path, monkeypatch):
    text = (formats.FOLDER / "meanings.toml").read_text("utf-8")
    monkeypatch.setattr(formats, "FOLDER", tmp_path)
    (tmp_path / "meanings.toml").write_text(text.replace('"cutter.teeth" =', '"cutter.tooth" ='), encoding="utf-8")
    with pytest.raises(LookupError, match=r"does not tell what cutter\.teeth of tooling means"):
        formats.page()
    (tmp_path / "meanings.toml").write_text(text.replace("[robot]", '[robot]\n"robot.wheels" = "none"'), encoding="utf-8")
    with pytest.raises(LookupError, match=r"\[robot\] robot\.wheels"):
        formats.page()
