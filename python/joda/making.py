"""The plugin compiled for the MuJoCo that is installed, where joda has no library for it."""

import hashlib
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

from joda.errors import JodaError
from joda.files import cache_folder

FLAGS = ["-std=c++17", "-O3", "-DNDEBUG", "-fPIC", "-shared", "-fvisibility=hidden"]
"""As CMake's release has them."""
COMPILERS = "c++", "g++", "clang++"


def make(sources: Path, version: str) -> Path:
    """Compiles the plugin for the installed MuJoCo into the user's cache, unless it is there.

    Args:
        sources: folder of the plugin's C++.
        version: of MuJoCo.

    Returns:
        The library; its name ends with the version.

    Raises:
        JodaError: there is no compiler, or it fails, or the cache cannot be written.
    """
    mujoco = _mujoco_folder(version)
    target = _place(sources, mujoco) / f"libjoda_plugin-{version}.so"
    if target.is_file():
        return target
    missing = f"joda has no plugin for MuJoCo {version} and cannot compile it: "
    library = sorted([*mujoco.glob("libmujoco.so.*"), *mujoco.glob("libmujoco.*.dylib")])
    files = sorted(map(str, sources.glob("*.cc")))
    if not files or not library or not (mujoco / "include" / "mujoco" / "mujoco.h").is_file():
        raise JodaError(
            f"{missing}{mujoco} has no headers and no library to link with, or {sources} no "
            "sources; install a wheel of joda."
        )
    command = compiler()
    if not command:
        raise JodaError(
            f"{missing}there is no C++ compiler (on Debian or Ubuntu: apt-get install g++)."
        )
    print(f"joda: compiling its plugin for MuJoCo {version}, once", file=sys.stderr)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent) as folder:
            made = Path(folder) / target.name
            include = [f"-I{sources}", "-isystem", str(mujoco / "include")]
            link = [str(library[0]), f"-Wl,-rpath,{mujoco}", "-o", str(made)]
            _run([*command, *FLAGS, *include, *files, *link], missing)
            if sys.platform == "darwin":  # the library names a framework that it is not in
                framework = f"@rpath/mujoco.framework/Versions/A/{library[0].name}"
                change = ["-change", framework, str(library[0]), str(made)]
                _run(["install_name_tool", *change], missing)
            made.replace(target)
    except OSError as error:
        raise JodaError(
            f"{missing}{target.parent} cannot be written ({error.strerror}); "
            "name another folder with XDG_CACHE_HOME."
        ) from None
    return target


def _mujoco_folder(version: str) -> Path:
    spec = find_spec("mujoco")
    for folder in (spec and spec.submodule_search_locations) or ():
        return Path(folder).resolve()
    raise JodaError(f"MuJoCo {version} has no folder; run: pip install mujoco=={version}")


def _place(sources: Path, mujoco: Path) -> Path:
    """Where the libraries of these sources are, for this very MuJoCo."""
    what = hashlib.sha256(str(mujoco).encode())
    for path in sorted(sources.glob("*")):
        what.update(path.name.encode() + b"\0" + path.read_bytes())
    return cache_folder() / "plugins" / what.hexdigest()[:16]


def compiler() -> list[str]:
    """The command of $CXX, or of the first compiler that is there; empty if there is none."""
    if asked := shlex.split(os.environ.get("CXX", "")):
        return asked
    return next(([name] for name in COMPILERS if shutil.which(name)), [])


def _run(command: list[str], missing: str) -> None:
    try:
        result = subprocess.run(command, capture_output=True, text=True, errors="replace")
    except OSError as error:
        raise JodaError(f"{missing}{command[0]} does not start ({error.strerror}).") from None
    if result.returncode:
        told = [line for line in result.stderr.splitlines() if "error" in line]
        why = told[0] if told else f"status {result.returncode}"
        raise JodaError(f"{missing}{command[0]} failed ({why.strip()}).")
