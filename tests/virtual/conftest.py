from pathlib import Path

import pytest

from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.virtual.reduction import poles, reduced
from rcsa_ident.virtual.rotor import rotor

MACHINES = Path(__file__).parents[2] / "data" / "machines"


@pytest.fixture(scope="session")
def machines_folder():
    return MACHINES


@pytest.fixture(scope="session")
def hpm():
    return read_machine(MACHINES / "hpm.toml")


@pytest.fixture(scope="session")
def tooling(hpm):
    return read_tooling(hpm.toolings[0])


@pytest.fixture(scope="session")
def model(hpm, tooling):
    return rotor(hpm.spindle, tooling.assembly)


@pytest.fixture(scope="session")
def dynamics(model):
    return poles(reduced(model))
