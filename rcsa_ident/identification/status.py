"""May an answer be used?"""

from __future__ import annotations

from enum import StrEnum


class Status(StrEnum):
    """May the answer be used? With doubts where it is suspect; one that has failed has no axes."""

    CONVERGED = "converged"
    SUSPECT = "suspect"
    FAILED = "failed"
