"""Tool-holders that turn on machines that turn: the virtual machine's full equations, and what does not turn left as it was."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.receptance import dissipation
from rcsa_ident.dynamics.turning_modes import TurningModes
from rcsa_ident.machine.flange_machine import FlangeMachine
from rcsa_ident.machine.flange_part import Doubt, FlangePart, JointedFlange, Perturbation
from rcsa_ident.machine.machine import Machine
from rcsa_ident.machine.mode_synthesis import FLANGE
from rcsa_ident.machine.turning_machine import TurningMachine
from rcsa_ident.tool_holder.geometry import stiffened
from rcsa_ident.tool_holder.turning import turning_receptance
from rcsa_ident.virtual.rotor import frequency_response
from tests.fixtures.turning_spindle import flange_modes, joint, tooling, turning_machine, with_tool

OMEGA = 2.0 * np.pi * np.linspace(300.0, 5000.0, 80)
RPM = 2.0 * np.pi / 60.0
TIPS = ("tip.x", "tip.y")


def shares(found: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Norm of each entry's error over the norm of the entry itself."""
    return np.linalg.norm(found - truth, axis=0) / np.linalg.norm(truth, axis=0)


@pytest.mark.parametrize("rpm", [8000.0, 14000.0, 20000.0])
@pytest.mark.parametrize("name", ["S2-PG25", "S4-shrink"])
def test_virtual_machine(name, rpm):
    truth = frequency_response(with_tool(name), OMEGA, rpm * RPM, outputs=TIPS)
    found = turning_machine().at(rpm * RPM).tip(tooling(name), OMEGA, spread=False)
    assert [str(c) for c in found.rows] == list(TIPS)
    # of the cross FRFs, a tenth of the direct ones, too; on the taper of S4 the two meshes differ by more
    assert np.max(shares(found.values, truth)) < (1e-3 if name == "S2-PG25" else 3e-3)
    assert np.max(np.linalg.norm(found.values - truth, axis=0)) < 1e-3 * np.linalg.norm(truth[:, 0, 0])
    # without the moments of tool and holder, or with the wrong sense of rotation, it is another machine
    still = FlangeMachine((flange_modes().at(rpm * RPM),), turning_machine().known, joint()).tip(tooling(name), OMEGA, spread=False)
    assert np.max(shares(still.values, truth)) > 0.02
    other = TurningMachine(flange_modes().at(-rpm * RPM), (1.0, 2.0), (1.0, 2.0), joint()).tip(tooling(name), OMEGA)
    assert shares(other.values, truth)[0, 1] > 1.0


def test_turned_round_it_is_transposed():
    machine = turning_machine()
    one = machine.tip(tooling(), OMEGA).values
    other = replace(machine, modes=machine.modes.at(-machine.turning)).tip(tooling(), OMEGA).values
    size = np.sqrt(np.abs(np.einsum("nii->ni", one)))
    assert np.max(np.abs(one.transpose(0, 2, 1) - other) / size[:, :, None] / size[:, None, :]) < 1e-9
    assert np.min(dissipation(OMEGA, one)) > -1e-6


def test_translations_of_all_ends_are_the_tips():
    machine = turning_machine()
    ends = machine.coupled(tooling(), OMEGA)
    assert len(ends.rows) == 8
    np.testing.assert_allclose(
        ends.block(tuple(machine.tip(tooling(), OMEGA).rows)).values, machine.tip(tooling(), OMEGA).values, rtol=1e-7
    )
    truth = frequency_response(with_tool(), OMEGA, machine.turning, outputs=("flange.x", "flange.y"))
    found = np.stack([np.stack([ends.between(f"spindle.{i}", f"tip.{j}") for j in "xy"], axis=1) for i in "xy"], axis=1)
    assert np.max(shares(found, truth)) < 2e-3


def test_axes_in_the_other_order():
    """A machine whose Y plane is named first answers the same."""
    swapped = [2, 3, 0, 1]
    modes = turning_machine().modes
    other = replace(
        modes, psi=modes.psi[:, swapped], residual=modes.residual[swapped][:, swapped], coordinates=tuple(FLANGE[i] for i in swapped)
    )
    machine = Turned(other, joint(), modes.speed)
    expected = turning_machine().tip(tooling(), OMEGA)
    np.testing.assert_allclose(machine.tip(tooling(), OMEGA).block(expected.rows).values, expected.values, rtol=1e-9)
    expected = turning_machine().coupled(tooling(), OMEGA)
    np.testing.assert_allclose(machine.coupled(tooling(), OMEGA).block(expected.rows).values, expected.values, rtol=1e-9)


@dataclass(frozen=True, eq=False, repr=False)
class Turned(Machine):
    """Modes with what is not known of them."""

    modes: TurningModes
    clamp: object
    speed: float
    steps: tuple[Perturbation, ...] = ()
    rivals: tuple[JointedFlange, ...] = ()

    @property
    def band(self):
        return float(OMEGA[0]), float(OMEGA[-1])

    @property
    def turning(self):
        return self.speed

    @property
    def parts(self):
        doubt = None if not self.steps and not self.rivals else lambda: Doubt(self.steps, self.rivals)
        return (FlangePart(self.modes.coordinates, JointedFlange(self.modes, self.clamp), doubt),)


def doubtful() -> Turned:
    """Modes of an ordinary number, which is all that matters for the spread."""
    rng = np.random.default_rng(5)
    natural, m = 2.0 * np.pi * np.linspace(400.0, 4500.0, 10), 10
    moments = 0.03 * rng.normal(size=(m, m))
    psi = rng.normal(size=(m, 4)) * [0.1, 0.8, 0.1, 0.8]
    modes = TurningModes(natural, np.diag(0.08 * natural), moments - moments.T, psi, np.zeros((4, 4)), 1500.0, FLANGE)

    def changed(step):
        return JointedFlange(replace(modes, psi=psi + step * rng.normal(size=psi.shape) * 0.01), joint())

    steps = tuple(Perturbation(changed(1.0), changed(-1.0), 0.5 + 0.1 * k) for k in range(3))
    return Turned(modes, joint(), 1500.0, steps, (changed(2.0),))


def test_spread_is_that_of_the_plain_coupling():
    machine, assembly = doubtful(), tooling().assembly
    found = machine.tip(tooling(), OMEGA, stiffness_spread=0.01)
    assert found.complete

    def tip(candidate, body=assembly):
        return couple(turning_receptance(body, OMEGA, machine.speed), candidate.flange.receptance(OMEGA), candidate.joint)["tip", "tip"][
            :, ::2, ::2
        ]

    here = tip(machine.parts[0].believed)
    expected = [step.weight * (tip(step.ahead) - tip(step.behind)) for step in machine.steps]
    expected += [tip(machine.rivals[0]) - here, tip(machine.parts[0].believed, stiffened(assembly, 0.01)) - here]
    close = {"rtol": 0.0, "atol": 1e-7 * np.abs(expected).max()}
    np.testing.assert_allclose(found.spread, expected, **close)
    # at some of the frequencies it is what it is at all of them
    thin = found.thinned()
    assert thin.omega.size <= OMEGA.size
    np.testing.assert_allclose(
        thin.spread, found.spread[:, np.searchsorted(OMEGA, thin.omega)], rtol=0.0, atol=1e-7 * np.abs(expected).max()
    )
    coupled = machine.coupled(tooling(), OMEGA)
    assert coupled.spread.shape == (4, OMEGA.size, 8, 8)


def test_what_does_not_turn_has_no_moments():
    assert FlangeMachine((flange_modes(),), (1.0, 2.0)).turning is None


def test_one_plane_cannot_turn():
    modes = flange_modes()
    one = TurningModes(modes.omega_n, modes.damping, modes.gyroscopic, modes.psi[:, :2], np.zeros((2, 2)), 100.0, plane("flange"))
    for ask in ("tip", "coupled"):
        with pytest.raises(InputError, match="both bending planes"):
            getattr(Turned(one, joint(), 100.0), ask)(tooling(), OMEGA)


def test_speeds_and_words():
    machine = turning_machine()
    assert machine.at(None) is machine
    assert machine.at(1.0).turning == machine.speeds[0]
    assert machine.at(1e6).turning == machine.speeds[1]
    assert machine.axes == (Dof.X, Dof.Y)
    assert "6000 to 22000 rev/min" in str(machine)


@pytest.mark.parametrize(("changed", "named"), [({"known": (2.0, 1.0)}, "known"), ({"speeds": (0.0, 1.0)}, "speeds")])
def test_what_cannot_be_is_named(changed, named):
    with pytest.raises(InputError, match=named):
        replace(turning_machine(), **changed)
