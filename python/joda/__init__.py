"""JODA: joint dynamics for articulated objects in MuJoCo.

Every command is a function here, of the same name and meaning: `joda.attach`, `joda.plot`, ...
They are loaded when they are first used, so that `import joda` stays light.
"""

import warnings
from typing import TYPE_CHECKING, Any

from joda.errors import JodaError
from joda.plugin import load, plugin_path

if TYPE_CHECKING:
    from joda._add import add
    from joda._attach import attach
    from joda._bench import bench
    from joda._compare import compare
    from joda._compile import compile
    from joda._context import context
    from joda._demo import demo
    from joda._diagnose import diagnose
    from joda._generate import generate
    from joda._generate_all import generate_all
    from joda._hidden_effect import hidden_effect
    from joda._improve import improve
    from joda._plot import plot
    from joda._refine import refine
    from joda._render import render
    from joda._revise import revise
    from joda._schema import schema
    from joda._templates import templates
    from joda.profile import Profile
    from joda.scene import read_profiles, set_profile

try:
    load()
except JodaError as error:  # the command line and every use of the plugin say it again, and stop
    warnings.warn(str(error), RuntimeWarning, stacklevel=2)

__version__ = "0.1.0"
__all__ = [
    "JodaError",
    "Profile",
    "add",
    "attach",
    "bench",
    "compare",
    "compile",
    "context",
    "demo",
    "diagnose",
    "generate",
    "generate_all",
    "hidden_effect",
    "improve",
    "plot",
    "plugin_path",
    "read_profiles",
    "refine",
    "render",
    "revise",
    "schema",
    "set_profile",
    "templates",
]

COMMANDS = (
    "add",
    "attach",
    "bench",
    "compare",
    "compile",
    "context",
    "demo",
    "diagnose",
    "generate",
    "improve",
    "plot",
    "refine",
    "render",
    "revise",
    "schema",
    "templates",
)
_LAZY = {
    "Profile": "joda.profile",
    "generate_all": "joda._generate_all",
    "hidden_effect": "joda._hidden_effect",
    "read_profiles": "joda.scene",
    "set_profile": "joda.scene",
    **{name: f"joda._{name}" for name in COMMANDS},
}


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module 'joda' has no attribute '{name}'")
    from importlib import import_module

    return getattr(import_module(_LAZY[name]), name)
