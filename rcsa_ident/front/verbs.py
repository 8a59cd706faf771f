"""The front door's verbs: each reads what it needs, asks the library, and returns a noun that shows itself.

Everything heavy is imported where it is used: whoever only connects to a service needs no kernels.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import rpm
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.setup.cut import Cut, CutSpec
from rcsa_ident.setup.tooling import Tooling

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rcsa_ident.base.arrays import FloatArray
    from rcsa_ident.cutting.power import SpindleDrive
    from rcsa_ident.dynamics.receptance import Receptance
    from rcsa_ident.front.identified import Result, RobotResult
    from rcsa_ident.identification.machine import IdentifiedMachine
    from rcsa_ident.identification.method import Method
    from rcsa_ident.machine.machine import Machine, TipSource
    from rcsa_ident.machine.robot.model import RobotModel
    from rcsa_ident.observer.tuning import ObserverMethod
    from rcsa_ident.signals.recording import Recording
    from rcsa_ident.stability.advice import Advice
    from rcsa_ident.stability.methods import StabilityMethod
    from rcsa_ident.stability.result import StabilityLobes
    from rcsa_ident.stability.tip_modes import TipModes
    from rcsa_ident.workflows.estimate_forces import MonitoredCut

#: Names of the identification methods, as in a result file.
METHODS = ("default", "paper")


def sample_campaign(folder: str | Path = "sample_runs", processes: int | None = None, progress: bool | None = None) -> Campaign:
    """Return a campaign of the sample machine; where the folder does not hold one, the virtual machine makes it, in half a minute.

    Parameters
    ----------
    folder : path
        What is true of the machine goes beside it, into ``<folder>.truth``.
    processes, progress
        As of `identify`.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> campaign = ri.sample_campaign("sample_runs")
    >>> sorted(campaign.toolings)
    ['S1-ER32', 'S2-PG25']
    """
    from rcsa_ident.front.processes import workers
    from rcsa_ident.front.samples import make_sample_campaign
    from rcsa_ident.io.settings.setups import read_campaign

    with _one_thread(), workers(processes, ("rcsa_ident.workflows.simulate",)) as pool, _line(progress) as line:
        return read_campaign(make_sample_campaign(folder, progress=line.counted("cut on the virtual machine"), mapper=pool.map))


def identify(
    campaign: Campaign | str | Path,
    seed: int = 1,
    method: Method | str = "default",
    start: Result | IdentifiedMachine | None = None,
    processes: int | None = None,
    progress: bool | None = None,
    robot: RobotModel | str | Path | None = None,
) -> Result | RobotResult:
    """Read and judge all recordings of a campaign, its hammer tests, too, and find modes and joint of the machine that made it.

    Parameters
    ----------
    campaign : Campaign or path of its folder
    seed : int
        Same seed, same answer, on any number of processes.
    method : Method or str
        ``default``, ``paper`` (the published genetic algorithm), or an object with its settings.
    start : Result or IdentifiedMachine, optional
        An earlier answer for the same machine, whose modes are refined; with the default method.
    processes : int or None
        With this one; by default one a core, at most 8. They run nothing of the script that calls this: a method that it defines itself
        is computed in this process alone, with a `RuntimeWarning`.
    progress : bool or None
        Whether a line tells how far it is; by default where somebody looks on, in a terminal or a notebook.
    robot : RobotModel or path of ROBOT.toml, optional
        The arm that made the cuts, each at its `posture_deg`: its springs, dampers and the spindle in its hand are found then.

    Returns
    -------
    Result or RobotResult
        Of a machine, or of a robot.

    Raises
    ------
    InputError
        If no cut is usable; of a robot, if a method or a start is asked for.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> campaign = ri.sample_campaign("sample_runs")
    >>> found = ri.identify(campaign, seed=1)
    >>> print(found)  # doctest: +ELLIPSIS
    converged, 24 cuts, X 7 modes, Y ... modes
    >>> print(found.save("RESULT.json"))
    RESULT.json
    """
    from functools import partial

    from rcsa_ident.front.identified import Result, RobotResult
    from rcsa_ident.front.processes import workers
    from rcsa_ident.io.curves.hammer import read_hammer_test
    from rcsa_ident.io.recordings.readers import read_cut
    from rcsa_ident.io.settings.robots import read_robot
    from rcsa_ident.io.settings.setups import read_campaign
    from rcsa_ident.machine.robot.flexible import FlexibleRobot
    from rcsa_ident.workflows import identify as workflow
    from rcsa_ident.workflows.identify_robot import identify_robot

    chosen, arm = _method(method, start, robot is not None), read_robot(robot) if isinstance(robot, str | Path) else robot
    campaign = campaign if isinstance(campaign, Campaign) else read_campaign(campaign)
    with _one_thread(), workers(processes) as pool, _line(progress) as line:
        read = partial(read_cut, campaign.sensors, campaign.sampling_rate)
        readings = workflow.judge(campaign, read, pool.map_many, line.counted("recording"))
        result: Result | RobotResult
        if arm is not None:
            line("searching springs")
            result = RobotResult.of(identify_robot(campaign, readings, FlexibleRobot(arm), seed, pool.map), campaign, readings)
        else:
            tests = workflow.hammer_lines(campaign, read_hammer_test)
            line("searching modes")
            with pool.listening(line.tell) as told:
                found = workflow.identify(campaign, readings, chosen, seed, pool.map, None if line.stream is None else told, tests)
            result = Result.of(found, campaign, readings)
        line.last = str(result)
    return result


def _method(method: Method | str, start: Result | IdentifiedMachine | None, of_robot: bool = False) -> Method:
    from rcsa_ident.identification.evidence import EvidenceSelection
    from rcsa_ident.identification.genetic_algorithm import PaperGeneticAlgorithm
    from rcsa_ident.identification.machine import IdentifiedMachine

    if of_robot and (method != "default" or start is not None):
        raise InputError("robot", "one with another method or a start", "the default method alone, which begins at the data sheet")
    if method not in METHODS and isinstance(method, str):
        raise InputError("method", method, f"one of {', '.join(METHODS)}, or a method with its settings")
    if start is not None:
        if method != "default":
            raise InputError("start", str(start), "the default method, which has a posterior")
        return EvidenceSelection(start=(start if isinstance(start, IdentifiedMachine) else start.machine).starts())
    if isinstance(method, str):
        return PaperGeneticAlgorithm() if method == "paper" else EvidenceSelection()
    return method


def read_result(path: str | Path) -> Result:
    """Return the identification of RESULT.json: status, reasons, modes, and the machine.

    Parameters
    ----------
    path : path

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> found = ri.read_result("RESULT.json")
    >>> print(found.status)
    converged
    >>> print(found.machine)  # doctest: +ELLIPSIS
    HPM sample machine: X ... modes, Y ... modes, 533 to 4266 Hz, converged
    """
    from rcsa_ident.front.identified import Result
    from rcsa_ident.io.results import parts as results

    return Result(results.read_result(path), str(path))


def read_machine(path: str | Path) -> Machine:
    """Return the machine of RESULT.json, or of FLANGE.csv: a flange that was measured or decoupled.

    Parameters
    ----------
    path : path

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> machine = ri.read_machine("RESULT.json")
    >>> print(machine)  # doctest: +ELLIPSIS
    HPM sample machine: X ... modes, Y ... modes, 533 to 4266 Hz, converged
    >>> print(machine.tip(ri.sample_tooling("S3-PG25-long")))
    tip.x, tip.y: 4167 frequencies, 100 to 4266 Hz, with its spread
    """
    from rcsa_ident.io.curves.flanges import read_flange_machine

    return read_flange_machine(path) if Path(path).suffix.lower() == ".csv" else read_result(path).machine


def read_modes(path: str | Path, *further: str | Path) -> TipModes:
    r"""Return the modes of a tip from MODES.toml, or from CutPro's modal files; a direction without modes is rigid.

    Parameters
    ----------
    path, *further : path
        MODES.toml, or one ``X=FILE.cmp`` for each direction.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> from pathlib import Path
    >>> text = "[[y]]\nnatural_frequency_hz = 900.0\ndamping_ratio = 0.02\nmodal_mass_kg = 0.04"
    >>> _ = Path("MODES.toml").write_text(text)
    >>> print(ri.read_modes("MODES.toml"))
    tip: 1 mode at 900 Hz
    """
    from rcsa_ident.io.settings.modal_files import read_modes_files

    return read_modes_files([str(each) for each in (path, *further)]).modes


def read_tap_tests(
    x: str | Path | None = None,
    y: str | Path | None = None,
    xy: str | Path | None = None,
    yx: str | Path | None = None,
    units: str | None = None,
    from_hz: float = 0.0,
    correction: str = "auto",
) -> Receptance:
    """Return a tip's receptance from tap tests: FRF.csv, UFF 58, CutPro- or MetalMAX-style text columns.

    Parameters
    ----------
    x, y : path, optional
        Response and force in that direction; one that is missing is rigid.
    xy, yx : path, optional
        Response in the first direction, force in the second one.
    units : str, optional
        As ``um/N`` or ``(m/s^2)/N``, whatever the files say; by default as they say.
    from_hz : float [Hz]
        Lines below it are left out: there, an accelerometer's drift is larger than what moves.
    correction : str
        reverse, conjugate or exchange, for a reversed sensor or hammer, e^{-iωt}, exchanged columns; none; auto turns what is certain.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> tip = ri.tap("hits.csv", axis="Y").save("TIP.csv")
    >>> print(ri.read_tap_tests(y=tip))
    tip.x, tip.y: 12569 frequencies, 2 to 25600 Hz
    >>> print(ri.read_tap_tests(y=tip, from_hz=50.0))
    tip.x, tip.y: 12545 frequencies, 51 to 25600 Hz
    """
    from rcsa_ident.dynamics.passivity import correction_of
    from rcsa_ident.io.curves.frf_files import Source, read_tapped_tip

    given = {("X", "X"): x, ("Y", "Y"): y, ("X", "Y"): xy, ("Y", "X"): yx}
    turn = correction_of(correction)
    return read_tapped_tip([Source(Path(path), pair, None, turn) for pair, path in given.items() if path is not None], units, from_hz)


def advise(
    machine: TipSource | Result,
    tooling: Tooling,
    cut: CutSpec | None = None,
    speeds: FloatArray | None = None,
    max_depth: float = 10e-3,
    method: StabilityMethod | None = None,
    drive: SpindleDrive | None = None,
    depth: float | None = None,
    planned: Sequence[tuple[float, float]] = (),
) -> Advice:
    """Return which cuts a tooling can make on a machine, the best first, each with its stability limit and its recommended depth.

    Parameters
    ----------
    machine : TipSource or Result
        An identified or a measured machine, or the `KnownTip` of one tooling.
    tooling : Tooling
    cut : CutSpec, default half immersion, down-milling, in the campaign's workpiece
        Power and removal rate need its feed per tooth.
    speeds : array, shape (n,) [rad/s], default 4000 to 20 000 rev/min
    max_depth : float [m]
        Limits beyond it are not of interest.
    method : StabilityMethod, default ZeroOrder()
        Of the lobes; recommended cuts are computed by full discretisation, whatever it is.
    drive : SpindleDrive, optional
        Power, torque and highest speed of the spindle.
    depth : float [m], optional
        Speeds at which one may cut so deep are told.
    planned : sequence of (speed [rad/s], depth [m])
        How far these cuts are from chatter is told.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> machine, tool = ri.read_machine("RESULT.json"), ri.sample_tooling("S3-PG25-long")
    >>> print(ri.advise(machine, tool, ri.CutSpec(feed_per_tooth=0.1e-3), ri.rpm(8000, 16_000, 100)))  # doctest: +ELLIPSIS
    S3-PG25-long: 14456 rev/min: stability limit 1.9... mm, recommended ... mm, 5... cm³/min, 0.8... kW
    """
    from rcsa_ident.cutting.power import SpindleDrive
    from rcsa_ident.front.identified import Result
    from rcsa_ident.stability.zero_order import ZeroOrder
    from rcsa_ident.workflows.advise import advise as ask
    from rcsa_ident.workflows.tool_change import ToolChange

    source = machine.machine if isinstance(machine, Result) else machine
    chosen = ZeroOrder() if method is None else method
    over = rpm(4000.0, 20_000.0, 50.0) if speeds is None else speeds
    change = ToolChange(source, tooling, CutSpec() if cut is None else cut, over, max_depth, chosen)
    with _one_thread():
        return ask(change, SpindleDrive.flat() if drive is None else drive, depth=depth, planned=planned)


def estimate_forces(
    machine: Machine | Result,
    tooling: Tooling,
    recording: Recording | Cut | str | Path,
    air: Recording | str | Path | None = None,
    speed: float | None = None,
    method: ObserverMethod | None = None,
    smooth: bool = False,
) -> MonitoredCut:
    """Return the cutting forces of a recording, from the vibration of the flange.

    Parameters
    ----------
    machine : Machine or Result
    tooling : Tooling
        That was cut with; it need not be one of the campaign's.
    recording : Recording, path, or a cut of the campaign with its air cut and its speed
        A file is read with the sensors that the machine was identified with.
    air : Recording or path, optional
        An air cut with the same clamping and speed: its run-out is taken out.
    speed : float, optional [rad/s]
        Spindle speed, to 1 %; by default from the recording's trigger.
    method : ObserverMethod, default Resonators()
    smooth : bool
        Every sample given the whole record, without lag; else as it would be live.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> found, campaign = ri.read_result("RESULT.json"), ri.read_campaign("sample_runs")
    >>> print(ri.estimate_forces(found, campaign.toolings["S2-PG25"], campaign.cuts[15]))  # doctest: +ELLIPSIS
    X 6... N rms (± 3... N), Y 12... N rms (± 3... N) over 0.14 s, 11277 rev/min, 373 to 4266 Hz
    """
    from rcsa_ident.front.identified import Result
    from rcsa_ident.workflows.estimate_forces import METHOD, observe

    source = machine.machine if isinstance(machine, Result) else machine
    if isinstance(recording, Cut):
        air = recording.air if air is None else air
        speed = recording.conditions.spindle_speed if speed is None else speed
        recording = recording.recording
    cut, still = _recording(source, recording), None if air is None else _recording(source, air)
    chosen = METHOD if method is None else method
    with _one_thread():
        return observe(source, tooling.assembly, tooling.cutter.teeth, cut, still, speed, chosen, smooth=smooth)


def _recording(machine: Machine, given: Recording | str | Path) -> Recording:
    from rcsa_ident.identification.machine import IdentifiedMachine
    from rcsa_ident.io.recordings.readers import read_recording

    if not isinstance(given, str | Path):
        return given
    if not isinstance(machine, IdentifiedMachine) or not machine.sensors:
        raise InputError("sensors", "none", "a machine that knows its sensors, or read_recording(path, sensors)", str(given))
    return read_recording(given, machine.sensors)


def plot_lobes(lobes: StabilityLobes, **options: Any) -> Figure:
    """Return the figure of stability lobes, as ``lobes.plot()`` draws it.

    Parameters
    ----------
    lobes : StabilityLobes
    **options
        Of `rcsa_ident.report.lobes.stability_figure`: recommended cuts, tested cuts, a map below them, a surface.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
    >>> cut = ri.MillingProcess(ri.Cutter(2, 0.012), ri.CuttingCoefficients(7e8, 0.3), ri.Engagement.from_immersion(0.5, "down"))
    >>> tip = ri.TipModes.of({ri.Dof.Y: mode})
    >>> lobes = ri.stability_lobes(tip, cut, ri.rpm(8000, 16_000, 50), max_depth=10e-3)
    >>> ri.plot_lobes(lobes).savefig("lobes.svg")
    """
    from rcsa_ident.report.lobes import stability_figure

    return stability_figure(lobes, **options)


def connect(url: str = "http://127.0.0.1:8000", key: str | None = None) -> Any:
    """Return the typed client of a service, `api.client.Client`: campaigns, identifications, lobes, advice and forces over REST.

    Parameters
    ----------
    url : str
    key : str, optional
        Where the service asks for one.

    Raises
    ------
    InputError
        If the package beside this one that is called `api` is another one, or the client's own requirement is not installed.

    Examples
    --------
    Nothing is sent before something is asked:

    >>> import rcsa_ident as ri
    >>> with ri.connect("http://127.0.0.1:8000") as client:
    ...     print(type(client).__name__)
    Client
    """
    # late: of the library only this door opens to the service, as its import contract says
    try:
        import api
    except ImportError:
        raise InputError("api", "no such package", "this package as it is installed, with its service") from None
    if getattr(api, "DISTRIBUTION", None) != "rcsa-ident":
        where = str(getattr(api, "__file__", None) or "")
        raise InputError("api", "a package of that name from elsewhere", "the one that rcsa-ident installs, in front of it", where)
    try:
        from api.client import Client
    except ImportError as error:
        if error.name is None or error.name.split(".")[0] in ("api", "rcsa_ident"):
            raise
        raise InputError("client", f"no {error.name}", "the extra `client`: pip install 'rcsa-ident[client]'") from None
    return Client(url, key)


@contextmanager
def _one_thread() -> Iterator[None]:
    """The linear algebra here is small: further threads only wait for each other, and add up in another order from machine to machine."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):
        yield


# -- what is told while something takes long ---------------------------------------------------------------------------------------


@dataclass(slots=True)
class _Line:
    """One line that changes while something is done; `last` is left standing."""

    stream: TextIO | None
    last: str = ""
    width: int = 0

    def __call__(self, text: str) -> None:
        if self.stream is not None:
            # blanks take away what is left of a longer line, in notebooks too
            shown = text.replace("\n", " ")[: shutil.get_terminal_size().columns - 1]
            self.stream.write("\r" + shown.ljust(self.width))
            self.stream.flush()
            self.width = len(shown)

    def counted(self, what: str) -> Any:
        """Return a callable of (done, total)."""
        return lambda done, total: self(f"{what} {done} of {total}")

    def tell(self, axis: str, stage: str, cost: float) -> None:
        """Show where a search is."""
        self(f"searching modes, {axis.upper() if len(axis) == 1 else axis}: {stage}, cost {cost:.4g}")


@contextmanager
def _line(progress: bool | None) -> Iterator[_Line]:
    line = _Line(sys.stderr if progress or (progress is None and _somebody_looks()) else None)
    try:
        yield line
    finally:
        if line.stream is not None:
            line("")
            line.stream.write("\r" + (line.last + "\n" if line.last else ""))
            line.stream.flush()


def _somebody_looks() -> bool:
    """A terminal, or a notebook."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    return sys.stderr.isatty() or type(shell).__name__ == "ZMQInteractiveShell"
