"""A size of every row, and an index that sums them for each group."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision, down_revision = "5", "4"

_COUNTED = (
    "keys", "machines", "idempotency_keys", "identifications", "toolings", "changes", "campaigns", "campaign_idempotency_keys",
    "recordings", "jobs", "job_idempotency_keys",
)  # fmt: skip
#: Of a row beside its texts [bytes].
_ROW = 100


def upgrade() -> None:
    for name in (*_COUNTED, "job_events", "job_texts"):
        texts = [column["name"] for column in sa.inspect(op.get_bind()).get_columns(name) if isinstance(column["type"], sa.String)]
        with op.batch_alter_table(name) as batch:
            batch.add_column(sa.Column("stored", sa.BigInteger, nullable=False, server_default="0"))
        if name in _COUNTED:
            op.create_index(f"ix_{name}_stored", name, ["group", "stored"])
        table = sa.table(name, sa.column("stored"), *map(sa.column, texts))
        op.execute(sa.update(table).values(stored=sum(map(_bytes, (table.c[each] for each in texts)), sa.literal(_ROW))))
    jobs = sa.table("jobs", sa.column("id"), sa.column("request"), sa.column("stored"))
    parts = [sa.table(name, sa.column("job"), sa.column("stored")) for name in ("job_events", "job_texts")]
    told = [sa.select(sa.func.coalesce(sa.func.sum(t.c.stored), 0)).where(t.c.job == jobs.c.id).scalar_subquery() for t in parts]
    op.execute(sa.update(jobs).values(stored=sum(told, sa.literal(_ROW) + _bytes(jobs.c.request))))


def _bytes(column: sa.ColumnClause[str]) -> sa.ColumnElement[int]:
    """Return the length of a text in UTF-8, for which SQLite has a function of its own since 3.43 only."""
    length = sa.func.length(sa.cast(column, sa.LargeBinary)) if op.get_bind().dialect.name == "sqlite" else sa.func.octet_length(column)
    return sa.func.coalesce(length, 0)
