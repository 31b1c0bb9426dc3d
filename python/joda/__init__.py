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
    from joda.commands.add import add
    from joda.commands.bench import bench
    from joda.commands.compare import compare, compare_all
    from joda.commands.demo import demo
    from joda.commands.diagnose import diagnose, diagnose_all
    from joda.commands.distribute import distribute
    from joda.commands.doctor import doctor
    from joda.commands.evaluate import evaluate
    from joda.commands.experiments import experiments
    from joda.commands.export import export
    from joda.commands.generate import generate
    from joda.commands.hidden_effect import hidden_effect
    from joda.commands.import_log import import_log
    from joda.commands.improve import improve, improve_all
    from joda.commands.plot import plot
    from joda.commands.refine import refine
    from joda.commands.revise import revise
    from joda.commands.schema import schema
    from joda.commands.simulate import simulate
    from joda.commands.studio import studio
    from joda.commands.templates import templates
    from joda.commands.weigh import weigh
    from joda.compiling import compile
    from joda.pictures.positions import render
    from joda.profile import Profile
    from joda.propose.estimate import estimate
    from joda.propose.generate_all import generate_all
    from joda.propose.review import Decision
    from joda.scenes.attaching import attach
    from joda.scenes.context import context
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
    "compare_all",
    "compile",
    "context",
    "demo",
    "diagnose",
    "diagnose_all",
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
    "improve_all",
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
    "demo",
    "attach",
    "compile",
    "context",
    "generate",
    "revise",
    "plot",
    "simulate",
    "import",
    "compare",
    "diagnose",
    "add",
    "improve",
    "refine",
    "render",
    "experiments",
    "studio",
    "export",
    "distribute",
    "evaluate",
    "bench",
    "schema",
    "templates",
    "weigh",
    "doctor",
)
"""In the order of the README."""
_MODULES = ("effects", "field", "mjx", "warp")
_LAZY = {
    **{name: f"joda.commands.{name}" for name in COMMANDS},
    "Decision": "joda.propose.review",
    "Profile": "joda.profile",
    "compare_all": "joda.commands.compare",
    "diagnose_all": "joda.commands.diagnose",
    "estimate": "joda.propose.estimate",
    "generate_all": "joda.propose.generate_all",
    "hidden_effect": "joda.commands.hidden_effect",
    "import_log": "joda.commands.import_log",
    "improve_all": "joda.commands.improve",
    "read_profiles": "joda.scenes.scene",
    "set_profile": "joda.scenes.scene",
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
