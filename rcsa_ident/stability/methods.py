"""What a stability method is: a further one is a file beside this one, a line in `MethodName` and one in `lobes.METHODS`."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from typing import TYPE_CHECKING, ClassVar, Literal, Protocol, runtime_checkable

if TYPE_CHECKING:
    from rcsa_ident.base.arrays import FloatArray
    from rcsa_ident.cutting.process import MillingProcess
    from rcsa_ident.dynamics.receptance import Receptance
    from rcsa_ident.stability.result import StabilityLobes
    from rcsa_ident.stability.tip_modes import TipModes


#: What the work of a limit is estimated from, as counted on identified machines: looks at a depth until it is found, modes of a fitted tip,
#: and the highest of them that counts, over the end of the receptance.
LOOKS, FITTED_MODES, ABOVE_TOP = 13.0, 18.0, 1.6


class MethodName(StrEnum):
    """Names of all methods: ``full-discretisation`` is the class `FullDiscretisation`."""

    ZERO_ORDER = "zero-order"
    MULTI_FREQUENCY = "multi-frequency"
    SEMI_DISCRETISATION = "semi-discretisation"
    FULL_DISCRETISATION = "full-discretisation"
    TIME_DOMAIN = "time-domain"


class StabilityMethod(Protocol):
    """A published way to the stability limit, and what can be said of it before it is used."""

    #: As users call it.
    name: ClassVar[str]
    #: What it works on; a receptance can be computed from modes, modes have to be fitted to a receptance.
    needs: ClassVar[Literal["receptance", "modes"]]
    #: Of one of its smallest steps, on one core of a plain server: see `operations`.
    seconds_per_operation: ClassVar[float]
    #: Whether it also says how fast a vibration grows at any depth, so that `stability_map` takes it.
    gives_maps: ClassVar[bool]

    def lobes(self, tip: Receptance | TipModes, process: MillingProcess, speeds: FloatArray, max_depth: float) -> StabilityLobes:
        """Return the limit at each speed; the arguments have been checked."""
        ...

    def operations(self, process: MillingProcess, speeds: FloatArray, top: float, max_depth: float) -> FloatArray:
        """Return about how many of its smallest steps each limit takes, shape (n,), where receptances are known up to `top` [rad/s]."""
        ...


#: Told of each speed once its limit is known: speed [rad/s], limit [m] and chatter frequency [rad/s], as in `StabilityLobes`.
Watch = Callable[[float, float, float], None]


@runtime_checkable
class Watched(Protocol):
    """A method that asks one speed after the other, and tells each limit at once; the limits are the same where nobody watches."""

    watch: Watch | None


def coarse_to_fine(count: int) -> list[int]:
    """Return all places of a list, both ends first, then every gap halved again and again: a curve is there early.

    Examples
    --------
    >>> coarse_to_fine(7)
    [0, 6, 4, 2, 1, 3, 5]
    """
    if count < 2:
        return list(range(count))
    steps = (1 << k for k in reversed(range((count - 1).bit_length())))
    return list(dict.fromkeys([0, count - 1, *(place for step in steps for place in range(0, count, step))]))
