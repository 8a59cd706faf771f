"""A digest beside what was found in every recording; what is there counts as whole."""

from __future__ import annotations

import hashlib

import sqlalchemy as sa
from alembic import op

revision, down_revision = "8", "7"


def upgrade() -> None:
    with op.batch_alter_table("recordings") as batch:
        batch.add_column(sa.Column("digest", sa.String(64), nullable=False, server_default=""))
    connection = op.get_bind()
    table = sa.table("recordings", *map(sa.column, ("campaign", "name", "found", "digest")))
    for campaign, name in connection.execute(sa.select(table.c.campaign, table.c.name)).all():
        here = (table.c.campaign == campaign, table.c.name == name)
        found = connection.execute(sa.select(table.c.found).where(*here)).scalar_one()
        digest = hashlib.sha256(found.encode("utf-8")).hexdigest()[:32]
        connection.execute(sa.update(table).where(*here).values(digest=digest))
