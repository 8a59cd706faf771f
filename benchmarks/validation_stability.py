"""Published stability limits, multipliers, deflections and forces, and those that other programs have computed of published cases."""

from __future__ import annotations

from functools import cache, partial

import numpy as np

from benchmarks.published_modes import study
from benchmarks.robot_milling import ALUMINIUM, LENGTH, POSTURE, PUBLISHED, SIDES, feed
from benchmarks.robot_milling import row as table_row
from benchmarks.validation_case import Case, Measure
from rcsa_ident.cutting.deflection import deflected_edge, deflected_process
from rcsa_ident.cutting.materials import material
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.front.samples import sample_robot
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.stability.discretisation import FullDiscretisation, SemiDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.methods import StabilityMethod
from rcsa_ident.stability.monodromy import MonodromyOperator
from rcsa_ident.stability.multi_frequency import MultiFrequency
from rcsa_ident.stability.multiplier_limits import longest_step
from rcsa_ident.stability.tip_modes import TipModes
from rcsa_ident.stability.zero_order import ZeroOrder
from rcsa_ident.toolpath.march import mill_block
from rcsa_ident.virtual.limit import true_limit
from rcsa_ident.workflows.paths.robot_milling import arm_carrier, feed_turn
from tests.cutting import test_deflection as bent
from tests.oracles import literature
from tests.stability import mills, shaped_mills, test_unlike_teeth, test_zero_order
from tests.virtual import test_limit

RPM = np.pi / 30.0
ONE, TWO = mills.tip(mills.ONE), mills.tip(mills.TWO)
SPECTRAL = "Chebyshev spectral elements of another program"
#: Columns of the table of limits of a tool that the cut bends.
DEFORMED = ("without anything", "with deflection", "with process damping", "with both")


def multipliers(name: str, immersion: float, strategy: str) -> list[float]:
    """Spectral radius at 5000 rev/min and four depths, polynomials of degree 6 in 12 steps a tooth."""
    cut = MonodromyOperator(ONE if name == "one" else TWO, mills.mill(2, immersion, strategy), 6)
    speed = literature.MULTIPLIER_RPM * RPM
    step = np.pi / speed / 12.0
    return [abs(cut.multiplier(speed, 1e-3 * depth, step, residual=1e-9).value) for depth in literature.MULTIPLIER_DEPTH_MM]


def slot_limits(name: str, method: StabilityMethod) -> np.ndarray:
    """Limits of the slot at eight speeds [mm]."""
    tip = ONE if name == "one" else TWO
    return 1e3 * stability_lobes(tip, mills.mill(2, 1.0), literature.LIMIT_RPM * RPM, 30e-3, method).limit_depth


def marched_limits(freedoms: int) -> list[float]:
    """Limits of the slot at five speeds by the virtual machine's own march [mm]."""
    found = []
    for rpm, exact in zip(test_limit.SLOT_RPM, test_limit.SLOT_LIMIT_MM[freedoms], strict=True):
        bracket = 0.35e-3 * exact, 2.6e-3 * exact
        machine = test_limit.published(freedoms)
        found.append(1e3 * true_limit(machine, test_limit.MILL, test_limit.cut(rpm), test_limit.STEEL, bracket, 1e-4).depth)
    return found


def four_modes() -> np.ndarray:
    """Limits of the mill with three modes in x and one in y [mm]."""
    process = mills.mill(4, 0.5, coefficients=mills.FOUR_COEFFICIENTS)
    speeds = literature.FOUR_MODES["rpm"] * RPM  # type: ignore[operator]
    return 1e3 * stability_lobes(mills.tip(mills.FOUR), process, speeds, 30e-3, FullDiscretisation()).limit_depth


@cache
def zero_order(name: str) -> tuple[float, float]:
    """Least limit [mm] of the symmetric mill and its chatter frequency [Hz], by the closed form."""
    process = mills.mill(2, 1.0 if name == "slot" else 0.5, "up")
    found = stability_lobes(test_zero_order.tip(test_zero_order.symmetric), process, np.linspace(4000.0, 25000.0, 200) * RPM, 1.0)
    assert found.absolute_limit is not None
    assert found.absolute_frequency is not None
    return 1e3 * found.absolute_limit, found.absolute_frequency / (2.0 * np.pi)


def zero_order_slot() -> np.ndarray:
    """Zero-order limits of the slot at eight speeds [mm]."""
    tip = test_zero_order.tip(test_zero_order.symmetric)
    return 1e3 * stability_lobes(tip, mills.mill(2, 1.0), literature.ZERO_ORDER_SLOT_RPM * RPM, 1.0, ZeroOrder()).limit_depth


def multi_frequency() -> np.ndarray:
    """Limits of the slot with one mode from its receptance alone, at eight speeds [mm]."""
    band = 2.0 * np.pi * np.arange(2.0, 12000.0, 2.0)
    tip = test_zero_order.tip(lambda w: test_zero_order.symmetric(w) * np.diag([1.0, 0.0]), band)
    return 1e3 * stability_lobes(tip, mills.mill(2, 1.0), literature.LIMIT_RPM * RPM, 30e-3, MultiFrequency()).limit_depth


def unlike_pitch() -> np.ndarray:
    """Limits of four teeth at 84/96/84/96 degrees [mm]."""
    return 1e3 * test_unlike_teeth.limits(FullDiscretisation(), pitch=test_unlike_teeth.UNEQUAL).limit_depth


def shaped(*names: str) -> tuple[float, ...]:
    """Expected limits of cuts with a shape [mm]."""
    return tuple(limit for name in names for limit in shaped_mills.LIMITS[name][3])


def shaped_limits(*names: str) -> np.ndarray:
    """Limits of these cuts by full discretisation [mm]."""
    found = []
    for process, tip, rpm, _ in (shaped_mills.LIMITS[name] for name in names):
        method = FullDiscretisation(tolerance=2e-4)
        found.append(1e3 * stability_lobes(tip, process, np.array(rpm) * RPM, shaped_mills.deepest(process), method).limit_depth)
    return np.concatenate(found)


def shaped_multipliers() -> list[float]:
    """Magnitudes of twelve multipliers of cuts with a shape."""
    found = []
    for process, tip, rpm, depth, _ in shaped_mills.MULTIPLIERS:
        cut = FullDiscretisation(tolerance=2e-4).monodromy(tip, process)
        found.append(abs(cut.multiplier(rpm * RPM, 1e-3 * depth, 0.5 * longest_step(cut), residual=1e-8).value))
    return found


def rougher() -> np.ndarray:
    """Limits of a serrated edge at three feeds and four speeds [mm]."""
    speeds, method = np.array(shaped_mills.ROUGHER_SPEEDS) * RPM, FullDiscretisation(tolerance=1e-3)
    tip, found = shaped_mills.tip(shaped_mills.M1[:2]), []
    for process in (shaped_mills.rougher(1e-3 * mm) for mm in shaped_mills.ROUGHER):
        found.append(1e3 * stability_lobes(tip, process, speeds, shaped_mills.deepest(process), method).limit_depth)
    return np.concatenate(found)


@cache
def deformed(column: int, shapes: bool) -> np.ndarray:
    """A column of the limits of a tool that the cut bends [mm]."""
    models = {}
    for axis, name in ((Dof.X, "x"), (Dof.Y, "y")):
        frequency, zeta, shape = bent.T[name]
        models[axis] = normal_modes(np.array([2.0 * np.pi * frequency]), np.array([zeta]), shape[:1, None], (Coordinate("tip", axis),))
    tip = TipModes.of(models)
    if shapes:
        along = np.stack([bent.T[name][2] / bent.T[name][2][0] for name in ("x", "y")], axis=1)
        tip = TipModes(tip.pole, tip.outputs, tip.inputs, tip.constant, bent.T["heights"], along)
    process = bent.WORN if column >= 2 else bent.BARE
    process = deflected_process(process, bent.TOOL) if column % 2 else process
    table = literature.DEFORMED_LIMIT_WITH_SHAPES_MM if shapes else literature.DEFORMED_LIMIT_MM
    return 1e3 * stability_lobes(tip, process, np.array(list(table)) * RPM, 20e-3, FullDiscretisation()).limit_depth


def gain() -> float:
    """By how much deflection and process damping lift the limit at 8200 rev/min [%]."""
    at = list(literature.DEFORMED_LIMIT_MM).index(8200.0)
    return float(100.0 * (deformed(3, False)[at] / deformed(0, False)[at] - 1.0))


def deflections() -> list[float]:
    """Deflection of the tip where it makes the wall, over the depth, at 10 000 rev/min [mm]."""
    depths = literature.TIP_DEFLECTION_MM
    return [1e3 * bent.at_the_tip(deflected_edge(bent.BARE, bent.TOOL, 10_000.0 * RPM, 1e-3 * depth)) for depth in depths]


def entry() -> float:
    """By how much the tip enters later [deg]."""
    edge = deflected_edge(bent.BARE, bent.TOOL, 10_000.0 * RPM, bent.PLATEAU)
    return float(np.degrees(edge.start[0] - bent.DOWN.entry))


@cache
def robot_row(name: str) -> np.ndarray:
    """A row of the table of forces of a robot that mills [N]: min Fx, min Fy, max Fx, mean Fx, mean Fy, rms Fx, rms Fy."""
    arm = FlexibleRobot(sample_robot("tx200"), tilts=name in ("orthogonal springs", "play"))
    turn = feed_turn(arm, POSTURE, np.array([1.0, 0.0, 0.0]))
    carrier = arm_carrier(arm, POSTURE, turn, play=name == "play", weight=name == "weight, compensated")
    return table_row(mill_block(carrier, ALUMINIUM, LENGTH, SIDES, feed(ALUMINIUM, 3700.0))[0])


def peak(sign: int) -> float:
    """Frequency of the strongest peak of tooling 2 along Y with the printed modes [Hz]."""
    (case,) = (each for each in study() if (each["sign"], each["axis"], each["tooling"]) == (sign, "Y", 2))
    return float(case["peaks_hz"][int(np.argmax(case["peaks_um_per_n"]))])


def coefficients() -> list[float]:
    """K_tc and K_rc of three published materials [MPa]."""
    found = [material(name).coefficients for name in ("EN AW-7075-T6", "5A06 aluminium", "Steel St 52-3 (S355)")]
    return [1e-6 * value for each in found for value in (each.tangential, each.tangential * each.radial_ratio)]


_FULL, _SHAPED = "tests/stability/test_full_discretisation.py", "tests/stability/test_shaped_mills.py"
_TWO_ROADS = "Hill's determinant and a marched multiplier of another program, which agree to 1e-4"
_ROBOT = "tests/workflows/paths/test_robot_milling.py::test_forces_are_those_of_the_published_simulation"
_KINDS = {
    "45° face mill": ("A", "A, Z rigid", "A, Z soft", "A, corner", "A Ø100", "A Ø160"),
    "45° face mill whose tip tilts": ("A, slope -4", "A, slope -7", "A Ø100, slope -7", "A Ø160, slope -7"),
    "high feed": ("B", "B, Z rigid", "B, Z soft", "B, stepover", "B, stepover, Z rigid"),
    "ball": ("C", "C, Z rigid", "C, Z soft", "C, deep", "C, block"),
    "bull nose": ("D", "D, Z rigid", "D, Z soft"),
    "helix of each tooth, unequal pitch": ("E A", "E B", "E B, pitch alone"),
    "cutter of variable pitch [altintas1999]": ("G", "G, helix, too", "G, helix alone"),
}
CASES = (
    *(
        Case(
            f"multipliers of the two-tooth mill, {name} mode{'s' if name == 'two' else ''}, "
            f"{'slot' if immersion == 1.0 else f'half immersion, {strategy}-milling'}",
            f"mill of [insperger2004]; {SPECTRAL}",
            values,
            partial(multipliers, name, immersion, strategy),
            "",
            1e-5,
            "tests/stability/test_monodromy.py::test_published",
        )
        for (name, immersion, strategy), values in literature.MULTIPLIERS.items()
    ),
    *(
        Case(
            f"limits of its slot at eight speeds, {name} mode{'s' if name == 'two' else ''}, {how}",
            f"mill of [insperger2004]; {SPECTRAL}",
            values,
            partial(slot_limits, name, method),
            "mm",
            allowed,
            test,
            slow=how != "full discretisation",
        )
        for name, values in literature.SLOT_LIMIT_MM.items()
        for how, method, allowed, test in (
            ("full discretisation", FullDiscretisation(), 5e-4, f"{_FULL}::test_published_slot"),
            ("full discretisation of first order [ding2010]", FullDiscretisation(degree=1), 5e-4, f"{_FULL}::test_published_slot"),
            ("semi-discretisation", SemiDiscretisation(), 5e-4, "tests/stability/test_semi_discretisation.py"),
        )
    ),
    Case(
        "the same, one mode, by the multi-frequency method from the receptance",
        f"[merdol2004], mill of [insperger2004]; {SPECTRAL}",
        literature.SLOT_LIMIT_MM["one"],
        multi_frequency,
        "mm",
        1e-3,
        "tests/stability/test_multi_frequency.py",
        slow=True,
    ),
    *(
        Case(
            f"the same at five speeds, {freedoms} mode{'s' if freedoms == 2 else ''}, by the virtual machine's own march",
            f"mill of [insperger2004]; {SPECTRAL}",
            test_limit.SLOT_LIMIT_MM[freedoms],
            partial(marched_limits, freedoms),
            "mm",
            4e-4,
            "tests/virtual/test_limit.py::test_published_limits",
            slow=True,
        )
        for freedoms in (1, 2)
    ),
    Case(
        "limits of a mill with three modes in x and one in y, half immersion, four speeds",
        f"mill of [gradisek2005]; {SPECTRAL}",
        literature.FOUR_MODES["limit_mm"],
        four_modes,
        "mm",
        5e-4,
        f"{_FULL}::test_published_case_of_four_modes",
    ),
    *(
        Case(
            f"zero-order least limit, two modes, {name}: {what}",
            "mill of [insperger2004], closed form of [altintas1995] by another program",
            literature.ZERO_ORDER_MINIMUM[name][k] * (1e3 if k == 0 else 1.0),
            lambda name=name, k=k: zero_order(name)[k],  # type: ignore[misc]
            unit,
            allowed,
            "tests/stability/test_zero_order.py::test_published_minimum",
        )
        for name in ("slot", "half")
        for k, (what, unit, allowed) in enumerate((("depth", "mm", 2e-4), ("chatter frequency", "Hz", 2e-5)))
    ),
    Case(
        "zero-order limits of the slot at eight speeds, two modes",
        "mill of [insperger2004], closed form of [altintas1995] by another program",
        literature.ZERO_ORDER_SLOT_LIMIT_MM,
        zero_order_slot,
        "mm",
        3e-3,
        "tests/stability/test_zero_order.py::test_published_slot_table",
    ),
    Case(
        "limits of four teeth at 84/96/84/96°, helix 39.5°, two speeds",
        "two other programs",
        [3.4761, 4.9347],
        unlike_pitch,
        "mm",
        1e-3,
        "tests/stability/test_unlike_teeth.py::test_two_alternating_pitches",
    ),
    *(
        Case(
            f"limits of shaped cutters: {kind}, {len(shaped(*names))} speeds",
            _TWO_ROADS,
            shaped(*names),
            partial(shaped_limits, *names),
            "mm",
            4e-4,
            f"{_SHAPED}::test_full_discretisation",
            slow=True,
        )
        for kind, names in _KINDS.items()
    ),
    Case(
        "multipliers of shaped cutters, twelve cuts",
        _TWO_ROADS,
        [each[-1] for each in shaped_mills.MULTIPLIERS],
        shaped_multipliers,
        "",
        2e-5,
        f"{_SHAPED}::test_multipliers",
        slow=True,
    ),
    Case(
        "limits of a serrated edge, three feeds, four speeds",
        "the same roads, which agree to 4e-3 there",
        [limit for limits in shaped_mills.ROUGHER.values() for limit in limits],
        rougher,
        "mm",
        6e-3,
        f"{_SHAPED}::test_a_serrated_edge",
        slow=True,
    ),
    *(
        Case(
            f"limits of a tool that the cut bends, {what}, {'measured shapes, two' if shapes else 'six'} speeds",
            "data of [du2023], diameter and compliance chosen; another program",
            [row[column] for row in table.values()],
            partial(deformed, column, shapes),
            "mm",
            1e-2,
            "tests/stability/test_deflected_tool.py::test_published_limits",
            slow=True,
        )
        for shapes, table in ((False, literature.DEFORMED_LIMIT_MM), (True, literature.DEFORMED_LIMIT_WITH_SHAPES_MM))
        for column, what in enumerate(DEFORMED)
    ),
    Case(
        "deflection and process damping lift the limit at 8200 rev/min",
        "[du2023], the text: by 25 %",
        25.0,
        gain,
        "%",
        3.0,
        "tests/stability/test_deflected_tool.py::test_published_limits",
        Measure.ABSOLUTE,
        slow=True,
    ),
    Case(
        "deflection of the tip at seven depths, 10 000 rev/min",
        "data of [du2023], diameter and compliance chosen; another program",
        list(literature.TIP_DEFLECTION_MM.values()),
        deflections,
        "mm",
        5e-3,
        "tests/cutting/test_deflection.py::test_published_deflection",
    ),
    Case(
        "later entry of the bent tip",
        "[du2023], the text: above 1°",
        1.0,
        entry,
        "deg",
        0.0,
        "tests/cutting/test_deflection.py::test_entry_shifts_by_more_than_a_degree_and_grows_no_further",
        Measure.AT_LEAST,
    ),
    *(
        Case(
            f"robot that mills aluminium, {name}: {what}",
            "[huynh2018], table 10, simulation",
            [PUBLISHED[name][k] for k in columns],
            lambda name=name, columns=columns: robot_row(name)[list(columns)],  # type: ignore[misc]
            "N",
            allowed,
            _ROBOT,
            slow=True,
        )
        for name, mean in (("basic", 0.01), ("orthogonal springs", 0.01), ("play", 0.015))
        for what, columns, allowed in (
            ("mean and rms of Fx and Fy", (3, 4, 5, 6), mean),
            ("largest Fx, smallest Fy", (2, 1), 0.05),
        )
    ),
    Case(
        "cutting coefficients of three materials as the package ships them, K_tc and K_rc",
        "[duan2021], table 5; [du2023]; [huynh2018]",
        [767.01, 168.8, 855.0, 270.93, 3333.0, 2289.0],
        coefficients,
        "MPa",
        2e-3,
        "tests/cutting/test_materials.py::test_published_numbers",
    ),
)
