"""JODA: joint dynamics for articulated objects in MuJoCo."""

from joda.errors import JodaError
from joda.plugin import load, plugin_path, set_profile

load()

__version__ = "0.1.0"
__all__ = ["JodaError", "plugin_path", "set_profile"]
