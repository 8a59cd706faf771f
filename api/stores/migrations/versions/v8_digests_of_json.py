"""A digest beside verdicts, summaries and what jobs were asked; what is there counts as whole."""

from __future__ import annotations

import hashlib

import sqlalchemy as sa
from alembic import op

revision, down_revision = "8", "7"

#: Table, what names its rows, text, digest.
_TEXTS = (
    ("recordings", ("campaign", "name"), "found", "digest"),
    ("identifications", ("group", "name"), "summary", "summary_digest"),
    ("toolings", ("group", "name"), "summary", "summary_digest"),
    ("changes", ("id",), "summary", "summary_digest"),
    ("jobs", ("id",), "request", "request_digest"),
)


def upgrade() -> None:
    connection = op.get_bind()
    for name, own, text, digest in _TEXTS:
        with op.batch_alter_table(name) as batch:
            batch.add_column(sa.Column(digest, sa.String(64), nullable=False, server_default=""))
        table = sa.table(name, *map(sa.column, (*own, text, digest, "stored")))
        for row in connection.execute(sa.select(*(table.c[key] for key in own))).all():
            here = [table.c[key] == value for key, value in zip(own, row, strict=True)]
            content = connection.execute(sa.select(table.c[text]).where(*here)).scalar_one()
            found = hashlib.sha256(content.encode("utf-8")).hexdigest()[:32]
            # of a job only what it was asked and what it comes to count
            more = 0 if name == "jobs" else len(found)
            connection.execute(sa.update(table).where(*here).values({digest: found, "stored": table.c.stored + more}))
