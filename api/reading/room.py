"""The folder that is all a reader process sees: the files of its call are put into it, and what it writes is taken out of it."""

from __future__ import annotations

import os
import shutil
import tempfile
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from api.reading.campaign_text import Upload


class Room:
    """A folder for one process, with what was given to it, to be read, and what it makes.

    `folder`: where it is made; beside the files that are linked into it, else these are copied

    Attributes
    ----------
    links : bool
        Whether files may be linked: their process can change no file's mode, times or attributes.
    """

    def __init__(self, folder: Path | None = None) -> None:
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
        self.folder = Path(tempfile.mkdtemp(prefix="reading-", dir=folder))
        self.given, self.made = self.folder / "given", self.folder / "made"
        self.given.mkdir()
        self.made.mkdir()
        self.wanted: dict[Path, Path] = {}
        self.linked, self.links = 0, False

    def take_in(self, arguments: tuple[Any, ...]) -> tuple[Any, ...]:
        """Return the arguments of a call with every file, and every place for one, as the process sees it."""
        return tuple(self._seen(each) for each in arguments)

    def give_out(self) -> None:
        """Put the files that the call has made where they belong."""
        for made, target in self.wanted.items():
            # a link leads wherever the process wanted it to
            if made.is_file() and not made.is_symlink():
                shutil.move(made, target)

    def clear(self) -> None:
        """Leave nothing of a call to the next one."""
        self.wanted.clear()
        self.linked = 0
        for folder in (self.given, self.made):
            for path in folder.iterdir():
                path.unlink(missing_ok=True)

    def remove(self) -> None:
        """Remove the folder."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _seen(self, argument: Any) -> Any:
        if isinstance(argument, Upload):
            made = self.made / f"{len(self.wanted)}"
            self.wanted[made] = argument.target
            return replace(argument, path=self._linked(argument.path), target=made)
        return self._linked(argument) if isinstance(argument, Path) else argument

    def _linked(self, path: Path) -> Path:
        link = self.given / f"{self.linked}{path.suffix}"
        self.linked += 1
        # what was deleted meanwhile is missed by whoever reads it
        with suppress(FileNotFoundError):
            if self.links:
                # a system, a file system or another disk without hard links
                with suppress(AttributeError, OSError):
                    os.link(path, link)
                    return link
            shutil.copyfile(path, link)
        return link
