"""Campaigns with their recordings, and jobs with what they tell."""

from __future__ import annotations

from typing import Any

import sqlalchemy as sa
from alembic import op

from api.stores.migrations.columns import FILE_NAME, NAME

revision, down_revision = "2", "1"


def upgrade() -> None:
    _table(
        "campaigns",
        sa.Column("id", NAME, primary_key=True),
        sa.Column("group", NAME, nullable=False),
        sa.Column("machine", NAME, nullable=False),
        sa.Column("name", sa.String(200), nullable=False),
        sa.Column("text", sa.Text, nullable=False),
        sa.Column("cuts", sa.Integer, nullable=False),
        sa.Column("created", sa.String(40), nullable=False),
        sa.Column("changes", sa.Integer, nullable=False),
        sa.Column("settled", sa.Integer, nullable=False),
        sa.Index("ix_campaigns_machine", "group", "machine"),
    )
    _table(
        "recordings",
        sa.Column("campaign", NAME, primary_key=True),
        sa.Column("name", FILE_NAME, primary_key=True),
        sa.Column("group", NAME, nullable=False, index=True),
        sa.Column("role", sa.String(8), nullable=False),
        sa.Column("size", sa.BigInteger, nullable=False),
        sa.Column("sha256", sa.String(64), nullable=False),
        sa.Column("normalised", sa.String(64), nullable=False),
        sa.Column("found", sa.Text, nullable=False),
        sa.Column("usable", sa.Integer, nullable=False),
        sa.Column("judged_with", sa.String(64), nullable=False),
        sa.Column("created", sa.String(40), nullable=False),
    )
    _table(
        "jobs",
        sa.Column("id", NAME, primary_key=True),
        sa.Column("group", NAME, nullable=False),
        sa.Column("kind", sa.String(32), nullable=False),
        sa.Column("machine", NAME, nullable=False),
        sa.Column("campaign", NAME),
        sa.Column("request", sa.Text, nullable=False),
        sa.Column("state", sa.String(16), nullable=False, index=True),
        sa.Column("created", sa.String(40), nullable=False),
        sa.Column("progress", sa.Text),
        sa.Column("status", sa.String(16)),
        sa.Column("problem", sa.Text),
        sa.Column("started", sa.String(40)),
        sa.Column("finished", sa.String(40)),
        sa.Column("seconds", sa.Float, nullable=False),
        sa.Column("attempts", sa.Integer, nullable=False),
        sa.Column("worker", sa.String(64)),
        sa.Column("events", sa.Integer, nullable=False),
        sa.Index("ix_jobs_group", "group", "kind", "id"),
    )
    _table(
        "job_events",
        sa.Column("job", NAME, primary_key=True),
        sa.Column("number", sa.Integer, primary_key=True),
        sa.Column("kind", sa.String(16), nullable=False),
        sa.Column("data", sa.Text, nullable=False),
        sa.Column("topic", sa.String(32), nullable=False),
    )
    _table(
        "job_texts",
        sa.Column("job", NAME, primary_key=True),
        sa.Column("name", sa.String(32), primary_key=True),
        sa.Column("text", sa.Text, nullable=False),
    )
    _table(
        "job_workers",
        sa.Column("id", NAME, primary_key=True),
        sa.Column("place", sa.String(64), nullable=False),
        sa.Column("process", sa.String(64), nullable=False),
        sa.Column("token", sa.String(64), nullable=False),
        sa.Column("beats", sa.BigInteger, nullable=False),
    )
    for name in ("campaign_idempotency_keys", "job_idempotency_keys"):
        _table(
            name,
            sa.Column("group", NAME, primary_key=True),
            sa.Column("key", sa.String(200), primary_key=True),
            sa.Column("digest", sa.String(64), nullable=False),
            sa.Column("id", NAME, nullable=False),
            sa.Column("created", sa.String(40), nullable=False, index=True),
        )


def _table(name: str, *parts: Any) -> None:
    """Make a table with its indexes where it is not there: a store of this version may have some of them."""
    if not sa.inspect(op.get_bind()).has_table(name):
        op.create_table(name, *parts)
