"""Builds the C++ tests and the C++ host with sanitizers, and runs them.

The fuzzers begin at the session's seed, which stands at the top of every run of pytest.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import SEED

ROOT = Path(__file__).parents[1]
FUZZ_COUNT = 20_000 if os.environ.get("CI") else 2_000

# cmake and ninja may be installed beside the interpreter without being on the path
PATH = os.pathsep.join((str(Path(sys.executable).parent), os.environ.get("PATH", "")))


def run(*command: str | Path) -> str:
    """The command's output; the test fails with it if the command does."""
    done = subprocess.run(
        list(map(str, command)),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=os.environ | {"PATH": PATH},
        check=False,
    )
    if done.returncode:
        pytest.fail(f"{command[0]} failed:\n{done.stdout}", pytrace=False)
    return done.stdout


def test_cpp_tests_pass_under_sanitizers(tmp_path):
    options = {
        "CMAKE_BUILD_TYPE": "Debug",
        "CMAKE_COMPILE_WARNING_AS_ERROR": "ON",
        "JODA_FUZZ_COUNT": FUZZ_COUNT,
        "JODA_FUZZ_SEED": os.environ[SEED],
        "JODA_PYTHON": "OFF",
        "JODA_SANITIZE": "ON",
        "JODA_TESTS": "ON",
        "Python_EXECUTABLE": sys.executable,
    }
    flags = [f"-D{name}={value}" for name, value in options.items()]
    run("cmake", "-G", "Ninja", "-S", ROOT, "-B", tmp_path, *flags)
    run("cmake", "--build", tmp_path)
    run("ctest", "--test-dir", tmp_path, "--output-on-failure", "--no-tests=error")
