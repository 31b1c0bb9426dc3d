"""Who runs tasks: processes of this machine, or Ray's workers on many."""

import os
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from pathlib import Path
from typing import Any

from joda.commands.distribute.task import Result, Task, run
from joda.errors import JodaError

HERE = "local"
"""In the place of a cluster's address: Ray on this machine."""
PATIENCE = 10
"""Within which a cluster must answer, s."""
DIED = Result(
    {},
    "the process that did it died before it was done: it lacked memory, or MuJoCo or one of its "
    "plugins has a fault; try that model by itself.",
    True,
)
"""What a task comes to whose process dies."""
AHEAD = 4
"""Tasks per worker of a cluster that are handed out before one is done: their files wait there."""
POLL = 0.2
"""How often Ctrl-C is looked for while tasks are waited for, s."""
GRACE = 5.0
"""For a task whose pool is gone to leave nothing behind, s."""
TOKEN = ".ray/auth_token"
"""In the user's home: where it is, Ray's clusters ask for it."""


def by_processes(tasks: Iterable[Task], workers: int | None) -> Iterator[tuple[Task, Result]]:
    """Runs tasks in processes of this machine; yields them as they are done.

    Where a process dies its pool is lost with all that it was doing: those tasks are done once
    more, each by itself, so that only the one fails that it died of.

    Args:
        tasks: made as they are needed.
        workers: processes, by default one per core.
    """
    count, rest, lost = workers or os.cpu_count() or 1, iter(tasks), list[Task]()
    while True:
        yield from _side_by_side(rest, count, lost)
        if not lost:
            return
        for task in lost:
            alone = list(_side_by_side([task], 1, []))
            yield from alone or [(task, DIED)]
        lost.clear()


def _side_by_side(
    tasks: Iterable[Task], count: int, lost: list[Task]
) -> Iterator[tuple[Task, Result]]:
    """The same in one pool; ends early where one of its processes dies, and adds what is then
    `lost`."""
    spawn = get_context("spawn")
    with ProcessPoolExecutor(count, mp_context=spawn, initializer=_end_with_pool) as pool:
        waiting: dict[Future[Result], Task] = {}
        try:
            for task in tasks:
                waiting[_submitted(pool, task)] = task
                if len(waiting) >= count:  # one that waits there cannot be called off
                    yield _next(waiting)
            while waiting:
                yield _next(waiting)
        except BrokenProcessPool:
            lost += waiting.values()
        finally:
            pool.shutdown(cancel_futures=True)


def _end_with_pool() -> None:
    """Ends this process when the one that began it has ended, however it did."""

    def watch() -> None:
        begun_by = parent_process()
        assert begun_by is not None
        begun_by.join()
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(GRACE)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def _interrupts(how: str) -> Iterator[None]:
    """Ctrl-C is let through or waits meanwhile, where a system can do that: SIG_UNBLOCK or
    SIG_BLOCK. A process begins as the one is that begins it."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(getattr(signal, how), {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _interruptible(task: Task) -> Result:
    """Runs a task in a process that Ctrl-C does not reach otherwise."""
    with _interrupts("SIG_UNBLOCK"):
        return run(task)


@contextmanager
def _deferred() -> Iterator[Callable[[], None]]:
    """Ctrl-C acts where the function is called, and at the end: within a lock of the pool it would
    leave that locked, and the pool would never end."""
    usual, came = signal.getsignal(signal.SIGINT), list[int]()
    if threading.current_thread() is not threading.main_thread() or not callable(usual):
        yield lambda: None
        return
    handler: Callable[..., Any] = usual

    def act() -> None:
        if came:
            came.clear()
            handler(signal.SIGINT, None)

    signal.signal(signal.SIGINT, lambda number, frame: came.append(number))
    try:
        yield act
    finally:
        signal.signal(signal.SIGINT, usual)
    act()


def _submitted(pool: ProcessPoolExecutor, task: Task) -> Future[Result]:
    try:
        with _deferred(), _interrupts("SIG_BLOCK"):
            return pool.submit(_interruptible, task)
    except BrokenProcessPool as error:
        gone: Future[Result] = Future()
        gone.set_exception(error)
        return gone


def _next(waiting: dict[Future[Result], Task]) -> tuple[Task, Result]:
    with _deferred() as act:
        while not (done := wait(waiting, POLL, FIRST_COMPLETED).done):
            act()
    first = done.pop()
    result = first.result()
    return waiting.pop(first), result


def by_ray(
    tasks: Iterable[Task], address: str, workers: int | None
) -> Iterator[tuple[Task, Result]]:
    """The same on Ray; joda must be installed on all of its machines.

    Args:
        tasks: made as they are needed.
        address: of the cluster; "local": Ray is started here and ends with the tasks.
        workers: at most so many tasks at a time, by default one per core of the cluster.

    Raises:
        JodaError: Ray is not installed, or no cluster that can be used answers.
    """
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # nothing is sent to its makers unasked
    if address != HERE:  # else it would try for a quarter of an hour
        os.environ.setdefault("RAY_NUM_REDIS_GET_RETRIES", "1")
        if (Path.home() / TOKEN).is_file():  # which a cluster that wants none does not mind
            os.environ.setdefault("RAY_AUTH_MODE", "token")
    try:
        import ray
    except ImportError:
        raise JodaError('--ray needs Ray; run: pip install ".[ray]"') from None
    quiet = {"configure_logging": False, "log_to_driver": False}
    if address == HERE:
        ray.init(address=HERE, num_cpus=workers, include_dashboard=False, **quiet)
    else:
        _check_answers(address)
        try:
            ray.init(address=address, **quiet)
        except (OSError, RuntimeError, ValueError, ray.exceptions.RayError) as error:
            raise JodaError(
                f"no Ray cluster can be used at {address} ({error}); does `ray start --head` run "
                f"there, with this Ray's version, and the token in ~/{TOKEN} if it has one?"
            ) from None
    try:
        remote: Callable[..., Any] = ray.remote(num_cpus=1, max_retries=2)(run).remote
        count = workers or int(ray.cluster_resources().get("CPU", 1))
        waiting: dict[Any, Task] = {}

        def done() -> tuple[Task, Result]:
            (first,), _ = ray.wait(list(waiting), num_returns=1)
            task = waiting.pop(first)
            try:
                return task, ray.get(first)
            except ray.exceptions.RayTaskError:
                raise
            except ray.exceptions.RayError:
                return task, DIED

        for task in tasks:
            waiting[remote(task)] = task
            if len(waiting) >= (count if workers else AHEAD * count):
                yield done()
        while waiting:
            yield done()
    finally:
        ray.shutdown()


def _check_answers(address: str) -> None:
    """Raises JodaError where nothing listens: Ray itself would wait for minutes."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    try:
        socket.create_connection((host, int(port)), timeout=PATIENCE).close()
    except (OSError, ValueError, OverflowError):
        raise JodaError(
            f"no Ray cluster answers at {address}; give HOST:PORT of one that `ray start --head` "
            "has started, or --ray local."
        ) from None
