"""An independent simulator of joints that hide a physical effect, to examine a diagnosis with.

Its laws are analytic, and it shares nothing with MuJoCo, the plugin or the templates.
"""

from joda.hidden.cases import EFFECTS, UNCATALOGUED, Case, draw, write
from joda.hidden.families import FAMILIES

__all__ = ["EFFECTS", "FAMILIES", "UNCATALOGUED", "Case", "draw", "write"]
