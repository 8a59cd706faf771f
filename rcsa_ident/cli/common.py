"""What all commands share: exit codes, errors in one sentence, progress, output."""

from __future__ import annotations

import functools
import json
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from rcsa_ident.base.errors import InputError, RcsaIdentError, no_cache
from rcsa_ident.io.unread_columns import left_aside, reading_tables
from rcsa_ident.setup.fields import COEFFICIENTS

if TYPE_CHECKING:
    from rich.progress import Progress, ProgressColumn, TaskID

FAILED, BAD_INPUT, NOT_CONVERGED, INTERRUPTED = 1, 2, 3, 130
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object for machines instead of tables.")]
Seed = Annotated[int, typer.Option(min=0, help="Same seed, same answer, on any number of processes.")]

#: The library's fields, the parameter of a command that gives each, and how its option is written where that needs words.
_OPTIONS = {
    "spindle_speed": ("speed_rpm", ""),
    "idle share": ("idle_percent", ""),
    "speed_bands": ("speed_bands", ""),
    "frf": ("frf", "X=FILE, Y=FILE, XY=FILE for a response in X and a force in Y; FILE#3 is record 3 of the file"),
    "frf_units": ("frf_units", ""),
    "frf_from_hz": ("frf_from_hz", ""),
    "taps": ("taps", ""),
    "stickout": ("stickout_mm", ""),
    "bore": ("bore_mm", ""),
    "holder length": ("length_mm", ""),
    "tangential coefficient": ("ktc_mpa", ""),
    "radial ratio": ("krc", ""),
    **{each.name: (each.key, "") for each in COEFFICIENTS},
    "y_from and y_to": ("y_from_mm", ""),
    "runout": ("runout_um", "in um"),
    "feed_per_tooth": ("feed_per_tooth_mm", ""),
    "quantity": ("quantity", ""),
    "force": ("force", ""),
    "response": ("response", ""),
    "channel": ("channel", ""),
    "sensitivity": ("sensitivity", ""),
    "sampling_rate_hz": ("rate_hz", ""),
    "mass": ("mass_g", ""),
    "cell": ("cell_mm", ""),
    "step": ("step_mm", ""),
    "stock": ("stock", ""),
}

Command = TypeVar("Command", bound=Callable[..., Any])


def answers(command: Command) -> Command:
    """Turn what a command raises into one sentence on stderr and an exit code."""

    @functools.wraps(command)
    def wrapped(*args: Any, **kwargs: Any) -> Any:
        try:
            with reading_tables():
                answer = command(*args, **kwargs)
                for sentence in left_aside():
                    warn(sentence)
            return answer
        except InputError as found:
            error = _in_options(found, kwargs)
            _refuse(str(error), BAD_INPUT, kwargs.get("json_"), {"field": error.field, "where": error.where})
        except RcsaIdentError as error:
            _refuse(str(error), FAILED, kwargs.get("json_"), {})
        except BrokenProcessPool:
            _refuse("a worker process was killed (out of memory?); use fewer --processes", FAILED, kwargs.get("json_"), {})
        except RuntimeError as error:
            refused = no_cache(error)
            if refused is None:
                raise
            _refuse(str(refused), BAD_INPUT, kwargs.get("json_"), {"field": refused.field, "where": refused.where})
        except KeyboardInterrupt:
            _refuse("interrupted: nothing was written", INTERRUPTED, kwargs.get("json_"), {})

    return wrapped  # type: ignore[return-value]


def _in_options(error: InputError, given: Mapping[str, Any]) -> InputError:
    """Return an error of the library with the option that the user wrote, if the command has one for its field."""
    parameter, form = _OPTIONS.get(error.field, ("", ""))
    if parameter not in given:
        return error
    allowed = f"{error.allowed} ({form})" if form else error.allowed
    return InputError("--" + parameter.replace("_", "-"), error.found, allowed, error.where)


def _refuse(sentence: str, code: int, as_json: bool | None, details: dict[str, Any]) -> None:
    if as_json:
        typer.echo(json.dumps({"error": sentence, "exit_code": code, **details}, ensure_ascii=False))
    typer.secho(sentence, fg=typer.colors.RED, err=True)
    raise typer.Exit(code)


@dataclass(slots=True)
class Stages:
    """Progress on stderr and the seconds that each stage took. `quiet`: nothing is shown, as with ``--json``."""

    quiet: bool = False
    seconds: dict[str, float] = field(default_factory=dict)

    @property
    def visible(self) -> bool:
        """Whether somebody may look on."""
        return not self.quiet and sys.stderr.isatty()

    @contextmanager
    def stage(self, title: str) -> Iterator[Line]:
        """Show a stage while it runs."""
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

        start = time.perf_counter()
        columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn())
        counted = (*columns[:2], BarColumn(), MofNCompleteColumn(), columns[2])
        with Progress(*columns, console=Console(stderr=True), transient=True, disable=not self.visible) as progress:
            yield Line(progress, progress.add_task(title, total=None), title, counted)
        self.seconds[title] = time.perf_counter() - start


class Line:
    """What is shown of a stage while it runs."""

    def __init__(self, progress: Progress, task: TaskID, title: str, counted: tuple[ProgressColumn, ...]) -> None:
        self._progress, self._task, self._title, self._counted = progress, task, title, counted
        self._said: dict[str, str] = {}

    def __call__(self, done: int, total: int) -> None:
        """Show how many of how many are done."""
        self._progress.columns = self._counted
        self._progress.update(self._task, completed=done, total=total)

    def tell(self, axis: str, stage: str, cost: float) -> None:
        """Show where the search of an axis is; a word about both axes takes the place of those about each."""
        if axis == "both" or "both" in self._said:
            self._said.clear()
        self._said[axis] = f"{axis.upper() if len(axis) == 1 else axis}: {stage}, cost {cost:.4g}"
        words = "  ".join(self._said[axis] for axis in sorted(self._said))
        self._progress.update(self._task, description=f"{self._title}  {words}")


def emit(data: Any) -> None:
    """Print one JSON object; what is not finite becomes null, and its warnings name columns that were left aside."""
    if isinstance(data, dict) and "warnings" in data:
        data = data | {"warnings": [*data["warnings"], *left_aside()]}
    typer.echo(json.dumps(_finite(data), ensure_ascii=False))


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(v) for v in value]
    return None if isinstance(value, float) and value - value != 0.0 else value


def say(text: str) -> None:
    """Print a line as it is."""
    typer.echo(text)


def warn(text: str) -> None:
    """Print a warning on stderr."""
    typer.secho(f"warning: {text}", fg=typer.colors.YELLOW, err=True)


def writable(path: Path, option: str = "--out") -> Path:
    """Return `path` if a file can be written there, before the long work and not after it."""
    if path.is_dir():
        raise InputError(option, "a folder", "the name of a file", str(path))
    if not path.parent.is_dir():
        raise InputError(option, f"no folder {path.parent}", "a file in an existing folder", str(path))
    if not os.access(path.parent, os.W_OK):
        raise InputError(option, "a folder without permission to write", "a file that can be written", str(path))
    return path
