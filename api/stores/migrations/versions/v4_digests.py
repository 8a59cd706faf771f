"""A digest beside every text and every file; what is there counts as whole."""

from __future__ import annotations

import hashlib

import sqlalchemy as sa
from alembic import op

revision, down_revision = "4", "3"


def upgrade() -> None:
    connection = op.get_bind()
    for name, column in (("campaigns", "digest"), ("recordings", "samples"), ("job_texts", "digest")):
        with op.batch_alter_table(name) as batch:
            batch.add_column(sa.Column(column, sa.String(64), nullable=False, server_default=""))
    for name, own in (("campaigns", ("id",)), ("job_texts", ("job", "name"))):
        table = sa.table(name, *map(sa.column, (*own, "text", "digest")))
        # one text after the other: together they may be larger than the memory
        for row in connection.execute(sa.select(*(table.c[key] for key in own))).all():
            here = [table.c[key] == value for key, value in zip(own, row, strict=True)]
            content = connection.execute(sa.select(table.c.text).where(*here)).scalar_one()
            digest = hashlib.sha256(content.encode("utf-8")).hexdigest()[:32]
            connection.execute(sa.update(table).where(*here).values(digest=digest))
