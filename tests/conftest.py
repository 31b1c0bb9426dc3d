"""Sweeps: of many cases of one test some are drawn anew in every session; `--whole` runs all."""

import os
import random
import secrets
from collections import defaultdict

# tests run side by side: threads within matrix products would only be in each other's way
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
SEED = "JODA_SWEEPS"


def pytest_addoption(parser):
    parser.addoption("--whole", action="store_true", help="all cases of all sweeps")


def pytest_configure(config):
    config.addinivalue_line(
        "markers",
        "sweep(count, group): cases of this test, or of all tests of a group, in a session",
    )
    os.environ.setdefault(SEED, str(secrets.randbits(32)))  # the same in every worker


def pytest_report_header(config):
    return f"sweeps are drawn by {SEED}={os.environ[SEED]}; --whole runs all their cases"


def pytest_collection_modifyitems(config, items):
    if config.getoption("--whole"):
        return
    sweeps = defaultdict(list)
    for item in items:
        if mark := item.get_closest_marker("sweep"):
            count, *group = mark.args
            sweeps[group[0] if group else item.nodeid.partition("[")[0], count].append(item)
    left = set()
    for (name, count), cases in sweeps.items():
        if len(cases) == len(items):  # they were asked for
            continue
        dice = random.Random(f"{os.environ[SEED]} {name}")
        left |= {item.nodeid for item in dice.sample(cases, max(len(cases) - count, 0))}
    if left:
        config.hook.pytest_deselected(items=[item for item in items if item.nodeid in left])
        items[:] = [item for item in items if item.nodeid not in left]
