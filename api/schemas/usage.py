"""Quotas and what is used of them."""

from __future__ import annotations

from pydantic import Field

from api.schemas.common import Answer


class Quota(Answer):
    """Bytes that a group keeps."""

    used: int
    allowed: int
    kinds: dict[str, int] = Field(description="Of each kind.")


class Usage(Answer):
    """What a group keeps, and what it may keep."""

    files: Quota = Field(description="Uploads, samples that were read from them, and parts of unfinished uploads.")
    database: Quota = Field(description="Everything else, its versions, results and events included.")
