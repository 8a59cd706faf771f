"""Answers that were computed, kept by the content of their questions: a page asks the same again when it is opened again."""

from __future__ import annotations

import hashlib
import pickle
from collections import OrderedDict
from collections.abc import Callable
from typing import Any

from api.work.pool import Work
from api.work.requests import MachineText

#: Of all answers together; lobes of one tooling take some 100 kB.
MOST_BYTES = 64_000_000


class Answers:
    """Answers of pure functions of their arguments; those that were not asked for longest go first.

    `work`: computes what is not known
    `most`: bytes that are kept
    """

    def __init__(self, work: Work, most: int = MOST_BYTES) -> None:
        self.work, self.most = work, most
        self.kept: OrderedDict[bytes, bytes] = OrderedDict()
        self.size = 0

    async def of(self, call: Callable[..., Any], machine: MachineText, *further: Any) -> Any:
        """Return what `Work.run` returns for a call, at once where it has returned it before; failures are not kept."""
        question = hashlib.sha256(pickle.dumps((call.__qualname__, machine.digest, further))).digest()
        if question in self.kept:
            self.kept.move_to_end(question)
            return pickle.loads(self.kept[question])
        answer = await self.work.run(call, machine, *further)
        raw = pickle.dumps(answer)
        if question not in self.kept and len(raw) <= self.most:
            self.kept[question] = raw
            self.size += len(raw)
            while self.size > self.most:
                self.size -= len(self.kept.popitem(last=False)[1])
        return answer
