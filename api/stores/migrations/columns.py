"""Types of columns that several revisions name."""

from __future__ import annotations

import sqlalchemy as sa

# names compare by their bytes: the order of lists must not depend on the database's locale
NAME = sa.String(128).with_variant(sa.String(128, collation="C"), "postgresql")
FILE_NAME = sa.String(200).with_variant(sa.String(200, collation="C"), "postgresql")
