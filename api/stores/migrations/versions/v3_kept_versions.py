"""Versions with who, when and why; keys that expire; jobs that know who asked for them."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from api.stores.migrations.columns import NAME

revision, down_revision = "3", "2"


def upgrade() -> None:
    op.create_table(
        "changes",
        sa.Column("id", sa.Integer, primary_key=True, autoincrement=True),
        sa.Column("group", NAME, nullable=False),
        sa.Column("kind", sa.String(16), nullable=False),
        sa.Column("name", NAME, nullable=False),
        sa.Column("title", NAME, nullable=False),
        sa.Column("version", sa.Integer, nullable=False),
        sa.Column("action", sa.String(16), nullable=False),
        sa.Column("restores", sa.Integer, nullable=False),
        sa.Column("created", sa.String(40), nullable=False),
        sa.Column("key", NAME, nullable=False),
        sa.Column("who", sa.String(200), nullable=False),
        sa.Column("why", sa.String(400), nullable=False),
        sa.Column("text", sa.Text, nullable=False),
        sa.Column("summary", sa.Text, nullable=False),
        sa.Column("digest", sa.String(64), nullable=False),
        sa.UniqueConstraint("group", "kind", "name", "version"),
        sa.Index("ix_changes_group", "group", "id"),
    )
    with op.batch_alter_table("keys") as table:
        table.add_column(sa.Column("expires", sa.String(40)))
        table.add_column(sa.Column("used", sa.String(40)))
    with op.batch_alter_table("jobs") as table:
        table.add_column(sa.Column("key", NAME, nullable=False, server_default=""))
        table.add_column(sa.Column("who", sa.String(200), nullable=False, server_default=""))
    # what is there is version 1, whoever wrote it
    for kind, source, name, title, created, content in (
        ("machine", "machines m", "id", "name", "created", "'', '', ''"),
        (
            "identification",
            "identifications m",
            "name",
            'coalesce((SELECT o.name FROM machines o WHERE o."group" = m."group" AND o.id = m.name), m.name)',
            "changed",
            "text, summary, digest",
        ),
        ("tooling", "toolings m", "name", "name", "changed", "text, summary, digest"),
    ):
        op.execute(
            'INSERT INTO changes ("group", kind, name, title, version, action, restores, created, key, who, why, text, summary, digest) '
            f"SELECT \"group\", '{kind}', {name}, {title}, 1, 'made', 0, {created}, '', '', "
            f"'it was there before versions were kept', {content} FROM {source} ORDER BY {name}"
        )
