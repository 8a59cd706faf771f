"""From an uploaded file to a stored recording: read, stored, and judged with the recordings uploaded so far."""

from __future__ import annotations

import asyncio
import hashlib
import json
import logging
import weakref
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from api.files import NORMALISED, UPLOADS, Files, Full, Partial, sha256_of
from api.reading import reader_tasks
from api.reading.campaign_text import HAMMER, Upload, files_of
from api.reading.stored import found_of, is_judged, is_whole, samples_of
from api.shares import Shares
from api.stores.campaigns import Campaign, FileKey, Recording
from api.stores.changes import Note
from api.stores.entities import Damaged, NoRoom, Store, Taken, Unavailable
from api.work.pool import Busy, Work
from rcsa_ident.base.errors import InputError

log = logging.getLogger("rcsa_ident.reading")
#: Interval of the maintenance [s].
_ROUND = 3600.0
#: Version of the normalised form of samples.
_FORM = 1


@dataclass(frozen=True, slots=True)
class Received:
    """A completely received file on the disk."""

    path: Path
    size: int
    sha256: str


class Uploads:
    """Storage of recordings. `places`: simultaneous uploads."""

    def __init__(self, store: Store, files: Files, reader: Work, places: Shares) -> None:
        self.store, self.files, self.reader, self.places = store, files, reader, places
        #: Resumable uploads that a request writes, and those of them that another has given up meanwhile.
        self.writing: set[tuple[str, str]] = set()
        self.given_up: set[tuple[str, str]] = set()
        self.settling: weakref.WeakValueDictionary[str, asyncio.Lock] = weakref.WeakValueDictionary()

    @contextmanager
    def admitted(self, group: str) -> Iterator[None]:
        """Count an upload while it runs; raises `Busy` where too many do, of the group or of all."""
        if not self.places.take(group):
            raise Busy
        try:
            yield
        finally:
            self.places.give(group)

    @contextmanager
    def alone(self, campaign: str, name: str) -> Iterator[None]:
        """Write a resumable upload; raises `Busy` where another request does."""
        key = (campaign, name)
        if key in self.writing:
            raise Busy
        self.writing.add(key)
        try:
            yield
        finally:
            self.writing.discard(key)
            self.given_up.discard(key)

    async def take(self, campaign: Campaign, name: str, received: Received, replacing: bool = False) -> tuple[int, Recording]:
        """Store a file as a recording of the campaign; return 201, or 200 where it existed already, and the recording.

        Raises `Taken`: a recording with other content exists.
        Raises `InputError`: the file cannot be read; nothing is stored.
        Raises `KeyError`: the campaign does not exist any more.
        """
        file = files_of(campaign.text)[name]
        there = await asyncio.to_thread(self.store.recordings.get, campaign.group, campaign.id, name)
        if there is not None and there.sha256 != received.sha256 and not replacing:
            raise Taken("name")
        same = there is not None and there.sha256 == received.sha256
        if there is not None and same and await asyncio.to_thread(is_whole, self.files, there):
            status, kept = 200, there
        else:
            status, kept = await self._read(campaign, name, file.role, file.cuts[0], received, replacing)
            if same:
                log.warning("a damaged recording is whole again", extra={"fields": {"recording": name, "campaign": campaign.id}})
                await self._judge_again(campaign, file.cuts)
        await self.settle(campaign)
        again = await asyncio.to_thread(self.store.recordings.get, campaign.group, campaign.id, name)
        return status, again or kept

    async def finish(self, path: Path, state: Partial) -> None:
        """Store a resumable upload that is complete; its bytes stay unless they are at fault. Raises `Taken`, `InputError` as `take`."""
        with self.alone(state.campaign, state.name):
            try:
                campaign = await asyncio.to_thread(self.store.campaigns.get, state.group, state.campaign)
                if campaign is not None and state.name in files_of(campaign.text):
                    whole = await asyncio.to_thread(received, path)
                    if state.sha256 not in ("", whole.sha256):
                        raise InputError("Upload-Metadata", f"content with the SHA-256 {whole.sha256}", state.sha256)
                    with suppress(KeyError):
                        # else the campaign has gone meanwhile
                        await self.take(campaign, state.name, whole, state.replacing)
            except (InputError, FileNotFoundError) as error:
                if (state.campaign, state.name) in self.given_up:
                    return
                if isinstance(error, InputError):
                    await asyncio.to_thread(self.files.forget, path)
                raise
            await asyncio.to_thread(self.files.forget, path)

    async def _finish_all(self) -> None:
        """Store what a crash, or a full disk, has left complete but not stored."""
        for path, state in await asyncio.to_thread(lambda: list(self.files.complete())):
            try:
                await self.finish(path, state)
            except (Taken, Busy, Full, NoRoom, Damaged):
                # the client may still replace the other content, or mend it; the next round takes the others
                continue
            except InputError as error:
                log.warning("a complete upload cannot be read", extra={"fields": {"recording": state.name, "error": str(error)}})

    async def _read(self, campaign: Campaign, name: str, role: str, cut: str, received: Received, replacing: bool) -> tuple[int, Recording]:
        air = await asyncio.to_thread(self._air, campaign, cut) if role == "cut" else None
        target = self.files.spare(campaign.group)
        try:
            upload = Upload(received.path, name, target)
            if role == HAMMER:
                found = await self.reader.run(reader_tasks.look_at_hammer_tests, upload, campaign.text)
            else:
                there = await asyncio.to_thread(self._samples, air)
                found = await self.reader.run(reader_tasks.look, upload, campaign.text, cut, role, there)
            recording = Recording(
                campaign.group,
                campaign.id,
                name,
                role,
                received.size,
                received.sha256,
                normalised_key(campaign.text, name, received.sha256),
                json.dumps(found, allow_nan=False),
                "" if air is None else air.normalised,
                datetime.now(UTC).isoformat(timespec="milliseconds"),
                await asyncio.to_thread(sha256_of, target),
            )
            before = await asyncio.to_thread(self._keep, recording, received.path, target, replacing)
        finally:
            target.unlink(missing_ok=True)
        return (200, before) if before is not None and before.sha256 == recording.sha256 else (201, recording)

    def _keep(self, recording: Recording, upload: Path, samples: Path, replacing: bool) -> Recording | None:
        """Store first the files, then the row: files that a row names are complete and on the disk."""
        group = recording.group
        with self.files.lock:
            self.files.keep(group, UPLOADS, recording.sha256, upload)
            self.files.keep(group, NORMALISED, recording.normalised, samples)
            before = None
            try:
                before = self.store.recordings.put(recording, replacing)
            except (Taken, NoRoom, KeyError):
                self._release(group, files_named(recording))
                raise
            upload.unlink(missing_ok=True)
            if before is not None:
                self._release(group, {*files_named(before), *files_named(recording)})
            return before

    def _release(self, group: str, keys: Iterable[FileKey]) -> None:
        """Remove files that no row refers to any more; the caller holds the lock."""
        self.files.remove(group, set(keys).difference(self.store.recordings.kept(group)))

    def _air(self, campaign: Campaign, cut: str) -> Recording | None:
        name = next((name for name, file in files_of(campaign.text).items() if file.role == "air" and cut in file.cuts), None)
        return None if name is None else self.store.recordings.get(campaign.group, campaign.id, name)

    def _samples(self, recording: Recording | None) -> Path | None:
        return None if recording is None else samples_of(self.files, recording)

    async def settle(self, campaign: Campaign) -> None:
        """Judge every cut again whose air cut has been added or removed since its verdict."""
        lock = self.settling.setdefault(campaign.id, asyncio.Lock())
        async with lock:
            for _ in range(10):
                changes = await asyncio.to_thread(self.store.campaigns.changes, campaign.group, campaign.id)
                stale = await asyncio.to_thread(self._stale, campaign)
                try:
                    for cut, recording, air in stale:
                        await self._judge(campaign, cut, recording, air)
                    if not stale:
                        await self._among_fellows(campaign)
                except Busy:
                    # the recordings stay; the next maintenance judges them
                    return
                if not stale:
                    await asyncio.to_thread(self.store.campaigns.settle, campaign.group, campaign.id, changes)
                    return

    def _stale(self, campaign: Campaign) -> list[tuple[str, Recording, Recording | None]]:
        rows = {row.name: row for row in self.store.recordings.list(campaign.group, campaign.id, "", 1_000_000)}
        found = []
        for cut in json.loads(campaign.text)["cuts"]:
            row, air = rows.get(cut["cut"]), rows.get(cut.get("air", ""))
            if row is not None and is_judged(row) and row.judged_with != ("" if air is None else air.normalised):
                found.append((cut["id"], row, air))
        return found

    async def _among_fellows(self, campaign: Campaign) -> None:
        """Judge the cuts beside those of their tooling, each after its verdict for itself (`alone`)."""
        listed = await asyncio.to_thread(self.store.recordings.list, campaign.group, campaign.id, "", 1_000_000)
        rows = {row.name: row for row in listed if is_judged(row)}
        there = [(cut["tooling"], rows[cut["cut"]]) for cut in json.loads(campaign.text)["cuts"] if cut["cut"] in rows]
        found = [found_of(row) for _, row in there]
        alone = [each.get("alone", each["verdict"]) for each in found]
        verdicts = await self.reader.run(reader_tasks.among_fellows, [tooling for tooling, _ in there], alone)
        for (_, row), data, own, verdict in zip(there, found, alone, verdicts, strict=True):
            if verdict != data["verdict"]:
                text = json.dumps(data | {"verdict": verdict, "alone": own}, allow_nan=False)
                await asyncio.to_thread(self.store.recordings.judge, row, replace(row, found=text))

    async def _judge_again(self, campaign: Campaign, cuts: Sequence[str]) -> None:
        """Judge cuts whose verdicts may say that a file was damaged."""
        rows = {row.name: row for row in await asyncio.to_thread(self.store.recordings.list, campaign.group, campaign.id, "", 1_000_000)}
        for cut in json.loads(campaign.text)["cuts"]:
            if cut["id"] in cuts and cut["cut"] in rows and is_judged(rows[cut["cut"]]):
                await self._judge(campaign, cut["id"], rows[cut["cut"]], rows.get(cut.get("air", "")))

    async def _judge(self, campaign: Campaign, cut: str, recording: Recording, air: Recording | None) -> None:
        try:
            own, still = await asyncio.to_thread(lambda: (samples_of(self.files, recording), self._samples(air)))
            verdict = await self.reader.run(reader_tasks.judge, campaign.text, cut, own, still)
        except (InputError, Damaged) as error:
            verdict = refused_verdict(str(error))
        text = json.dumps(found_of(recording) | {"verdict": verdict, "alone": verdict}, allow_nan=False)
        after = replace(recording, found=text, judged_with="" if air is None else air.normalised)
        await asyncio.to_thread(self.store.recordings.judge, recording, after)

    def partial(self, group: str, campaign: str, name: str) -> tuple[Path, Partial | None]:
        """Return the path of a resumable upload, and its state."""
        return self.files.partial(group, f"{campaign}/{name}")

    def give_up(self, group: str, campaign: str, name: str) -> bool:
        """Remove a resumable upload, also one that is being written, and return whether there was one. The caller holds the lock."""
        path, state = self.partial(group, campaign, name)
        self.files.forget(path)
        written = (campaign, name) in self.writing
        if written:
            self.given_up.add((campaign, name))
        return written or state is not None

    async def forget(self, campaign: Campaign, name: str) -> bool:
        """Remove a recording or its unfinished upload; return whether there was one."""

        def remove() -> bool:
            with self.files.lock:
                unfinished = self.give_up(campaign.group, campaign.id, name)
                row = self.store.recordings.delete(campaign.group, campaign.id, name)
                if row is not None:
                    self._release(campaign.group, files_named(row))
                return row is not None or unfinished

        there = await asyncio.to_thread(remove)
        await self.settle(campaign)
        return there

    def forget_campaign(self, group: str, id: str) -> bool:
        """Remove a campaign with everything that was uploaded for it, and return whether there was one."""
        with self.files.lock:
            campaign = self.store.campaigns.get(group, id, anyhow=True)
            rows = self.store.recordings.list(group, id, "", 1_000_000)
            there = self.store.campaigns.delete(group, id)
            # of a damaged declaration nobody knows the names: its parts go when they are a day old
            with suppress(ValueError, LookupError, TypeError):
                for name in files_of("" if campaign is None else campaign.text):
                    self.give_up(group, id, name)
            self._release(group, [key for row in rows for key in files_named(row)])
        return there

    def forget_machine(self, group: str, machine: str, note: Note) -> bool:
        """Remove a machine with its campaigns and everything that was uploaded for them."""
        with self.files.lock:
            keys = self.store.recordings.of_machine(group, machine)
            there = self.store.machines.delete(group, machine, note)
            if keys:
                self._release(group, keys)
        return there

    def sweep(self) -> int:
        """Remove files that a crash has left without a row, and stale parts."""
        with self.files.lock:
            kept = {group: self.store.recordings.kept(group) for group in list(self.store.recordings.groups())}
            return self.files.sweep(kept)

    async def _settle_if_whole(self, group: str, id: str) -> None:
        try:
            campaign = await asyncio.to_thread(self.store.campaigns.get, group, id)
        except Damaged as error:
            # the others are judged all the same
            log.error("damaged", extra={"fields": {"campaign": id, "found": str(error)}})
            return
        if campaign is not None:
            await self.settle(campaign)

    async def maintain(self) -> None:
        """At the start and every hour: remove orphaned files, store uploads that are complete, and judge recordings without a verdict."""
        while True:
            try:
                swept = await asyncio.to_thread(self.sweep)
                if swept:
                    log.info("orphaned files removed", extra={"fields": {"files": swept}})
                await self._finish_all()
                for group, id in await asyncio.to_thread(self.store.campaigns.unsettled):
                    await self._settle_if_whole(group, id)
            except (Unavailable, OSError) as error:
                log.warning("maintenance of uploads is postponed", extra={"fields": {"error": type(error).__name__}})
            await asyncio.sleep(_ROUND)


def received(path: Path) -> Received:
    """Return a file that is complete and synced, with its hash."""
    return Received(path, path.stat().st_size, sha256_of(path))


def files_named(recording: Recording) -> list[FileKey]:
    """Return the files that a recording refers to."""
    return [(UPLOADS, recording.sha256), (NORMALISED, recording.normalised)]


def normalised_key(text: str, name: str, sha256: str) -> str:
    """Return the key of the samples of an upload: a hash of its content and of everything in the campaign that decides how it is read."""
    data = json.loads(text)
    tests = [test for test in data.get("frfs", ()) if test["file"] == name]
    basis = [_FORM, sha256, Path(name).suffix.lower(), data["sensors"], data.get("campaign", {}).get("sampling_rate_hz")]
    basis = [_FORM, sha256, HAMMER, tests] if tests else basis
    return hashlib.sha256(json.dumps(basis, sort_keys=False).encode()).hexdigest()


def refused_verdict(reason: str) -> dict[str, Any]:
    """Return the verdict on a recording that cannot be judged."""
    return {"usable": False, "reasons": [reason], "notes": [], "spindle_speed_rpm": None, "lines": 0, "signal_to_noise_db": {}}
