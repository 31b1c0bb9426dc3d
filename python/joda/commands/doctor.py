"""What is installed, whether it works, and what to do where it does not.

What may fail, even by crashing, is tried in child processes of this Python, all at once. Nothing
here needs MuJoCo, so that a broken MuJoCo is told too.
"""

import os
import platform
import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from ctypes.util import find_library
from dataclasses import asdict, dataclass
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

import typer

from joda.companions import MJX, WARP
from joda.errors import JodaError
from joda.files import cache_folder
from joda.making import compiler
from joda.plain import plain
from joda.plugin import PLUGIN, made_here, plugin_path
from joda.terminal import options
from joda.terminal.progress import spinner
from joda.terminal.say import print_json, say

State = Literal["ok", "missing", "broken"]

EXTRAS = {
    "mjx": ("jax", "mujoco.mjx", "joda.mjx"),
    "warp": ("warp", "mujoco_warp", "joda.warp"),
    "vlm": ("anthropic", "openai"),
    "studio": ("nicegui",),
    "import": ("pyarrow", "rosbags"),
    "export": ("pxr",),
    "ray": ("ray",),
}
"""What each extra lets one import."""
COMPANIONS = {"mjx": MJX, "warp": WARP}
"""The extras whose packages go with one MuJoCo only."""
LIBRARIES = "numpy", "scipy", "pydantic", "matplotlib", "PIL", "rich", "threadpoolctl", "typer"
RENDERERS = {
    "egl": ("pictures: EGL", "EGL", "libegl1 libgl1-mesa-dri"),
    "osmesa": ("pictures: OSMesa", "OSMesa", "libosmesa6"),
    "glfw": ("window: GLX", "GL", "libgl1"),
}
"""Of each: what it makes, its library, and Debian's packages."""
SOURCES = Path(__file__).resolve().parents[1] / "cpp"
"""Of the plugin, which a wheel has not."""
NAMED = "joda.errors.JodaError: "
"""How Python begins the line of an error of joda's own."""
PATIENCE = 120.0
"""For a child, s."""
FORCE = 1.3
"""What the plugin gives at s = 0.3 of a force that goes from 1 to 2 over the range, N·m."""

PLUGIN_CODE = f"""
import mujoco
if int(mujoco.__version__.partition(".")[0]) < 4:
    import joda
model = mujoco.MjModel.from_xml_string('''<mujoco>
  <extension><plugin plugin="{PLUGIN}"><instance name="p">
    <config key="conservative" value="0 1 | 0 1 | 1 2"/></instance></plugin></extension>
  <worldbody><body><joint range="0 1" limited="true"/><geom size=".1"/><plugin instance="p"/></body>
  </worldbody><compiler angle="radian"/></mujoco>''')
data = mujoco.MjData(model)
data.qpos[0] = 0.3
mujoco.mj_forward(model, data)
print(data.qfrc_passive[0])
"""
PICTURE_CODE = """
import mujoco
model = mujoco.MjModel.from_xml_string(
    '<mujoco><worldbody><geom size="1" rgba="1 1 1 1"/></worldbody></mujoco>')
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with mujoco.Renderer(model, 32, 32) as renderer:
    renderer.update_scene(data)
    print(renderer.render().max() > 50)
"""


@dataclass(frozen=True)
class Check:
    """One thing that was looked at.

    Attributes:
        what: it is.
        state: it is there and works, is not there, or does not work.
        found: its version and place, or what went wrong.
        remedy: what to do, a sentence; "" where nothing need be done.
        needed: whether joda does not work without.
    """

    what: str
    state: State
    found: str
    remedy: str = ""
    needed: bool = False

    @property
    def fatal(self) -> bool:
        """Whether joda does not work because of it."""
        return self.needed and self.state != "ok"


def _pip(*arguments: str) -> str:
    """How to install something for this Python; pip or, where there is none, uv does it."""
    pip = f"{shlex.quote(sys.executable)} -m pip install"
    if not find_spec("pip"):
        pip = f"uv pip install --python {shlex.quote(sys.executable)}"
    return f"run: {pip} {shlex.join(arguments)}"


REINSTALL = f"in a clone of joda, {_pip('--force-reinstall', '--no-deps', '.')}"

COMPILER = "on Debian or Ubuntu, run: apt-get install g++, or install a wheel of joda"
ANOTHER = (
    "name a C++17 compiler that works with CXX, or a folder that can be written with "
    "XDG_CACHE_HOME, or install a wheel of joda"
)


def doctor() -> list[Check]:
    """Looks at everything that joda uses; takes some seconds. What needs MuJoCo is not tried where
    that does not work."""
    engine = _mujoco()
    works = not engine.fatal
    tried = [extra for extra in EXTRAS if works or extra not in COMPANIONS]
    parts: list[Callable[[], list[Check]]] = [
        *([_plugin] if works else []),
        _libraries,
        *([_renderers] if works else []),
        lambda: _extras(tried),
        *(_key, _cache),
    ]
    with ThreadPoolExecutor() as pool:
        found = pool.map(lambda part: part(), parts)
        return [*_here(engine), *(check for checks in found for check in checks)]


def _here(engine: Check) -> list[Check]:
    return [
        Check("Python", "ok", f"{platform.python_version()}, {sys.executable}"),
        Check("joda", "ok", f"{metadata.version('joda')}, {Path(__file__).resolve().parents[1]}"),
        engine,
        Check("cores", "ok", str(_cores())),
    ]


def _cores() -> int | None:
    """How many this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count()


def _mujoco() -> Check:
    remedy = _pip("mujoco")
    try:
        found = metadata.version("mujoco")
    except metadata.PackageNotFoundError:
        return Check("MuJoCo", "missing", "not installed", remedy, needed=True)
    works, told = _child("import mujoco; print(mujoco.__file__)")
    if not works:
        backend = os.environ.get("MUJOCO_GL")
        remedy = (
            f"unset MUJOCO_GL, which is '{backend}'" if backend else f"{remedy} --force-reinstall"
        )
        return Check("MuJoCo", "broken", told, remedy, needed=True)
    return Check("MuJoCo", "ok", f"{found}, {Path(told).parent}", needed=True)


def _plugin() -> list[Check]:
    try:
        path = plugin_path()
    except JodaError as error:
        remedy = ANOTHER if compiler() else COMPILER
        if not SOURCES.is_dir():
            remedy = REINSTALL
        return [Check("plugin", "missing", str(error).rstrip("."), remedy, needed=True)]
    remedy = f"run: {shlex.join(['rm', str(path)])}" if made_here(path) else REINSTALL
    works, told = _child(PLUGIN_CODE)
    if not works:
        return [Check("plugin", "broken", f"{path} does not load: {told}", remedy, needed=True)]
    if abs(float(told) - FORCE) > 1e-12:
        told = f"{path} gives a force of {told} N·m where {FORCE} is right"
        return [Check("plugin", "broken", told, remedy, needed=True)]
    return [Check("plugin", "ok", f"{path} loads and gives the right force", needed=True)]


def _libraries() -> list[Check]:
    works, told = _child(f"import {', '.join(LIBRARIES)}")
    remedy = _pip(*_required())
    if not works:
        return [Check("libraries", "broken", told, remedy, needed=True)]
    return [Check("libraries", "ok", ", ".join(LIBRARIES), needed=True)]


def _renderers() -> list[Check]:
    """One of those that make pictures is needed; a window is only for looking."""
    asked = os.environ.get("MUJOCO_GL")
    if asked:
        found = _renderer(asked, "unset MUJOCO_GL, so that joda chooses")
        return [Check(found.what, found.state, found.found, found.remedy, needed=True)]
    pictures = [_renderer(backend) for backend in ("egl", "osmesa")]
    some = any(check.state == "ok" for check in pictures)
    checks = [
        Check(c.what, c.state, c.found, "" if some else c.remedy, needed=not some) for c in pictures
    ]
    if os.environ.get("DISPLAY"):
        return [*checks, _renderer("glfw")]
    return [*checks, Check("window: GLX", "missing", "no display (DISPLAY is not set)")]


def _renderer(backend: str, remedy: str = "") -> Check:
    title, library, packages = RENDERERS.get(backend, (f"pictures: MUJOCO_GL={backend}", "", ""))
    works, told = _child(PICTURE_CODE, MUJOCO_GL=backend)
    if works and told == "True":
        return Check(title, "ok", "renders off screen")
    remedy = remedy or f"on Debian or Ubuntu, run: apt-get install {packages}"
    if library and not find_library(library):
        return Check(title, "missing", "not installed", remedy)
    return Check(title, "broken", "renders a black picture" if works else told, remedy)


def _extras(extras: Iterable[str] = EXTRAS) -> list[Check]:
    return [_extra(extra, EXTRAS[extra]) for extra in extras]


def _extra(extra: str, modules: tuple[str, ...]) -> Check:
    code = f"import {', '.join(modules)}"
    works, told = _child(code)
    if works:
        return Check(f"extra: {extra}", "ok", ", ".join(modules))
    state: State = "missing" if told.startswith("ModuleNotFoundError") else "broken"
    return Check(f"extra: {extra}", state, told.removeprefix(NAMED), _extra_remedy(extra))


def _extra_remedy(extra: str) -> str:
    """How to install an extra; the MuJoCo that is there stays."""
    if extra not in COMPANIONS:
        return f"only if you want it, {_pip(*_required(extra))}"
    companion = COMPANIONS[extra]
    pins = companion.pins()
    if not pins:
        return f"only if you want it, in another environment: {companion.elsewhere()}"
    others = [one for one in _required(extra) if not one.startswith(companion.package)]
    return f"only if you want it, {_pip(*others, *pins)}"


def _key() -> list[Check]:
    what = "key: Claude"
    if os.environ.get("ANTHROPIC_API_KEY"):
        return [Check(what, "ok", "ANTHROPIC_API_KEY is set")]
    told = "ANTHROPIC_API_KEY is not set, so joda generate works by rules"
    return [Check(what, "missing", told, "only if you want it, run: export ANTHROPIC_API_KEY=...")]


def _cache() -> list[Check]:
    folder = cache_folder()
    size = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    if not size:
        return [Check("cache", "ok", f"empty, {folder}")]
    told = f"{size / 1e6:.1f} MB in {folder}, which an uninstallation leaves"
    return [
        Check("cache", "ok", told, f"to empty it, run: {shlex.join(['rm', '-r', str(folder)])}")
    ]


def _required(extra: str = "") -> list[str]:
    """What joda's metadata requires, always or for an extra, as pip reads it."""
    found = []
    for line in metadata.requires("joda") or ():
        package, _, condition = line.partition(";")
        names = re.findall(r"extra == ['\"](.+?)['\"]", condition)
        if (names == [extra] if extra else not names) and not package.startswith("joda"):
            found.append(package.strip())
    return found


def _child(code: str, **environment: str) -> tuple[bool, str]:
    """Runs the code in another process of this Python.

    Returns:
        Whether it ended well, and the last line that it printed, or of its error.
    """
    try:
        result = subprocess.run(
            [sys.executable, "-P", "-c", code],
            capture_output=True,
            text=True,
            errors="replace",
            timeout=PATIENCE,
            env={**os.environ, **environment},
        )
    except subprocess.TimeoutExpired:
        return False, f"no answer within {PATIENCE:g} s"
    works = result.returncode == 0
    lines = (result.stdout if works else result.stderr).strip().splitlines()
    if not lines:
        return works, "" if works else f"ended with status {result.returncode}"
    return works, lines[-1].strip()


def command(as_json: options.Json = False) -> None:
    """Say whether all works here, and what to do if not.

    Looks at what is installed, at the plugin, the renderers and joda's cache. Ends with status 1 if
    something that joda needs does not work. Example:

        joda doctor
    """
    with spinner("doctor"):
        checks = doctor()
    fatal = any(check.fatal for check in checks)
    if as_json:
        print_json({"ok": not fatal, "checks": [asdict(check) for check in checks]})
    else:
        _say_checks(checks)
    raise typer.Exit(int(fatal))


def _say_checks(checks: Iterable[Check]) -> None:
    """A line per check, below it what to do, and a sentence about all."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    marks = {"ok": ("ok", "green"), "missing": ("missing", "yellow"), "broken": ("broken", "red")}
    table = Table.grid(padding=(0, 2))
    checks = list(checks)
    for check in checks:
        style = "bold red" if check.fatal else marks[check.state][1]
        told = Text(plain(check.found))
        if check.remedy:
            told.append(f"\n→ {plain(check.remedy)}", "bold" if check.fatal else "dim")
        table.add_row(Text(check.state, style), Text(check.what), told)
    console = Console(width=None if sys.stdout.isatty() else 160)
    console.print(table)
    fatal = [check.what for check in checks if check.fatal]
    say(f"Not working: {', '.join(fatal)}." if fatal else "All that joda needs works.")
