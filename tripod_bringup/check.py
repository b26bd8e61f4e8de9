"""One finding of the doctor."""

from dataclasses import dataclass
from enum import Enum


class Verdict(Enum):
    """Result of a check."""

    OK = "ok"
    WARN = "warn"
    FAIL = "fail"


@dataclass(frozen=True)
class Check:
    """One finding.

    Attributes:
        name: What was looked at.
        verdict: Its result.
        found: What was found.
        advice: What to do; empty when all is well.
    """

    name: str
    verdict: Verdict
    found: str
    advice: str = ""
