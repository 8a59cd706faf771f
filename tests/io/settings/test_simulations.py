"""Campaigns of the virtual machine on disk."""

from __future__ import annotations

from dataclasses import replace

import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.io.settings.simulations import write_simulation
from tests.fixtures import by_hand
from tests.fixtures.paths import MACHINES


@pytest.mark.parametrize("name", ["../T1", "/T1", "=1+1", "-1", "T,1", ".T1"])
def test_a_tooling_that_names_no_file_is_refused(tmp_path, name):
    """Nothing is written, neither where the campaign should lie nor elsewhere."""
    setup = read_machine(MACHINES / "hpm.toml")
    setup = replace(setup, toolings=setup.toolings[:1])
    with pytest.raises(InputError, match="name: found"):
        write_simulation(tmp_path / "in" / "campaign", setup, [replace(by_hand.tooling(), name=name)], (), (), None)
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []
