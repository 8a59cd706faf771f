"""Kernels of a service: one of its processes compiles each step of them, the others wait for it, and operators see how far they are."""

from __future__ import annotations

from pathlib import Path

import filelock

#: Steps of the compilation that quick answers need, and those that force streams need.
ANSWERS, OBSERVERS = ("tool-holder", "lobes", "robot"), ("force observer",)


class Kernels:
    """Compilation that the processes of a service share.

    `folder`: where they mark what is done; None: each process compiles for itself what is not in the cache
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.folder = folder

    def begin(self) -> None:
        """Forget what was done before this start: the cache may have gone since."""
        if self.folder is not None:
            self.folder.mkdir(parents=True, exist_ok=True)
            for mark in self.folder.glob("*.done"):
                mark.unlink()

    def prepare(self, *names: str, locks: bool = True) -> None:
        """In a child: compile steps, or load them from the cache where another one has compiled them.

        A process that may lock nothing loads what is compiled; the rest it compiles where it is needed.
        """
        from rcsa_ident.front.compile_kernels import STEPS

        for name in names:
            if self.folder is not None and not (mark := self.folder / f"{name}.done").exists():
                if not locks:
                    continue
                # the system lets go of it however the process ends
                with filelock.FileLock(self.folder / f"{name}.lock"):
                    if not mark.exists():
                        STEPS[name]()
                        mark.touch()
                        continue
            STEPS[name]()

    @property
    def progress(self) -> str:
        """How far the compilation is, in words."""
        steps = len(ANSWERS + OBSERVERS)
        done = steps if self.folder is None else len(list(self.folder.glob("*.done")))
        return f"{done} of {steps} steps of compilation are done"
