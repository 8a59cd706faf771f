"""Which channels show the machine's motion along its axes, and what of the flange's and of other places' is in each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.signals.recording import Quantity, Role, Sensor, accelerometers, first_sensor

#: Where the flange's motion, gap and fixture, or the motion of one other place is all that was measured.
FLANGE_ALONE, GAP_AND_FIXTURE, ONE_PLACE = frozen([[1.0]]), frozen([[1.0, -1.0], [0.0, 1.0]]), frozen([[0.0, 1.0]])


def shares_of(of_flange: bool, fixture: bool, housing: int) -> FloatArray:
    """Return what of the flange's motion and of that of e other places is in each output of an axis, shape (o, 1 + e) [-].

    `of_flange`: whether a displacement sensor shows the flange: absolutely, or relative to its fixture
    `fixture`: whether an accelerometer shows the motion of that fixture; it is the second output then, and the first other place
    `housing`: number of accelerometers on the spindle's housing, each at a place of its own, behind these

    Examples
    --------
    A gap sensor, its fixture, and one accelerometer on the housing:

    >>> shares_of(True, True, 1).tolist()
    [[1.0, -1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    shares = np.eye(1 + int(fixture) + housing)
    if fixture:
        shares[0, 1] = -1.0
    return frozen(shares if of_flange else shares[1:])


def usual_shares(outputs: int) -> FloatArray:
    """Return the shares of so many outputs where nobody tells them: one is the flange's motion, two are gap and fixture."""
    return FLANGE_ALONE if outputs == 1 else GAP_AND_FIXTURE


def searched(shares: FloatArray) -> slice:
    """Return the outputs whose sum a search looks for: those that are the flange's motion together, or the first one.

    `shares` [-], shape (o, 1 + e): as `shares_of` returns them
    """
    first, *others = shares[:2].sum(axis=0)
    return slice(0, 2 if shares.shape[0] > 1 and first == 1.0 and not any(others) else 1)


#: Directions of two sensors of one place that lie closer than this to each other tell no motion along the other axis [rad].
_LEAST_APART = float(np.radians(30.0))


@dataclass(frozen=True, slots=True)
class MotionChannels:
    """The channels of a recording that show motion along the machine's axes: each is an output.

    `columns`: of the recording: the axes' own channels, then the accelerations of the displacement sensors' fixture, then further ones of
        the spindle's housing
    `sensors`: of these columns
    `fixed`: number of those of the fixture
    Raises `InputError` if sensors are turned out of the machine's axes, and there are none for the other axis to turn them back with.
    """

    axes: tuple[Dof, ...]
    columns: tuple[int, ...]
    sensors: tuple[Sensor, ...]
    fixed: int

    def __post_init__(self) -> None:
        self._turned_pairs()

    @property
    def of_flange(self) -> bool:
        """Whether the flange's motion is shown, and not the housing's alone."""
        return self.sensors[0].quantity is Quantity.DISPLACEMENT

    @property
    def beside(self) -> bool:
        """Whether accelerometers on the housing stand beside displacement sensors."""
        return self.of_flange and len(self.columns) > len(self.axes) + self.fixed

    def outputs(self, axis: Dof) -> list[int]:
        """Return which of the channels show an axis: its own, its fixture's, those on the housing."""
        return [k for k, sensor in enumerate(self.sensors) if sensor.axis is axis]

    def shares(self, axis: Dof) -> FloatArray:
        """Return what each of these outputs shows, as `shares_of`."""
        fixture = any(sensor.axis is axis for sensor in self.sensors[len(self.axes) : len(self.axes) + self.fixed])
        return shares_of(self.of_flange, fixture, len(self.outputs(axis)) - int(self.of_flange) - int(fixture))

    def searched(self, axis: Dof) -> list[int]:
        """Return those of an axis' outputs whose sum is the flange's absolute motion, or the first one on the housing."""
        return self.outputs(axis)[searched(self.shares(axis))]

    def weights(self, omega: FloatArray) -> ComplexArray:
        """Return the share of each channel in each output's displacement, sensors undone, shape (n, channels, outputs).

        An acceleration a is a displacement -a / omega^2. What sensors show that are turned out of X and Y is turned back.
        """
        twice = np.where(omega == 0.0, 0.0, -1.0 / np.where(omega == 0.0, 1.0, omega) ** 2)
        weights = np.zeros((omega.size, len(self.sensors), len(self.sensors)), dtype=complex)
        for k, sensor in enumerate(self.sensors):
            weights[:, k, k] = (1.0 if sensor.quantity is Quantity.DISPLACEMENT else twice) / sensor.response(omega)
        for x, y in self._turned_pairs():
            a, b = self.sensors[x].rotation, self.sensors[y].rotation
            # they show cos a x + sin a y, and -sin b x + cos b y
            back = np.array([[np.cos(b), np.sin(b)], [-np.sin(a), np.cos(a)]]) / np.cos(a - b)
            own = np.stack([weights[:, x, x], weights[:, y, y]], axis=1)
            weights[:, [[x], [y]], [x, y]] = own[:, :, None] * back
        return weights

    def _turned_pairs(self) -> list[tuple[int, int]]:
        """Channels of X and Y of one place of which one at least is turned."""
        first, last = len(self.axes), len(self.axes) + self.fixed
        pairs = []
        for kind in (range(first), range(first, last), range(last, len(self.sensors))):
            turned = [self.sensors[k] for k in kind if self.sensors[k].rotation != 0.0]
            if not turned:
                continue
            x, y = ([k for k in kind if self.sensors[k].axis is axis] for axis in (Dof.X, Dof.Y))
            field, found = f"sensors.{turned[0].name}.rotation_deg", f"{np.degrees(turned[0].rotation):g}"
            if len(x) != len(y):
                allowed = "0, or as many sensors along the other axis at the same place: only both together can be turned back"
                raise InputError(field, found, allowed)
            pairs += list(zip(x, y, strict=True))
        for one, other in ((self.sensors[x], self.sensors[y]) for x, y in pairs):
            if abs(np.cos(one.rotation - other.rotation)) < np.sin(_LEAST_APART):
                found = " and ".join(f"{np.degrees(each.rotation):g} of {each.name}" for each in (one, other))
                allowed = f"directions at least {np.degrees(_LEAST_APART):.0f} degrees apart"
                raise InputError(f"sensors.{one.name}.rotation_deg", found, allowed)
        return pairs


def measured_axes(sensors: Sequence[Sensor]) -> tuple[Dof, ...]:
    """Return the axes with a displacement sensor; where there is none at all, those with an accelerometer on the spindle's housing."""
    shown = tuple(axis for axis in (Dof.X, Dof.Y) if first_sensor(sensors, Quantity.DISPLACEMENT, axis) is not None)
    return shown or tuple(axis for axis in (Dof.X, Dof.Y) if accelerometers(sensors, axis, Role.SPINDLE))


def motion_channels(sensors: Sequence[Sensor], axes: Sequence[Dof], housing: bool = True) -> MotionChannels:
    """Return the channels that show motion along these axes.

    `sensors`: one of each column of a recording
    `axes`: as `measured_axes` returns them
    `housing`: accelerometers on the housing beside displacement sensors are among them
    Raises `InputError` if an axis has no sensor, or if some are turned and cannot be turned back.
    """
    shown = [first_sensor(sensors, Quantity.DISPLACEMENT, axis) for axis in axes]
    felt = [accelerometers(sensors, axis, Role.SPINDLE) for axis in axes]
    fixed = [accelerometers(sensors, axis, Role.FIXTURE)[:1] for axis in axes]
    if all(sensor is None for sensor in shown):
        shown, felt, fixed = [next(iter(each), None) for each in felt], [each[1:] for each in felt], []
    elif not housing:
        felt = []
    for axis, sensor in zip(axes, shown, strict=True):
        if sensor is None:
            raise InputError("sensors", f"no displacement {axis.upper()}", "the same sensors for a cut and its air cut")
    chosen = [*(sensor for sensor in shown if sensor is not None), *(sensor for each in (*fixed, *felt) for sensor in each)]
    return MotionChannels(tuple(axes), tuple(sensors.index(sensor) for sensor in chosen), tuple(chosen), sum(len(each) for each in fixed))


def workpiece_channels(sensors: Sequence[Sensor]) -> MotionChannels | None:
    """Return the channels of the accelerometers on table and workpiece, one for each axis; None where there are none.

    They are moved by the force on the workpiece, which is minus that on the tool: what they show has nothing of the spindle's motion.

    `sensors`: one of each column of a recording
    Raises `InputError` if an axis has several, or if some are turned and cannot be turned back.
    """
    chosen = []
    for axis in (Dof.X, Dof.Y):
        own = [sensor for role in (Role.WORKPIECE, Role.TABLE) for sensor in accelerometers(sensors, axis, role)]
        if len(own) > 1:
            found = f'"{own[1].role}", as well as {own[0].name} on the {own[0].role} along {axis.upper()}'
            allowed = "one accelerometer on table or workpiece for each axis: leave out those that are farther from the cut"
            raise InputError(f"sensors.{own[1].name}.role", found, allowed)
        chosen += own
    axes = tuple(sensor.axis for sensor in chosen if sensor.axis is not None)
    return MotionChannels(axes, tuple(sensors.index(sensor) for sensor in chosen), tuple(chosen), 0) if chosen else None
