"""Machines, toolings, identifications, API keys and repeated calls."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from api.stores.migrations.columns import NAME

revision, down_revision = "1", None


def upgrade() -> None:
    op.create_table("meta", sa.Column("schema_version", sa.Integer, nullable=False))
    op.create_table(
        "keys",
        sa.Column("id", NAME, primary_key=True),
        sa.Column("group", NAME, nullable=False, index=True),
        sa.Column("label", sa.String(200), nullable=False),
        sa.Column("scopes", sa.String(200), nullable=False),
        sa.Column("secret_hash", sa.String(64), nullable=False),
        sa.Column("created", sa.String(40), nullable=False),
    )
    op.create_table(
        "machines",
        sa.Column("id", NAME, primary_key=True),
        sa.Column("group", NAME, nullable=False),
        sa.Column("name", NAME, nullable=False),
        sa.Column("description", sa.Text, nullable=False),
        sa.Column("created", sa.String(40), nullable=False),
        sa.UniqueConstraint("group", "name"),
    )
    op.create_table(
        "idempotency_keys",
        sa.Column("group", NAME, primary_key=True),
        sa.Column("key", sa.String(200), primary_key=True),
        sa.Column("digest", sa.String(64), nullable=False),
        sa.Column("id", NAME, nullable=False),
        sa.Column("name", NAME, nullable=False),
        sa.Column("description", sa.Text, nullable=False),
        sa.Column("created", sa.String(40), nullable=False, index=True),
    )
    for name in ("identifications", "toolings"):
        op.create_table(
            name,
            sa.Column("group", NAME, primary_key=True),
            sa.Column("name", NAME, primary_key=True),
            sa.Column("text", sa.Text, nullable=False),
            sa.Column("summary", sa.Text, nullable=False),
            sa.Column("digest", sa.String(64), nullable=False),
            sa.Column("changed", sa.String(40), nullable=False),
        )
