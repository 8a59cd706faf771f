"""Jobs in tables: every change is one transaction, and a worker changes only the jobs it still has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from sqlalchemy import ColumnElement, Connection, Subquery, Table, delete, func, insert, select, update
from sqlalchemy.exc import IntegrityError

from api.stores import tables
from api.stores.changes import IDENTIFICATION, Note
from api.stores.database import Database
from api.stores.entities import Document, digest_of, whole
from api.stores.idempotency import earlier, forget_old
from api.stores.jobs import OPEN, PARTIAL, Event, Full, Job, Outcome, Worker
from api.stores.sql_changes import log_document

_JOB = tables.columns_of(tables.jobs, Job)


class SqlJobs:
    """Jobs in tables."""

    def __init__(self, store: Database) -> None:
        self.store = store

    def add(self, job: Job, texts: Mapping[str, str], most: int, repeat: tuple[str, str] | None = None) -> Job:
        t, r, x, m = tables.jobs, tables.job_repeats, tables.job_texts, tables.machines
        try:
            with self.store.writing() as connection:
                if repeat is not None:
                    forget_old(connection, r)
                    first = self._first(connection, job.group, repeat)
                    if first is not None:
                        return first
                # locks the machine: it cannot be deleted until the job is stored
                there = select(m.c.id).where(m.c.group == job.group, m.c.id == job.machine).with_for_update()
                if job.machine and connection.execute(there).first() is None:
                    raise KeyError(job.machine)
                waiting = select(func.count()).where(t.c.group == job.group, t.c.state.in_(OPEN))
                if connection.execute(waiting).scalar_one() >= most:
                    raise Full
                if repeat is not None:
                    row = {"group": job.group, "key": repeat[0], "digest": repeat[1], "id": job.id, "created": job.created}
                    connection.execute(insert(r).values(row))
                self.store.check_room(connection, job.group, tables.size_of(asdict(job)) + sum(map(len, texts.values())))
                connection.execute(insert(t).values(asdict(job) | {"request_digest": digest_of(job.request)}))
                for name, text in texts.items():
                    connection.execute(insert(x).values(job=job.id, name=name, text=text, digest=digest_of(text)))
                _measure(connection, job.id)
                return job
        except IntegrityError:
            # the same key arrived twice at the same moment
            with self.store.reading() as connection:
                first = None if repeat is None else self._first(connection, job.group, repeat)
            if first is None:
                raise
            return first

    def _first(self, connection: Connection, group: str, repeat: tuple[str, str]) -> Job | None:
        row, t = earlier(connection, tables.job_repeats, group, repeat), tables.jobs
        found = None if row is None else connection.execute(select(*_JOB).where(t.c.id == row.id)).first()
        return None if found is None else Job(**found._asdict())

    def get(self, group: str, id: str) -> Job | None:
        found = self.find(id)
        return found if found is not None and found.group == group else None

    def find(self, id: str) -> Job | None:
        with self.store.reading() as connection:
            row = connection.execute(select(*_JOB).where(tables.jobs.c.id == id)).first()
        return None if row is None else Job(**row._asdict())

    def list(self, group: str, wanted: Mapping[str, str], before: str, limit: int) -> list[Job]:
        t = tables.jobs
        query = select(*_JOB).where(t.c.group == group, *(t.c[name] == value for name, value in wanted.items()))
        if before:
            query = query.where(t.c.id < before)
        with self.store.reading() as connection:
            rows = connection.execute(query.order_by(t.c.id.desc()).limit(limit)).all()
        return [Job(**row._asdict()) for row in rows]

    def cancel(self, group: str, id: str, when: str) -> tuple[Job, bool] | None:
        t = tables.jobs
        with self.store.writing() as connection:
            here = (t.c.group == group, t.c.id == id)
            found = connection.execute(select(t).where(*here).with_for_update()).first()
            if found is None:
                return None
            cancelled = found.state in OPEN
            if cancelled:
                _cancel(connection, found, when)
            return Job(**connection.execute(select(*_JOB).where(*here)).one()._asdict()), cancelled

    def watch(self, id: str, when: str) -> None:
        t = tables.jobs
        with self.store.writing() as connection:
            connection.execute(update(t).where(t.c.id == id, t.c.watched.is_not(None)).values(watched=when))

    def watched(self) -> Mapping[str, str]:
        t = tables.jobs
        with self.store.reading() as connection:
            rows = connection.execute(select(t.c.id, t.c.watched).where(t.c.state.in_(OPEN), t.c.watched.is_not(None))).all()
        return {row.id: row.watched for row in rows}

    def abandon(self, id: str, watched: str, when: str, problem: str) -> bool:
        t = tables.jobs
        with self.store.writing() as connection:
            alone = (t.c.id == id, t.c.state.in_(OPEN), t.c.watched == watched)
            found = connection.execute(select(t).where(*alone).with_for_update()).first()
            if found is not None:
                _cancel(connection, found, when, problem)
        return found is not None

    def open(self) -> Sequence[Job]:
        t, turn = tables.jobs, _turns()
        query = select(*_JOB).join(turn, turn.c.id == t.c.id).order_by(turn.c.place, turn.c.served, t.c.id)
        with self.store.reading() as connection:
            rows = connection.execute(query).all()
        return [Job(**row._asdict()) for row in rows]

    def places(self, ids: Sequence[str]) -> dict[str, tuple[int, int]]:
        turn = _turns()
        place = func.row_number().over(partition_by=turn.c.kind, order_by=(turn.c.place, turn.c.served, turn.c.id)).label("place")
        waiting = func.count().over(partition_by=turn.c.kind).label("waiting")
        rank = select(turn.c.id, place, waiting).where(turn.c.state == "queued").subquery()
        with self.store.reading() as connection:
            rows = connection.execute(select(rank).where(rank.c.id.in_(ids))).all()
        return {row.id: (row.place, row.waiting) for row in rows}

    def begin(self, id: str, worker: str, when: str) -> Job | None:
        t = tables.jobs
        with self.store.writing() as connection:
            found = connection.execute(select(t).where(t.c.id == id, t.c.state.in_(OPEN)).with_for_update()).first()
            if found is None:
                return None
            values: dict[str, Any] = {"state": "running", "worker": worker, "attempts": found.attempts + 1}
            connection.execute(update(t).where(t.c.id == id).values(values | {"started": found.started or when}))
            _append(connection, id, found.events, [Event(0, "progress", "")])
            return Job(**connection.execute(select(*_JOB).where(t.c.id == id)).one()._asdict())

    def take(self, id: str, dead: str | None, worker: str) -> bool:
        t = tables.jobs
        before = t.c.worker.is_(None) if dead is None else t.c.worker == dead
        with self.store.writing() as connection:
            return connection.execute(update(t).where(t.c.id == id, before).values(worker=worker)).rowcount > 0

    def tell(self, id: str, worker: str, events: Sequence[Event], progress: str | None = None, further: bool = False) -> bool:
        t = tables.jobs
        with self.store.writing() as connection:
            query = select(t.c.events).where(t.c.id == id, t.c.state == "running", t.c.worker == worker)
            last = connection.execute(query.with_for_update()).scalar()
            if last is None:
                return False
            values = ({} if progress is None else {"progress": progress}) | ({"attempts": 0} if further else {})
            if values:
                connection.execute(update(t).where(t.c.id == id).values(values))
            _append(connection, id, last, [*events, *([] if progress is None else [Event(0, "progress", "", "progress")])])
            return True

    def finish(self, id: str, worker: str | None, outcome: Outcome) -> bool:
        t, x, m = tables.jobs, tables.job_texts, tables.machines
        with self.store.writing() as connection:
            query = select(t).where(t.c.id == id, t.c.state.in_(OPEN))
            found = connection.execute(query.with_for_update()).first()
            if found is None or (worker is not None and found.worker != worker):
                return False
            names = ("state", "status", "problem", "finished", "seconds")
            connection.execute(update(t).where(t.c.id == id).values({name: getattr(outcome, name) for name in names}))
            _forget_partial(connection, id)
            _drop_texts(connection, id)
            for name, text in outcome.texts.items():
                connection.execute(insert(x).values(job=id, name=name, text=text, digest=digest_of(text)))
            _append(connection, id, found.events, [Event(0, "end", "")])
            # a machine that was deleted meanwhile stays deleted
            if outcome.applied is not None and connection.execute(select(m.c.id).where(m.c.id == found.machine).with_for_update()).first():
                _apply(connection, found, outcome)
            return True

    def events(self, id: str, after: int, limit: int) -> Sequence[Event]:
        e = tables.job_events
        with self.store.reading() as connection:
            query = select(e.c.number, e.c.kind, e.c.data, e.c.topic).where(e.c.job == id, e.c.number > after)
            rows = connection.execute(query.order_by(e.c.number).limit(limit)).all()
        return [Event(*row) for row in rows]

    def numbers(self, ids: Sequence[str]) -> dict[str, int]:
        t = tables.jobs
        with self.store.reading() as connection:
            rows = connection.execute(select(t.c.id, t.c.events).where(t.c.id.in_(ids))).all()
        return {row.id: row.events for row in rows}

    def text(self, id: str, name: str) -> str | None:
        x = tables.job_texts
        with self.store.reading() as connection:
            found = connection.execute(select(x.c.text, x.c.digest).where(x.c.job == id, x.c.name == name)).first()
        return None if found is None else whole(found.text, found.digest, f"{name} of the job {id}", "ask for the job once more")

    def forget_events(self, before: str) -> int:
        return self._forget(tables.job_events, before, tables.job_events.c.kind != "end")

    def forget_texts(self, before: str) -> int:
        return self._forget(tables.job_texts, before)

    def _forget(self, part: Table, before: str, *wanted: ColumnElement[bool]) -> int:
        """Remove a part of the jobs that ended before a time, one job after the other: nobody waits long for the database."""
        t = tables.jobs
        with self.store.reading() as connection:
            old = select(part.c.job).distinct().join(t, t.c.id == part.c.job).where(t.c.finished < before, *wanted)
            ids = list(connection.execute(old).scalars())
        for id in ids:
            with self.store.writing() as connection:
                connection.execute(delete(part).where(part.c.job == id, *wanted))
                _measure(connection, id)
        return len(ids)

    def counts(self) -> Sequence[tuple[str, str, int, float]]:
        t = tables.jobs
        with self.store.reading() as connection:
            query = select(t.c.kind, t.c.state, func.count(), func.sum(t.c.seconds)).group_by(t.c.kind, t.c.state)
            rows = connection.execute(query).all()
        return [(kind, state, int(count), float(seconds)) for kind, state, count, seconds in rows]

    def workers(self) -> Sequence[Worker]:
        with self.store.reading() as connection:
            rows = connection.execute(select(tables.job_workers).order_by(tables.job_workers.c.id)).all()
        return [Worker(**row._asdict()) for row in rows]

    def claim(self, worker: Worker, dead: str | None) -> bool:
        w = tables.job_workers
        try:
            with self.store.writing() as connection:
                if dead is not None:
                    gone = connection.execute(delete(w).where(w.c.id == worker.id, w.c.token == dead))
                    if gone.rowcount == 0:
                        return False
                connection.execute(insert(w).values(asdict(worker)))
                return True
        except IntegrityError:
            return False

    def beat(self, id: str, token: str) -> bool:
        w = tables.job_workers
        with self.store.writing() as connection:
            there = update(w).where(w.c.id == id, w.c.token == token).values(beats=w.c.beats + 1)
            return connection.execute(there).rowcount > 0

    def leave(self, id: str, token: str) -> None:
        w, t = tables.job_workers, tables.jobs
        with self.store.writing() as connection:
            connection.execute(update(t).where(t.c.worker == token, t.c.state == "running").values(attempts=0))
            connection.execute(delete(w).where(w.c.id == id, w.c.token == token))


def _turns() -> Subquery:
    """Open jobs and their turn: place within the group, which begins with what runs, and when the group was served last."""
    t, other = tables.jobs, tables.jobs.alias()
    here, line = t.c.state.in_(OPEN), (t.c.kind, t.c.group)
    waiting = select(*line).where(here).distinct().subquery()
    same = (other.c.kind == waiting.c.kind) & (other.c.group == waiting.c.group)
    last = select(waiting, func.max(other.c.started).label("last")).join(other, same).group_by(waiting.c.kind, waiting.c.group).subquery()
    place = func.row_number().over(partition_by=line, order_by=(t.c.state == "queued", t.c.id)).label("place")
    served = func.coalesce(last.c.last, "").label("served")
    joined = (last.c.kind == t.c.kind) & (last.c.group == t.c.group)
    return select(t.c.id, t.c.kind, t.c.state, place, served).join(last, joined).where(here).subquery()


def _append(connection: Connection, job: str, last: int, events: Sequence[Event]) -> None:
    e, t = tables.job_events, tables.jobs
    if not events:
        return
    for topic in {event.topic for event in events if event.topic}:
        connection.execute(delete(e).where(e.c.job == job, e.c.topic == topic))
    # only the last event of a topic is stored
    lasting = [event for i, event in enumerate(events) if not event.topic or all(event.topic != later.topic for later in events[i + 1 :])]
    rows = [asdict(event) | {"job": job, "number": last + 1 + i} for i, event in enumerate(lasting)]
    connection.execute(insert(e), rows)
    connection.execute(update(t).where(t.c.id == job).values(events=last + len(rows)))
    _measure(connection, job)


def _cancel(connection: Connection, job: Any, when: str, problem: str | None = None) -> None:
    t = tables.jobs
    connection.execute(update(t).where(t.c.id == job.id).values(state="cancelled", finished=when, problem=problem))
    _forget_partial(connection, job.id)
    _drop_texts(connection, job.id)
    _append(connection, job.id, job.events, [Event(0, "end", "")])


def _drop_texts(connection: Connection, job: str) -> None:
    """Drop the inputs of a job that is over: they may be much larger than the request, and nobody reads them again."""
    connection.execute(delete(tables.job_texts).where(tables.job_texts.c.job == job))


def _measure(connection: Connection, job: str) -> None:
    """Count what a job says and comes to."""
    t = tables.jobs
    connection.execute(update(t).where(t.c.id == job).values(stored=tables.size_of_job(connection)))


def _forget_partial(connection: Connection, job: str) -> None:
    """Delete what an answer was on its way: the answer itself is there, or nobody wants it."""
    e = tables.job_events
    connection.execute(delete(e).where(e.c.job == job, e.c.kind == PARTIAL))


def _apply(connection: Connection, job: Any, outcome: Outcome) -> None:
    i, c = tables.identifications, tables.campaigns
    assert outcome.applied is not None
    here = (i.c.group == job.group, i.c.name == job.machine)
    before = connection.execute(select(i.c.digest).where(*here)).scalar()
    connection.execute(delete(i).where(*here))
    row = asdict(Document(job.group, job.machine, **asdict(outcome.applied), changed=outcome.finished))
    connection.execute(insert(i).values(row))
    if before != outcome.applied.digest:
        named = connection.execute(select(c.c.name).where(c.c.id == job.campaign)).scalar()
        note = Note(job.key, job.who, f"identified from the campaign {named}" if named else "identified")
        log_document(connection, IDENTIFICATION, row, note, before is None)


def forget_jobs(connection: Connection, group: str, machine: str) -> None:
    """Delete all jobs of a machine with their events and results."""
    t = tables.jobs
    of = select(t.c.id).where(t.c.group == group, t.c.machine == machine)
    for table in (tables.job_events, tables.job_texts):
        connection.execute(delete(table).where(table.c.job.in_(of)))
    connection.execute(delete(t).where(t.c.group == group, t.c.machine == machine))
