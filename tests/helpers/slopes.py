"""Derivatives compared with central differences, all of them at once."""

from collections.abc import Callable
from functools import partial

import jax
import numpy as np
from jax.flatten_util import ravel_pytree

FAST = {"xla_backend_optimization_level": "0"}  # compiles in a third of the time; for single runs
PARTS = (1e-6, 1e-5, 1e-7, 1e-4)
"""Steps tried, in units of the number: what is best depends on how the path bends."""
MANY = 100
"""Runs at once, from which on it is worth compiling them well."""
LEAST = 1e-2
"""Of a number that is next to nothing."""


def check_slopes(path: Callable, tree, within=1e-5, skip: tuple[str, ...] = ()) -> np.ndarray:
    """The path of a tree of numbers; checks its derivatives by each of them, of which none is zero.

    Numbers whose name ends with one of `skip` are not checked.
    """
    values, back = ravel_pytree(tree)
    values, units = np.asarray(values), np.eye(len(values))

    @partial(jax.jit, compiler_options=FAST if len(values) < MANY else {})
    @jax.vmap
    def run(x, along):  # one program for slopes and differences: compiling takes longest
        return jax.jvp(lambda x: path(back(x)), (x,), (along,))

    here, slopes = (np.asarray(part) for part in run(np.tile(values, (len(values), 1)), units))
    assert np.isfinite(slopes).all()
    flat = slopes.reshape(len(values), -1)
    size, steps = np.abs(flat).max(1), np.maximum(np.abs(values), LEAST)
    names, best = _names(tree), np.full(len(values), np.inf)
    wanted = np.array([not name.endswith(skip) for name in names])
    for part in PARTS:
        ends = [np.asarray(run(values + way * part * steps * units, units)[0]) for way in (1, -1)]
        differences = (ends[0] - ends[1]).reshape(flat.shape) / (2 * part * steps)[:, None]
        best = np.fmin(best, np.abs(flat - differences).max(1) / np.where(size > 0, size, np.nan))
        if (best[wanted] < within).all():
            break
    wrong = {n: e for n, e, w in zip(names, best, wanted, strict=True) if w and not e < within}
    assert not wrong, wrong
    return here[0]


def _names(tree) -> list[str]:
    """A name for each number of a tree, in the order of ravel_pytree."""
    return [
        f"{jax.tree_util.keystr(path)}{list(index)}"
        for path, leaf in jax.tree_util.tree_leaves_with_path(tree)
        for index in np.ndindex(np.shape(leaf))
    ]
