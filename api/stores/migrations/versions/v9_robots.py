"""Arms by their names, as toolings are kept."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from api.stores.migrations.columns import NAME

revision, down_revision = "9", "8"


def upgrade() -> None:
    op.create_table(
        "robots",
        sa.Column("group", NAME, primary_key=True),
        sa.Column("name", NAME, primary_key=True),
        sa.Column("text", sa.Text, nullable=False),
        sa.Column("summary", sa.Text, nullable=False),
        sa.Column("digest", sa.String(64), nullable=False),
        sa.Column("changed", sa.String(40), nullable=False),
        sa.Column("summary_digest", sa.String(64), nullable=False, server_default=""),
        sa.Column("stored", sa.BigInteger, nullable=False, server_default="0"),
        sa.Index("ix_robots_stored", "group", "stored"),
    )
