"""A store without a disk: what tests take, and what tells whether the other one keeps the same promises."""

from __future__ import annotations

import threading
from dataclasses import replace
from typing import Any

from api.stores.records import ABSENT, Document, Documents, Key, Keys, Machine, Machines, Stale, Taken


class MemoryKeys:
    """Keys in a dictionary."""

    def __init__(self) -> None:
        self.rows: dict[str, Key] = {}

    def add(self, key: Key) -> None:
        self.rows[key.id] = key

    def get(self, id: str) -> Key | None:
        return self.rows.get(id)

    def list(self, group: str, after: str, limit: int) -> list[Key]:
        return [row for id, row in sorted(self.rows.items()) if row.group == group and id > after][:limit]

    def delete(self, group: str, id: str) -> bool:
        there = id in self.rows and self.rows[id].group == group
        return there and self.rows.pop(id) is not None


class MemoryMachines:
    """Machines in a dictionary."""

    def __init__(self, identifications: Documents) -> None:
        self.rows: dict[str, Machine] = {}
        self.repeats: dict[tuple[str, str], tuple[str, Machine]] = {}
        self.identifications, self.lock = identifications, threading.Lock()

    def add(self, machine: Machine, repeat: tuple[str, str] | None = None) -> Machine:
        with self.lock:
            if repeat is not None and (machine.group, repeat[0]) in self.repeats:
                digest, earlier = self.repeats[machine.group, repeat[0]]
                if digest != repeat[1]:
                    raise Taken("idempotency key")
                return earlier
            if any(row.group == machine.group and row.name == machine.name for row in self.rows.values()):
                raise Taken("name")
            self.rows[machine.id] = machine
            if repeat is not None:
                self.repeats[machine.group, repeat[0]] = (repeat[1], machine)
            return machine

    def get(self, group: str, id: str) -> Machine | None:
        row = self.rows.get(id)
        return row if row is not None and row.group == group else None

    def list(self, group: str, after: str, limit: int) -> list[Machine]:
        return [row for id, row in sorted(self.rows.items()) if row.group == group and id > after][:limit]

    def delete(self, group: str, id: str) -> bool:
        if self.get(group, id) is None:
            return False
        self.identifications.delete(group, id)
        return self.rows.pop(id, None) is not None


class MemoryDocuments:
    """Texts in a dictionary."""

    def __init__(self) -> None:
        self.rows: dict[tuple[str, str], Document] = {}
        self.lock = threading.Lock()

    def put(self, document: Document, expected: str | None = None) -> bool:
        with self.lock:
            before = self._expect(document.group, document.name, expected)
            self.rows[document.group, document.name] = document
            return before is None

    def get(self, group: str, name: str) -> Document | None:
        return self.rows.get((group, name))

    def brief(self, group: str, name: str) -> Document | None:
        found = self.get(group, name)
        return None if found is None else replace(found, text="")

    def list(self, group: str, after: str, limit: int) -> list[Document]:
        return [replace(row, text="") for (owner, name), row in sorted(self.rows.items()) if owner == group and name > after][:limit]

    def delete(self, group: str, name: str, expected: str | None = None) -> bool:
        with self.lock:
            before = self._expect(group, name, expected)
            self.rows.pop((group, name), None)
            return before is not None

    def _expect(self, group: str, name: str, expected: str | None) -> Document | None:
        before: Any = self.rows.get((group, name))
        if expected is not None and (ABSENT if before is None else before.digest) != expected:
            raise Stale
        return before


class MemoryStore:
    """Everything in dictionaries."""

    def __init__(self) -> None:
        self.keys: Keys = MemoryKeys()
        self.identifications: Documents = MemoryDocuments()
        self.toolings: Documents = MemoryDocuments()
        self.machines: Machines = MemoryMachines(self.identifications)

    def check(self) -> None:
        """Always there."""

    def close(self) -> None:
        """Nothing to let go of."""
