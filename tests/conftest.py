"""Sweeps: of many cases of one test, and of the tests that take long or are slow, some are drawn
anew in every session; `--whole` runs all. And random numbers for tests that ask for them (`rng`).
"""

import os
import random
import secrets
import sys
from collections import defaultdict
from pathlib import Path

import pytest

sys.path[:0] = [str(Path(__file__).parent / name) for name in ("helpers", "benchmarks")]
# tests run side by side: threads within matrix products would only be in each other's way
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
SEED = "JODA_SWEEPS"
LONG, SLOW, FEW = 0.02, 1 / 10, 10
"""Part of the long tests, and of the slow ones, that a session of more than so many files draws."""


@pytest.fixture
def rng():
    import numpy as np  # after the threads are told

    seed = int(np.random.default_rng().integers(2**31))
    print(seed)  # shown where a test fails
    return np.random.default_rng(seed)


def pytest_addoption(parser):
    parser.addoption("--whole", action="store_true", help="all cases of all sweeps")


def pytest_configure(config):
    config.addinivalue_line(
        "markers",
        "sweep(count, group): cases of this test, or of all tests of a group, in a session",
    )
    config.addinivalue_line(
        "markers",
        "long(group): of the tests that take long a session draws a part, groups as a whole",
    )
    config.addinivalue_line("markers", "slow: of the tests that take some time it draws more")
    os.environ.setdefault(SEED, str(secrets.randbits(32)))  # the same in every worker


def pytest_report_header(config):
    return f"sweeps are drawn by {SEED}={os.environ[SEED]}; --whole runs all their cases"


def pytest_collection_modifyitems(config, items):
    items.sort(key=lambda item: item.path.stem != "test_versions")  # as no other file takes so long
    if config.getoption("--whole"):
        return
    sweeps, long, slow = defaultdict(list), defaultdict(list), defaultdict(list)
    for item in items:
        if mark := item.get_closest_marker("sweep"):
            count, *group = mark.args
            sweeps[group[0] if group else item.nodeid.partition("[")[0], count].append([item])
        if mark := item.get_closest_marker("long"):
            long[mark.args[0] if mark.args else item.nodeid].append(item)
        if item.get_closest_marker("slow"):
            slow[item.nodeid.partition("[")[0]].append(item)
    if len({item.path for item in items}) > FEW:  # who asks for a file gets all of it
        sweeps["long", round(LONG * len(long))] = list(long.values())
        sweeps["slow", round(SLOW * len(slow))] = list(slow.values())
    left = set()
    for (name, count), cases in sweeps.items():
        if len(cases) == len(items):  # they were asked for
            continue
        dice = random.Random(f"{os.environ[SEED]} {name}")
        for dropped in dice.sample(cases, max(len(cases) - count, 0)):
            left |= {item.nodeid for item in dropped}
    if left:
        config.hook.pytest_deselected(items=[item for item in items if item.nodeid in left])
        items[:] = [item for item in items if item.nodeid not in left]
