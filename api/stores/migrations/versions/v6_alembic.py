"""Alembic keeps the number from here on."""

from __future__ import annotations

from alembic import op

revision, down_revision = "6", "5"


def upgrade() -> None:
    # releases before this one look here alone, and refuse what is above their own number
    op.execute("UPDATE meta SET schema_version = 6")
