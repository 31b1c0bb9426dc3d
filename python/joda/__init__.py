"""JODA: joint dynamics for articulated objects in MuJoCo.

Every command is a function here, of the same name and meaning: `joda.attach`, `joda.plot`, ...;
but `joda import` is `joda.import_log`, as Python has `import` for itself.
They are loaded when they are first used, and the plugin with them, so that `import joda` stays
light: it imports neither MuJoCo nor NumPy. Only a MuJoCo before 4.0, which looks for no plugins,
is imported at once.
"""

import warnings
from importlib import import_module
from typing import TYPE_CHECKING, Any

from joda.errors import JodaError
from joda.plugin import load, load_into_older, plugin_path

if TYPE_CHECKING:
    from joda._add import add
    from joda._attach import attach
    from joda._bench import bench
    from joda._compare import compare
    from joda._compile import compile
    from joda._context import context
    from joda._demo import demo
    from joda._diagnose import diagnose
    from joda._distribute import distribute
    from joda._doctor import doctor
    from joda._estimate import estimate
    from joda._evaluate import evaluate
    from joda._experiments import experiments
    from joda._export import export
    from joda._generate import generate
    from joda._generate_all import generate_all
    from joda._hidden_effect import hidden_effect
    from joda._import_log import import_log
    from joda._improve import improve
    from joda._plot import plot
    from joda._refine import refine
    from joda._render import render
    from joda._review import Decision
    from joda._revise import revise
    from joda._schema import schema
    from joda._simulate import simulate
    from joda._studio import studio
    from joda._templates import templates
    from joda._weigh import weigh
    from joda.profile import Profile
    from joda.scenes.scene import read_profiles, set_profile

__version__ = "0.1.0"
__all__ = [
    "Decision",
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
    "distribute",
    "doctor",
    "estimate",
    "evaluate",
    "experiments",
    "export",
    "generate",
    "generate_all",
    "hidden_effect",
    "import_log",
    "improve",
    "plot",
    "plugin_path",
    "read_profiles",
    "refine",
    "render",
    "revise",
    "schema",
    "set_profile",
    "simulate",
    "studio",
    "templates",
    "weigh",
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
    "distribute",
    "doctor",
    "evaluate",
    "experiments",
    "export",
    "generate",
    "import",
    "improve",
    "plot",
    "refine",
    "render",
    "revise",
    "schema",
    "simulate",
    "studio",
    "templates",
    "weigh",
)
_MODULES = ("effects", "field", "mjx", "warp")
_LAZY = {
    "Decision": "joda._review",
    "Profile": "joda.profile",
    "estimate": "joda._estimate",
    "generate_all": "joda._generate_all",
    "hidden_effect": "joda._hidden_effect",
    "read_profiles": "joda.scenes.scene",
    "set_profile": "joda.scenes.scene",
    **{name: f"joda._{name}" for name in COMMANDS},
    "import_log": "joda._import_log",
}


def __getattr__(name: str) -> Any:
    if name == "import":  # a word of Python's own, which nobody can write
        name = "import_log"
    if name in _MODULES:
        return import_module(f"joda.{name}")
    if name not in _LAZY:
        raise AttributeError(f"module 'joda' has no attribute '{name}'")
    if name != "doctor":
        load()  # MuJoCo 4 did so by itself when it was imported; this says what is wrong if not
    return getattr(import_module(_LAZY[name]), name)


try:
    load_into_older()
except JodaError as error:  # whatever needs the plugin says so again, and stops
    warnings.warn(str(error), stacklevel=2)
