"""The paper's cases, each a number that parts a profile from both baselines, over seeds."""

from joda.cases.base import Case
from joda.cases.table import CASES

__all__ = ["CASES", "Case"]
