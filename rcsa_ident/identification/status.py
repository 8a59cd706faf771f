"""May an answer be used?"""

from __future__ import annotations

from enum import StrEnum


class Status(StrEnum):
    """May the answer be used?"""

    CONVERGED = "converged"
    SUSPECT = "suspect"
    FAILED = "failed"
