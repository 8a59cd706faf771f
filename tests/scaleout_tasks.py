"""What test_scaleout sends to workers, which import it."""

from __future__ import annotations

import multiprocessing
import os
import time
from pathlib import Path

from rcsa_ident.errors import InputError


def late(task: float) -> tuple[float, int]:
    """Later tasks end earlier."""
    time.sleep(0.3 / (1.0 + task))
    return task, os.getpid()


def picky(task: int) -> int:
    if task == 2:
        raise InputError("task", task, "another one", "here")
    return task


def marks(task: tuple[str, int]) -> None:
    """Leaves a file behind; the first one fails."""
    folder, number = task
    if number == 0:
        raise ValueError("the first")
    time.sleep(0.3)
    (Path(folder) / str(number)).touch()


def ends(_task: int) -> None:
    """The end of its worker."""
    os._exit(1)


def slow(task: int) -> tuple[int, int]:
    """The last of three takes long where it is not done by the main process."""
    time.sleep(30.0 if task == 2 and multiprocessing.parent_process() is not None else 0.01)
    return task, os.getpid()
