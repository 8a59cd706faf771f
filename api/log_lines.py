"""Log lines: a record as one line of JSON, with the ids of what was being served when it was written, whoever wrote it."""

from __future__ import annotations

import json
import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from datetime import UTC, datetime
from typing import Any

_IDS: ContextVar[dict[str, str]] = ContextVar("ids")


def ids() -> dict[str, str]:
    """Return the ids of what is being served here: request, key and group, job, session; child processes are handed them with each call."""
    return _IDS.get({})


def tell(**more: str) -> None:
    """Have every further line of this context, and of what it starts, carry these ids too."""
    _IDS.set(ids() | more)


@contextmanager
def telling(**more: str) -> Iterator[None]:
    """The same for a block."""
    token = _IDS.set(ids() | more)
    try:
        yield
    finally:
        _IDS.reset(token)


class JsonLines(logging.Formatter):
    """Log formatter: a record as one line of JSON.

    Of what libraries hang on their records nothing is told: only `fields`, which the service itself gives, and the ids of the context.
    """

    def format(self, record: logging.LogRecord) -> str:
        line: dict[str, Any] = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "event": record.getMessage(),
        }
        line |= ids() | getattr(record, "fields", {})
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        return json.dumps(line, ensure_ascii=False, default=str)


def start() -> None:
    """Write the lines of this process, those of libraries too, to its standard error."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(JsonLines())
    logging.basicConfig(level=logging.INFO, handlers=[handler], force=True)
