"""What Alembic runs: in the transaction of the service, or on a database that a contributor names."""

from __future__ import annotations

from alembic import context
from sqlalchemy import Connection

from api.stores import tables
from api.stores.engines import engine_of


def _run(connection: Connection) -> None:
    context.configure(connection=connection, target_metadata=tables.metadata, render_as_batch=True)
    with context.begin_transaction():
        context.run_migrations()


if "connection" in context.config.attributes:
    _run(context.config.attributes["connection"])
else:
    engine = engine_of(context.get_x_argument(as_dictionary=True)["url"])
    with engine.begin() as own:
        _run(own)
    engine.dispose()
