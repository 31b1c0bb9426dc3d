"""Fetches MuJoCo's headers and library in every version that a release has a plugin for.

    python cpp/mujocos.py FOLDER
    JODA_MUJOCOS=FOLDER python -m build

FOLDER/X.Y.Z/mujoco is what the build then looks for. Each is pip's own download for this machine;
it is for Python 3.11, whatever runs here, as the headers and the library are the same.
"""

import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

VERSIONS = [
    *(f"3.3.{patch}" for patch in range(8)),
    *("3.4.0", "3.5.0", "3.6.0", "3.7.0", "3.8.0", "3.8.1"),
    *(f"3.{minor}.0" for minor in range(9, 18)),
    "4.0.0",
]


def fetch(version: str, folder: Path) -> None:
    """Puts headers and library of a version into the folder."""
    package = "mujoco-core" if version.startswith("4.") else "mujoco"
    with tempfile.TemporaryDirectory() as wheels:
        options = ["--no-deps", "--only-binary=:all:", "--python-version=3.11", "-q", "-d", wheels]
        command = [sys.executable, "-m", "pip", "download", *options, f"{package}=={version}"]
        subprocess.run(command, check=True)
        with zipfile.ZipFile(next(Path(wheels).iterdir())) as wheel:
            for name in wheel.namelist():
                part = name.removeprefix("mujoco/")
                if part.startswith(("include/", "libmujoco.")) or part == "mujoco.dll":
                    wheel.extract(name, folder)


if __name__ == "__main__":
    for version in VERSIONS:
        fetch(version, Path(sys.argv[1]) / version)
        print(f"MuJoCo {version}")
