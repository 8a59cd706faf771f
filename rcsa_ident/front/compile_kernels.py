"""Small jobs that call every kernel in the signatures that the commands use, so that all are compiled and cached.

Several processes may do them at once. numba's cache survives two of them that compile the same kernel for the same types; for different
types one's code might end under the other's name. So the steps whose kernels others call come first, and of the rest those that call
kernels of the same file stay in one process.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import force_and_slope
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.dynamics.poles import PoleResidue
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.turning_modes import TurningModes
from rcsa_ident.identification.cut_data import prepare
from rcsa_ident.identification.data import IdentificationData
from rcsa_ident.identification.evidence import EvidenceSelection
from rcsa_ident.identification.genetic_algorithm import PaperGeneticAlgorithm
from rcsa_ident.identification.machine import IdentifiedMachine
from rcsa_ident.identification.posterior import MachineAxis, Posterior
from rcsa_ident.identification.search import SearchSettings
from rcsa_ident.identification.unknowns import ModalBlock
from rcsa_ident.machine.mode_synthesis import FLANGE
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.machine.robot.inertia import accelerations
from rcsa_ident.machine.robot.kinematics import posed
from rcsa_ident.machine.robot.model import Body, Frame, Joint, RobotModel
from rcsa_ident.machine.spindle import Spindle
from rcsa_ident.machine.turning_machine import TurningMachine
from rcsa_ident.observer.force_model import AxisNoise, RandomWalk, augmented
from rcsa_ident.observer.kalman import kalman_filter
from rcsa_ident.observer.transfer_function import SampledModes
from rcsa_ident.signals.frf import AxisLines
from rcsa_ident.signals.measurement import CutMeasurement, measure_cut
from rcsa_ident.signals.recording import Quantity, Recording, Sensor
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.time_domain import TimeDomain
from rcsa_ident.stability.tip_modes import TipModes
from rcsa_ident.stability.zero_order import ZeroOrder
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, Contact, ToolAssembly
from rcsa_ident.tool_holder.model import tool_holder_receptance
from rcsa_ident.toolpath.dexel import DexelField
from rcsa_ident.toolpath.engagement import engagement_along
from rcsa_ident.toolpath.march import Carrier
from rcsa_ident.toolpath.path import ToolPath
from rcsa_ident.toolpath.path_march import MarchOptions, mill_along
from rcsa_ident.toolpath.removal import Sweep, made_by
from rcsa_ident.toolpath.solid import ToolSolid
from rcsa_ident.virtual.milling import mill_cut
from rcsa_ident.virtual.reduction import Poles
from rcsa_ident.workflows.listen import listen_to
from rcsa_ident.workflows.robot_postures import at_posture

_CUTTER = Cutter(2, 0.012)
_COEFFICIENTS = CuttingCoefficients(9e8, 0.3)
_SPEED = 200.0 * np.pi
_CONDITIONS = CuttingConditions(_SPEED, 1e-4, 1e-4, Engagement.from_immersion(0.5, "down"))


def _assembly() -> ToolAssembly:
    steel = MATERIALS["steel"]
    return ToolAssembly((BeamSegment(0.08, 0.012, steel),), (BeamSegment(0.05, 0.05, steel, 0.012),), 0.03, Contact(2e10, 6e5, 6e4, 9.0))


def _tool_holder() -> None:
    tool_holder_receptance(_assembly(), 2.0 * np.pi * np.linspace(100.0, 2000.0, 20))


def _force_lines() -> None:
    force_and_slope(_CUTTER, _CONDITIONS, _COEFFICIENTS, 2 * np.arange(1, 6))


def _recordings() -> None:
    rng = np.random.default_rng(1)
    rate, time = 20000.0, np.arange(4000) / 20000.0
    cut, air = (1e-6 * np.sum([np.cos(m * _SPEED * time) for m in range(1, 9)], axis=0) for _ in range(2))
    both = (Sensor("x", Quantity.DISPLACEMENT, Dof.X), Sensor("y", Quantity.DISPLACEMENT, Dof.Y))
    # one channel and several lie differently in memory
    for sensors in (both[:1], both):
        records = []
        for each in (cut, 0.1 * air):
            records.append(Recording(rate, each[:, None] + 1e-9 * rng.standard_normal((each.size, len(sensors))), sensors))
        measure_cut("warm", "warm", records[0], records[1], _CUTTER, _CONDITIONS, _COEFFICIENTS)


def _listening() -> None:
    rng = np.random.default_rng(1)
    time = np.arange(24000) / 12000.0
    angle = _SPEED * time * (1.0 + 1e-3 * time)
    # chatter beside the orders, so that its sidebands are searched, too
    sound = np.cos(2.0 * angle) + 0.3 * np.cos(angle) + np.cos(2.0 * np.pi * 1234.0 * time) + 0.01 * rng.standard_normal(time.size)
    for channels in ([sound], [sound, 0.5 * sound]):
        listen_to(12000.0, channels, Quantity.SOUND)


def _lines(outputs: int) -> IdentificationData:
    """Lines of a few cuts at several speeds with a trigger, the flange's motion alone or gap and fixture."""
    rng = np.random.default_rng(1)
    measurements = []
    for k in range(4):
        speed = _SPEED * (1.0 + 0.1 * k)
        order = 2 * np.arange(1, 6)
        value = 1e-8 * (rng.standard_normal((5, outputs)) + 1j * rng.standard_normal((5, outputs)))
        force, slope = force_and_slope(_CUTTER, _CONDITIONS, _COEFFICIENTS, order)
        variance = np.full((5, outputs), 1e-20)
        lines = AxisLines(order, order * speed, value, 0.1 * value, variance, np.ones(5), force[:, 0], slope[:, 0])
        measurements.append(CutMeasurement(f"{k}", "warm", speed, {Dof.X: lines}, 0.01, 1e-3, 1e-6, tooth_angle_known=False))
    assembly = _assembly()

    def receptance(omega: FloatArray) -> Receptance:
        return tool_holder_receptance(assembly, omega)

    return prepare(measurements, {"warm": receptance}, {"warm": 2}, (0.05, 0.05, 0.0, 0.0))


def _default_method() -> None:
    method = EvidenceSelection(search=SearchSettings(modes=3, population=4, generations=1, steps=1), candidates=1)
    for outputs in (1, 2):
        # uncertain forces, an unknown tooth angle and stiffness that changes with speed come in with the last polish
        method.run(_lines(outputs), 1)


def _paper_method() -> None:
    PaperGeneticAlgorithm(population=4, generations=1).run(_lines(1), 1)


def _tip() -> TipModes:
    model = normal_modes(np.array([5000.0]), np.array([0.05]), np.ones((1, 1)), (Coordinate("tip", Dof.X),))
    return TipModes.of({Dof.X: model})


def _lobes() -> None:
    tip = _tip().receptance()
    speeds = np.linspace(800.0, 1000.0, 3)
    unlike = Cutter(2, 0.012, 0.0, np.array([3.0, 2.0 * np.pi - 3.0]))
    # and of shapes, whose limits are marched through depths
    for cutter in (_CUTTER, unlike, *(replace(each, profile=Profile.ball(0.012)) for each in (_CUTTER, unlike))):
        process = MillingProcess(cutter, _COEFFICIENTS, _CONDITIONS.engagement)
        stability_lobes(tip, process, speeds, 0.01)
        # and of machines that were drawn, for bands
        ZeroOrder().depths(tip.omega, tip.values[None], process, speeds, 0.01)


def _tips() -> None:
    """The tip of a tooling on a machine with a posterior, as every tool change asks for it."""
    layout = ModalBlock(2)
    theta = np.concatenate([np.log([5000.0, 9000.0]), np.full(layout.size - 2, 0.1), np.log([2e9, 5e6, 1e4, 10.0])])
    posterior = Posterior(theta, 1e-6 * np.eye(theta.size), layout)
    axis = MachineAxis(Spindle(posterior.machine(Dof.X)[0]), posterior.machine(Dof.X)[1], posterior)
    machine = IdentifiedMachine({Dof.X: axis}, (2000.0, 8000.0))
    assert machine.tip(_assembly()).thinned().spread.size
    shapes, none = np.array([[0.1, 1.0, 0.0, 0.0], [0.0, 0.0, 0.1, 1.0]]), np.zeros((4, 4))
    modes = TurningModes(np.array([5000.0, 5000.0]), 500.0 * np.eye(2), np.array([[0.0, -0.1], [0.1, 0.0]]), shapes, none, _SPEED, FLANGE)
    TurningMachine(modes, (2000.0, 8000.0), (500.0, 1000.0), LumpedJoint(2e9, 5e6)).tip(_assembly())


def _robot() -> None:
    """An arm at a posture, and what its torques move."""
    x, rod = np.array([1.0, 0.0, 0.0]), Body(50.0, np.array([0.0, 0.0, 0.5]), np.diag([4.0, 4.0, 0.5]))
    arm = RobotModel("warm", (Joint("J1", Frame(), x, rod, 1e6, 200.0),), Frame(offset=np.array([0.0, 0.0, 1.0])))
    at_posture(FlexibleRobot(arm), np.zeros(1))
    accelerations(posed(arm, np.zeros(1)), np.zeros(1), np.zeros(1), arm.gravity)


def _removal() -> None:
    """Level, in a thin layer, down a ramp and leaning, out of the inside of a surface."""
    block = DexelField.block(np.zeros(3), np.array([0.02, 0.02, 0.01]), 2e-3)
    field, solid = DexelField.from_mesh(*block.mesh(), 2e-3), ToolSolid.of(_CUTTER, 0.02)
    places = np.array([[0.0, 0.0, 0.0099], [0.01, 0.01, 0.0099], [0.01, 0.01, 0.005], [0.02, 0.01, 0.004], [0.02, 0.02, 0.004]])
    axes = np.array([[0.0, 0.0, 1.0]] * 4 + [[0.1, 0.0, 1.0]])
    engagement_along(Sweep(field, solid, ToolPath(places, axes=axes)))


def _milling_in_time() -> None:
    """Around a bend, on springs."""
    places = np.array([[0.0, 0.01, 0.005], [0.004, 0.01, 0.005], [0.008, 0.0101, 0.005]])
    path = ToolPath(places, feed=np.full(3, 0.5), speed=np.full(3, 3000.0))
    sweep = Sweep(DexelField.block(np.zeros(3), np.array([0.02, 0.02, 0.01]), 2e-3), ToolSolid.of(_CUTTER, 0.02), path)
    springs = Carrier(np.eye(3), np.eye(3), np.full(3, 1e6), np.eye(3))
    for part in mill_along(sweep, _CUTTER, _COEFFICIENTS, lambda move, frame: springs, MarchOptions(60, 1e-4)):
        made_by(part.places, path, np.arange(2), 0.01, 0.01)


def _lobes_in_time() -> None:
    process, speeds = MillingProcess(_CUTTER, _COEFFICIENTS, _CONDITIONS.engagement), np.array([900.0])
    for method in (FullDiscretisation(), TimeDomain(periods=20)):
        stability_lobes(_tip(), process, speeds, 1e-3, method)


def _observer() -> None:
    plant = SampledModes(np.array([0.9 + 0.2j]), np.array([1e-8 + 0.0j]), 0.0, 1e-4)
    measured = plant.run(plant.init(), np.zeros(8))[1]
    # an axis alone, and two that feel each other
    both = PoleResidue(plant.decay, np.array([[1e-8], [1e-9]]) + 0.0j, np.array([[1.0 + 0.0j, 0.1 + 0.0j]]), np.zeros((2, 2)))
    for poles, axes in ((plant.pole_residue(), 1), (both, 2)):
        kalman = kalman_filter(augmented(poles, [AxisNoise(RandomWalk(10.0, 100.0), 1e-8)] * axes, 1e-4), 2)
        kalman.smooth(kalman.run(kalman.init(), np.stack([measured] * axes, axis=1))[1])


def _virtual_machine() -> None:
    places = [f"{place}.{axis}" for place in ("tip", "flange", "fixture") for axis in "xy"]
    pole = np.array([-100.0 + 5000.0j, -100.0 + 6000.0j])
    shape = np.array([[0.01 - 0.01j, 0.0], [0.0, 0.01 - 0.01j]])
    outputs = np.concatenate([shape, 0.1 * shape, 0.01 * shape])
    dynamics = Poles(pole, shape, outputs, tuple(Coordinate.parse(place) for place in places))
    mill_cut(dynamics, _CUTTER, _CONDITIONS, _COEFFICIENTS, 5e-6, 200)


#: Name and job, in the order of the chain.
STEPS: dict[str, Callable[[], None]] = {
    "tool-holder": _tool_holder,
    "force lines": _force_lines,
    "tips": _tips,
    "recordings": _recordings,
    "listening": _listening,
    "default method": _default_method,
    "paper's method": _paper_method,
    "lobes": _lobes,
    "lobes in time": _lobes_in_time,
    "robot": _robot,
    "material removal": _removal,
    "milling in time": _milling_in_time,
    "force observer": _observer,
    "virtual machine": _virtual_machine,
}
#: What must be done before the rest.
FIRST = ("tool-holder", "force lines", "tips")
#: The rest, by process, longest first.
TOGETHER = (
    ("material removal", "milling in time"),
    ("lobes in time",),
    ("default method", "paper's method"),
    ("lobes",),
    ("recordings", "listening"),
    ("robot",),
    ("force observer",),
    ("virtual machine",),
)


def compile_steps(names: Sequence[str]) -> dict[str, float]:
    """Do steps one after the other and return how long each took [s]."""
    taken = {}
    for name in names:
        start = time.perf_counter()
        STEPS[name]()
        taken[name] = time.perf_counter() - start
    return taken
