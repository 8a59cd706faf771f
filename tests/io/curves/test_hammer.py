"""Hammer files by label and axis; toolings written again with another contact."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.curves.hammer import labelled, read_hammer, write_calibrated_tooling
from rcsa_ident.io.curves.tips import write_frf_csv
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.tool_holder.geometry import Contact
from rcsa_ident.tool_holder.spread import Spread
from tests.fixtures.paths import TOOLINGS

F = np.array([100.0, 200.0, 300.0])
H = np.array([1e-8, 2e-8 - 1e-8j, -1e-8j])
FOUND = Contact(1.234567e10, 7.5e5, 1.5e5, 33.0)
STD = (0.05, 0.12, 0.3, 2.4)


def test_labels(tmp_path):
    known = ("tip", "cross")
    assert labelled("a.csv", "tip", known) == ("tip", Path("a.csv"))
    assert labelled("cross=a.csv", "tip", known) == ("cross", Path("a.csv"))
    assert labelled("LONG.toml=a=b.csv", "T.toml") == ("LONG.toml", Path("a=b.csv"))
    with pytest.raises(InputError, match="one of tip, cross"):
        labelled("tap=a.csv", "tip", known)
    odd = tmp_path / "a=b.csv"
    odd.write_text("x")
    assert labelled(str(odd), "tip", known) == ("tip", odd)


def test_axes_of_a_file(tmp_path):
    path = tmp_path / "FRF.csv"
    write_frf_csv(path, F, {"X": H, "Y": 2.0 * H})
    found = read_hammer(path, "cross")
    assert found.label == "cross"
    assert set(found.values) == {"X", "Y"}
    np.testing.assert_allclose(found.values["Y"][1], 2.0 * H)
    np.testing.assert_allclose(found.values["Y"][0], F)


def test_text_columns_take_their_axis_from_the_name(tmp_path):
    lines = "\n".join(f"{f} {h.real} {h.imag}" for f, h in zip(F, H, strict=True))
    for name, axis in (("tap_x.frf", "X"), ("tap_y.frf", "Y")):
        path = tmp_path / name
        path.write_text("Hz m/N m/N\n" + lines + "\n")
        try:
            found = read_hammer(path)
        except InputError as error:
            pytest.fail(str(error))
        assert list(found.values) == [axis]
        np.testing.assert_allclose(found.values[axis][1], H)


def test_a_file_without_a_direct_function(tmp_path):
    path = tmp_path / "tap.frf"
    path.write_text("Hz m/N m/N\n" + "\n".join(f"{f} {h.real} {h.imag}" for f, h in zip(F, H, strict=True)) + "\n")
    with pytest.raises(InputError, match="ends in x or y"):
        read_hammer(path)


@pytest.mark.parametrize("path", sorted(TOOLINGS.glob("*.toml")), ids=lambda p: p.stem)
def test_the_projects_toolings_keep_everything_else(path, tmp_path):
    out = tmp_path / "C.toml"
    write_calibrated_tooling(path, out, FOUND, STD, ["from taps"])
    before, after = read_tooling(path), read_tooling(out)
    assert after.assembly.tool == before.assembly.tool
    assert after.assembly.holder == before.assembly.holder
    np.testing.assert_array_equal(after.cutter.pitch, before.cutter.pitch)
    for name in Contact.__slots__:
        assert getattr(after.assembly.contact, name) == pytest.approx(getattr(FOUND, name), rel=1e-5)
    # what stood there in words stays, outside the contact
    kept = [line for line in path.read_text().split("[contact]")[0].splitlines() if line]
    assert all(line in out.read_text() for line in kept)
    # how well it is calibrated, the worse of two; what the file says of the rest is as it was
    assert (after.spread.contact_stiffness, after.spread.contact_damping) == (0.12, 2.4)
    assert replace(after.spread, contact_stiffness=0.0, contact_damping=0.0) == before.spread


@pytest.mark.parametrize(
    "spread",
    ["[spread]\n", "[spread]\ncontact_stiffness_percent = 70 # assumed\n", "spread = {}\n", "spread.contact_damping_percent = 100\n"],
)
def test_a_calibrated_contact_is_known_as_well_as_the_taps_say(spread, tmp_path):
    path, out = tmp_path / "T.toml", tmp_path / "C.toml"
    path.write_text(HEAD + spread if spread.startswith("[") else spread + HEAD)
    write_calibrated_tooling(path, out, FOUND, STD)
    assert read_tooling(out).spread == Spread(contact_stiffness=0.12, contact_damping=2.4)


HEAD = """\
name = "T"
[cutter]
teeth = 2
diameter_mm = 12.0
[tool]
stickout_mm = 60.0
segments = [ { length_mm = 100.0, outer_diameter_mm = 12.0, material = "carbide" } ]
[holder]
insertion_mm = 40.0
segments = [ { length_mm = 60.0, outer_diameter_mm = 50.0, inner_diameter_mm = 12.0, material = "steel" } ]
"""
OLD = "translational_stiffness = 1e10\nrotational_stiffness = 1e5\n"
REST = "# of the shop\n[materials.carbide]\nyoungs_modulus_gpa = 580.0\n"


def test_a_contact_in_the_middle_and_none_at_all(tmp_path):
    path, out = tmp_path / "T.toml", tmp_path / "C.toml"
    for text in (HEAD, HEAD + "[contact]\n" + OLD + "\n" + REST, HEAD + REST):
        path.write_text(text)
        write_calibrated_tooling(path, out, FOUND, STD)
        read = read_tooling(out)
        assert read.assembly.contact.translational_stiffness == pytest.approx(1.234567e10)
        assert bool(re.search(r"# of the shop\s+\[materials.carbide\]", out.read_text())) == (REST in text)
        assert (read.assembly.tool[0].material.youngs_modulus == 580e9) == (REST in text)


@pytest.mark.parametrize(
    "contact",
    [
        "contact.translational_stiffness = 1e10\ncontact.rotational_stiffness = 1e5\n",
        "contact = { translational_stiffness = 1e10, rotational_stiffness = 1e5 }\n",
        '"contact" = { translational_stiffness = 1e10, "rotational_stiffness" = 1e5 }  # old\n',
    ],
)
def test_a_contact_written_in_any_form(tmp_path, contact):
    path, out = tmp_path / "T.toml", tmp_path / "C.toml"
    path.write_text("# Ü, of the shop\n" + contact + HEAD)
    write_calibrated_tooling(path, out, FOUND, STD, ["from taps"])
    read = read_tooling(out).assembly
    assert read.contact.rotational_damping == pytest.approx(FOUND.rotational_damping, rel=1e-7)
    text = out.read_text(encoding="utf-8")
    assert "# Ü, of the shop" in text
    assert HEAD in text
    assert text.count("translational_stiffness") == 1


def test_what_is_no_tooling_leaves_the_other_file_alone(tmp_path):
    path, out = tmp_path / "T.toml", tmp_path / "C.toml"
    path.write_text(HEAD.replace("teeth = 2", "teeth = 0"))
    out.write_text("old")
    with pytest.raises(InputError, match="teeth"):
        write_calibrated_tooling(path, out, FOUND, STD)
    assert out.read_text() == "old"
