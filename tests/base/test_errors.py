"""Errors that a user can act on."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError, RcsaIdentError, Unsteady, non_negative, positive


def test_the_message_names_field_found_and_allowed():
    error = InputError("stickout", "7 furlongs", "a length [mm]")
    assert str(error) == "stickout: found 7 furlongs, allowed is a length [mm]"
    assert str(error.at("S1.toml")) == "S1.toml: stickout: found 7 furlongs, allowed is a length [mm]"
    assert isinstance(error, RcsaIdentError)
    assert isinstance(error, ValueError)
    assert len(str(InputError("pitch", list(range(1000)), "fewer"))) < 200


@pytest.mark.parametrize("kind", [InputError, Unsteady])
def test_errors_cross_processes(kind):
    error = kind("stickout", 7, "a length [mm]", "S1.toml")
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error)
    # what is done about an error depends on its kind, which neither a process nor a file's name changes
    assert type(again) is type(again.at("S2.toml")) is kind
    assert (again.field, again.found, again.allowed, again.where) == ("stickout", 7, "a length [mm]", "S1.toml")


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf, True, "twelve", None, [1.0]])
def test_positive_refuses(value):
    with pytest.raises(InputError, match=r"speed: found .*greater than 0 \[rad/s\]"):
        positive("speed", value, "rad/s")


def test_numbers_pass_as_floats():
    assert positive("speed", np.float64(3.0)) == 3.0
    assert positive("speed", "2.5") == 2.5
    assert isinstance(positive("teeth", 4), float)
    assert non_negative("helix", 0) == 0.0
    with pytest.raises(InputError, match="0 or more"):
        non_negative("helix", -1e-9)
