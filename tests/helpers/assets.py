"""Third-party scenes: of ../shared/assets where present, the others out of wheels from PyPI.

Only what a scene needs is unpacked, into $XDG_CACHE_HOME/joda-tests; nothing is installed.
"""

import os
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import pytest

SHARED = Path(os.environ.get("JODA_SHARED", Path(__file__).parents[3] / "shared"))
CACHE = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "joda-tests"

FILES = {  # in SHARED / "assets"
    "microwave": "furniture_sim/microwave.xml",
    "cabinet": "libero/wooden_cabinet.xml",
    "table": "calvin/calvin_table_D/urdf/calvin_table_D.urdf",
}
WHEELS = {  # wheel, what of it is needed, the scene
    "kitchen": (
        "gymnasium-robotics==1.4.2",
        ("gymnasium_robotics/envs/assets/kitchen_franka/",),
        "gymnasium_robotics/envs/assets/kitchen_franka/kitchen_assets/kitchen_env_model.xml",
    ),
    "drawer": (
        "metaworld==3.1.1",
        ("metaworld/assets/objects/", "metaworld/assets/scene/", "metaworld/assets/textures/"),
        "metaworld/assets/objects/drawer.xml",
    ),
    "door": (
        "robosuite==1.5.2",
        ("robosuite/models/assets/objects/door_lock.xml", "robosuite/models/assets/textures/"),
        "robosuite/models/assets/objects/door_lock.xml",
    ),
}
NAMES = (*FILES, *WHEELS)


def asset(name: str) -> Path:
    """Path of a scene; skips the test if it is not to be had (fails it in CI if it should be)."""
    if name in FILES:
        path = SHARED / "assets" / FILES[name]
        if not path.is_file():
            pytest.skip(f"{FILES[name]} is not beside the repository; JODA_SHARED says where it is")
        return path
    requirement, parts, file = WHEELS[name]
    folder = CACHE / requirement
    if not folder.is_dir():
        _unpack(requirement, parts, folder)
    return folder / file


def _unpack(requirement: str, parts: tuple[str, ...], folder: Path) -> None:
    CACHE.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=CACHE) as work:
        command = [sys.executable, "-m", "pip", "download", "--no-deps", "--dest", work]
        done = subprocess.run([*command, requirement], capture_output=True, text=True)
        wheels = list(Path(work).glob("*.whl"))
        if done.returncode or not wheels:
            reason = f"pip download {requirement} failed: {done.stderr.strip()[-1000:]}"
            pytest.fail(reason) if os.environ.get("CI") else pytest.skip(reason)
        unpacked = Path(work) / "unpacked"
        with zipfile.ZipFile(wheels[0]) as wheel:
            wheel.extractall(unpacked, [n for n in wheel.namelist() if n.startswith(parts)])
        unpacked.rename(folder)
