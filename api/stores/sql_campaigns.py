"""Campaigns and recordings in tables."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from dataclasses import replace as replaced
from typing import Any

from sqlalchemy import Connection, Select, delete, func, insert, select, update
from sqlalchemy.exc import IntegrityError

from api.stores import tables
from api.stores.campaigns import Campaign, Counts, FileKey, Recording
from api.stores.database import Database
from api.stores.entities import Taken, digest_of, whole
from api.stores.idempotency import earlier, forget_old

_C, _R, _K = tables.campaigns, tables.recordings, tables.campaign_repeats
_CAMPAIGN, _RECORDING = tables.columns_of(_C, Campaign), tables.columns_of(_R, Recording)


class SqlCampaigns:
    """Campaigns in a table."""

    def __init__(self, store: Database) -> None:
        self.store = store

    def add(self, campaign: Campaign, repeat: tuple[str, str] | None = None) -> Campaign:
        try:
            with self.store.writing() as connection:
                if repeat is not None:
                    forget_old(connection, _K)
                    first = earlier(connection, _K, campaign.group, repeat)
                    if first is not None:
                        return Campaign(**connection.execute(select(*_CAMPAIGN).where(_C.c.id == first.id)).one()._asdict())
                    call = {"group": campaign.group, "key": repeat[0], "digest": repeat[1], "id": campaign.id, "created": campaign.created}
                    connection.execute(insert(_K).values(call))
                # locks the machine until the campaign is stored: a deletion meanwhile waits and includes it
                m = tables.machines
                machine = select(m.c.id).where(m.c.group == campaign.group, m.c.id == campaign.machine).with_for_update(read=True)
                if connection.execute(machine).first() is None:
                    raise KeyError(campaign.machine)
                row = asdict(campaign) | {"digest": digest_of(campaign.text), "changes": 0, "settled": 0}
                self.store.check_room(connection, campaign.group, tables.size_of(row))
                connection.execute(insert(_C).values(row))
                return campaign
        except IntegrityError:
            # the same idempotency key arrived twice at the same moment
            return self.add(campaign, repeat)

    def get(self, group: str, id: str, anyhow: bool = False) -> Campaign | None:
        with self.store.reading() as connection:
            row = connection.execute(select(*_CAMPAIGN, _C.c.digest).where(_C.c.group == group, _C.c.id == id)).first()
        if row is None:
            return None
        found = Campaign(**{name: value for name, value in row._asdict().items() if name != "digest"})
        if not anyhow:
            whole(found.text, row.digest, f"declaration of the campaign {found.name}", "delete the campaign and declare it again")
        return found

    def unsettled(self) -> list[tuple[str, str]]:
        with self.store.reading() as connection:
            rows = connection.execute(select(_C.c.group, _C.c.id).where(_C.c.changes > _C.c.settled)).all()
        return [(group, id) for group, id in rows]

    def list(self, group: str, machine: str, after: str, limit: int) -> list[Campaign]:
        here = (_C.c.group == group, _C.c.machine == machine, _C.c.id > after)
        with self.store.reading() as connection:
            rows = connection.execute(select(*_CAMPAIGN).where(*here).order_by(_C.c.id).limit(limit)).all()
        return [Campaign(**row._asdict()) for row in rows]

    def counts(self, group: str, ids: Sequence[str]) -> dict[str, Counts]:
        found = select(_R.c.campaign, _R.c.role, func.count(), func.sum(_R.c.usable)).group_by(_R.c.campaign, _R.c.role)
        with self.store.reading() as connection:
            rows = connection.execute(found.where(_R.c.group == group, _R.c.campaign.in_(ids))).all()
        each = {(campaign, role): (int(count), int(usable)) for campaign, role, count, usable in rows}
        none = (0, 0)
        others = {id: [each.get((id, role), none)[0] for role in ("air", "hammer")] for id, _ in each}
        return {id: Counts(*each.get((id, "cut"), none), *counted) for id, counted in others.items()}

    def delete(self, group: str, id: str) -> bool:
        with self.store.writing() as connection:
            return delete_campaigns(connection, select(_C.c.id).where(_C.c.group == group, _C.c.id == id)) > 0

    def changes(self, group: str, id: str) -> int:
        with self.store.reading() as connection:
            return connection.execute(select(_C.c.changes).where(_C.c.group == group, _C.c.id == id)).scalar() or 0

    def settle(self, group: str, id: str, changes: int) -> None:
        with self.store.writing() as connection:
            here = (_C.c.group == group, _C.c.id == id, _C.c.settled < changes)
            connection.execute(update(_C).where(*here).values(settled=changes))


def delete_campaigns(connection: Connection, wanted: Select[Any]) -> int:
    """Delete campaigns with their recordings, and return how many there were."""
    ids = list(connection.execute(wanted.with_for_update()).scalars())
    for start in range(0, len(ids), 500):
        part = ids[start : start + 500]
        for table, column in ((_R, _R.c.campaign), (_K, _K.c.id), (_C, _C.c.id)):
            connection.execute(delete(table).where(column.in_(part)))
    return len(ids)


class SqlRecordings:
    """Recordings in a table."""

    def __init__(self, store: Database) -> None:
        self.store = store

    def put(self, recording: Recording, replace: bool) -> Recording | None:
        here = (_R.c.campaign == recording.campaign, _R.c.name == recording.name)
        with self.store.writing() as connection:
            # also locks the campaign: two uploads of one name follow each other
            _changed(connection, recording.group, recording.campaign)
            row = connection.execute(select(*_RECORDING).where(*here)).first()
            there = None if row is None else Recording(**row._asdict())
            if there is None:
                self.store.check_room(connection, recording.group, _row(recording)["stored"])
                connection.execute(insert(_R).values(_row(recording)))
            elif there.sha256 != recording.sha256:
                if not replace:
                    raise Taken("name")
                connection.execute(update(_R).where(*here).values(_row(recording)))
            elif digest_of(there.found) != there.digest:
                # what was found has come to harm, and has been found once more
                connection.execute(update(_R).where(*here).values(_row(replaced(recording, created=there.created))))
            elif (there.normalised, there.samples) != (recording.normalised, recording.samples):
                # read once more, perhaps by a later release, and equal to the last bit of the signals only
                connection.execute(update(_R).where(*here).values(normalised=recording.normalised, samples=recording.samples))
            return there

    def judge(self, before: Recording, after: Recording) -> bool:
        here = (_R.c.campaign == before.campaign, _R.c.name == before.name, _R.c.normalised == before.normalised)
        same = (_R.c.judged_with == before.judged_with, _R.c.created == before.created)
        with self.store.writing() as connection:
            return connection.execute(update(_R).where(*here, *same).values(_row(after))).rowcount > 0

    def get(self, group: str, campaign: str, name: str) -> Recording | None:
        here = (_R.c.group == group, _R.c.campaign == campaign, _R.c.name == name)
        with self.store.reading() as connection:
            row = connection.execute(select(*_RECORDING).where(*here)).first()
        return None if row is None else Recording(**row._asdict())

    def of_machine(self, group: str, machine: str) -> list[FileKey]:
        ids = select(_C.c.id).where(_C.c.group == group, _C.c.machine == machine)
        with self.store.reading() as connection:
            rows = connection.execute(select(_R.c.sha256, _R.c.normalised).where(_R.c.campaign.in_(ids))).all()
        return _keys(rows)

    def list(self, group: str, campaign: str, after: str, limit: int) -> list[Recording]:
        here = (_R.c.group == group, _R.c.campaign == campaign, _R.c.name > after)
        with self.store.reading() as connection:
            rows = connection.execute(select(*_RECORDING).where(*here).order_by(_R.c.name).limit(limit)).all()
        return [Recording(**row._asdict()) for row in rows]

    def delete(self, group: str, campaign: str, name: str) -> Recording | None:
        here = (_R.c.group == group, _R.c.campaign == campaign, _R.c.name == name)
        with self.store.writing() as connection:
            row = connection.execute(select(*_RECORDING).where(*here)).first()
            if row is None:
                return None
            _changed(connection, group, campaign)
            connection.execute(delete(_R).where(*here))
        return Recording(**row._asdict())

    def kept(self, group: str) -> dict[FileKey, str]:
        with self.store.reading() as connection:
            rows = connection.execute(select(_R.c.sha256, _R.c.normalised, _R.c.samples).where(_R.c.group == group)).all()
        uploads: dict[FileKey, str] = {("uploads", row.sha256): row.sha256 for row in rows}
        # of two rows with the same samples one may be from before their hash was kept
        return uploads | {("normalised", row.normalised): row.samples for row in sorted(rows, key=lambda row: row.samples)}

    def groups(self) -> Iterator[str]:
        with self.store.reading() as connection:
            found = list(connection.execute(select(_R.c.group).distinct()).scalars())
        yield from found


def files_of(recording: Recording) -> list[FileKey]:
    """Return the files of a recording."""
    return [("uploads", recording.sha256), ("normalised", recording.normalised)]


def _keys(rows: Sequence[Any]) -> list[FileKey]:
    return [key for sha256, normalised in rows for key in (("uploads", sha256), ("normalised", normalised))]


def _row(recording: Recording) -> dict[str, Any]:
    row = asdict(recording) | {"digest": digest_of(recording.found)}
    return row | {"usable": int(json.loads(recording.found)["verdict"]["usable"]), "stored": tables.size_of(row)}


def _changed(connection: Connection, group: str, campaign: str) -> None:
    here = (_C.c.group == group, _C.c.id == campaign)
    if connection.execute(update(_C).where(*here).values(changes=_C.c.changes + 1)).rowcount == 0:
        raise KeyError(campaign)
