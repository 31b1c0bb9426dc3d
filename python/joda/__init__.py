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
    from joda.cases.experiments import experiments
    from joda.commands.add import add
    from joda.commands.bench import bench
    from joda.commands.compare import compare
    from joda.commands.demo import demo
    from joda.commands.diagnose import diagnose
    from joda.commands.doctor import doctor
    from joda.commands.each_joint import compare_all, diagnose_all, improve_all
    from joda.commands.estimate import estimate
    from joda.commands.evaluate import evaluate
    from joda.commands.export import export
    from joda.commands.generate import generate
    from joda.commands.generate_all import generate_all
    from joda.commands.hidden_effect import hidden_effect
    from joda.commands.import_log import import_log
    from joda.commands.improve import improve
    from joda.commands.plot import plot
    from joda.commands.refine import refine
    from joda.commands.review import Decision
    from joda.commands.revise import revise
    from joda.commands.schema import schema
    from joda.commands.simulate import simulate
    from joda.commands.studio import studio
    from joda.commands.templates import templates
    from joda.commands.weigh import weigh
    from joda.compiling import compile
    from joda.distributed.folder import distribute
    from joda.pictures.positions import render
    from joda.profile import Profile
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
    **{name: f"joda.commands.{name}" for name in COMMANDS},
    "Decision": "joda.commands.review",
    "Profile": "joda.profile",
    "attach": "joda.scenes.attaching",
    "compare_all": "joda.commands.each_joint",
    "compile": "joda.compiling",
    "context": "joda.scenes.context",
    "diagnose_all": "joda.commands.each_joint",
    "distribute": "joda.distributed.folder",
    "estimate": "joda.commands.estimate",
    "experiments": "joda.cases.experiments",
    "generate_all": "joda.commands.generate_all",
    "hidden_effect": "joda.commands.hidden_effect",
    "import_log": "joda.commands.import_log",
    "improve_all": "joda.commands.each_joint",
    "read_profiles": "joda.scenes.scene",
    "render": "joda.pictures.positions",
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
