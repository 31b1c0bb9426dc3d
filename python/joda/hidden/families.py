"""The families that cases are drawn from; but for `field`, which has the laws of the
others, they share no form of a law, motion or instrument."""

from joda.hidden.family import Family
from joda.hidden.field import FIELD
from joda.hidden.household import HOUSEHOLD
from joda.hidden.laboratory import LABORATORY
from joda.hidden.machinery import MACHINERY
from joda.hidden.switches import SWITCHES

FAMILIES: dict[str, Family] = {
    family.name: family for family in (LABORATORY, HOUSEHOLD, SWITCHES, MACHINERY, FIELD)
}
