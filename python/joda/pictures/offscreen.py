"""Pictures of a scene, rendered off screen in a process of its own.

MuJoCo reads its OpenGL backend from the environment when it is imported, and some drivers abort the
process that asks them in vain. A child process can try one backend after the other.
"""

import atexit
import json
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile
from threading import Lock
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.errors import JodaError
from joda.scenes.model import load_model

Image = NDArray[np.uint8]

WIDTH, HEIGHT = 960, 720

FAILED = 70
"""Exit status of a child that could render and failed all the same."""

SIZE = 8
"""Bytes before an answer that say how long it is."""


class NoRenderer(JodaError):
    """Nothing can render here; what does not need pictures can go on without."""

    def __init__(self) -> None:
        """The one sentence; it takes no arguments."""
        super().__init__(
            "nothing can render here: OpenGL works neither through EGL nor through OSMesa, or not "
            "as MUJOCO_GL asks; on Debian, install libegl1 and libgl1-mesa-dri, or libosmesa6."
        )


@contextmanager
def opening() -> Iterator[None]:
    """Around the making of an OpenGL context: whatever it raises becomes NoRenderer."""
    try:
        yield
    except Exception as error:
        raise NoRenderer from error


def ask(module: str, request: Any) -> Any:
    """What a module makes in a child process, with the first OpenGL backend that works.

    The child stays for the next request: to start one takes as long as to render.

    Args:
        module: to run; it ends in `answer`.
        request: what it reads; anything that JSON can carry.

    Raises:
        NoRenderer: neither EGL nor OSMesa works here, nor what the environment variable MUJOCO_GL
            asks for.
        JodaError: the module raised it.
        RuntimeError: the module failed otherwise although the backend works.
    """
    asked = os.environ.get("MUJOCO_GL")
    with _ONE_AT_A_TIME:
        for backend in [asked] if asked else ["egl", "osmesa"]:
            child = _children.pop((module, backend, os.getpid()), None)
            made = child.made(request) if child else None
            if made is None:  # none was there, or it has died since
                child = _Child(module, backend)
                made = child.made(request)
            if made is not None:
                assert child is not None
                _children[module, backend, os.getpid()] = child
                answered = pickle.loads(made)
                if isinstance(answered, JodaError):
                    raise answered
                return answered
    raise NoRenderer


_ONE_AT_A_TIME = Lock()
_children: dict[tuple[str, str, int], "_Child"] = {}
"""Those that wait for a request, by module, backend and the process that has started them."""


class _Child:
    """A process that renders one request after the other."""

    def __init__(self, module: str, backend: str) -> None:
        self._module = module
        self._errors = TemporaryFile()  # noqa: SIM115 (it is closed in _end)
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", module],  # -P: not what lies in the user's folder
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            env={**os.environ, "MUJOCO_GL": backend},
        )
        atexit.register(self._end)

    def made(self, request: Any) -> bytes | None:
        """What it makes, pickled; None where it has died, as of a backend that does not work.

        Raises:
            RuntimeError: the module failed although the backend works.
        """
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin and stdout
        try:
            with suppress(BrokenPipeError):
                stdin.write(json.dumps([os.getcwd(), request]).encode() + b"\n")
                stdin.flush()
            size = int.from_bytes(stdout.read(SIZE))
            made = stdout.read(size)
            if size and len(made) == size:
                return made
        except BaseException:
            self._end()  # what it still says would be taken for the next answer
            raise
        if self._process.wait() == FAILED:
            self._errors.seek(0)
            told = self._errors.read().decode(errors="replace")
            self._end()
            raise RuntimeError(f"{self._module} failed:\n{told}")
        self._end()
        return None

    def _end(self) -> None:
        atexit.unregister(self._end)
        if self._process.returncode is None:
            self._process.kill()
        with suppress(BrokenPipeError), self._process, self._errors:
            pass


def answer(make: Callable[[Any], Any]) -> None:
    """The child: a request per line of stdin, for each what is made of it, or a JodaError.

    Args:
        make: given the request, makes the OpenGL context within `opening`, and then the rest.
    """
    # MuJoCo prints its warnings to stdout; they go where the errors go.
    with os.fdopen(os.dup(1), "wb") as stdout:
        os.dup2(2, 1)
        for line in sys.stdin:
            made: Any
            try:
                folder, request = json.loads(line)
                os.chdir(folder)
                made = make(request)
            except NoRenderer:
                raise
            except JodaError as error:
                made = error
            except Exception:
                sys.excepthook(*sys.exc_info())
                sys.exit(FAILED)
            content = pickle.dumps(made)
            stdout.write(len(content).to_bytes(SIZE) + content)
            stdout.flush()


def render(
    path: str | Path,
    poses: Sequence[NDArray[np.float64]],
    *,
    width: int = WIDTH,
    height: int = HEIGHT,
) -> list[Image]:
    """The scene in several poses, as its camera `front` sees it, else its first or MuJoCo's own.

    Args:
        path: MJCF or URDF file.
        poses: all joint positions (qpos) of each, shape (nq,).
        width, height: of the pictures, pixels.

    Returns:
        RGB images, shape (height, width, 3).

    Raises:
        NoRenderer: nothing can render here.
    """
    request = [str(path), [pose.tolist() for pose in poses], width, height]
    images: list[Image] = ask("joda.pictures.offscreen", request)
    return images


def _make(request: Any) -> list[Image]:
    path, poses, width, height = request
    model = load_model(Path(path))
    data = mujoco.MjData(model)
    model.vis.global_.offwidth, model.vis.global_.offheight = width, height
    front = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, "front")
    camera = front if front >= 0 else min(model.ncam, 1) - 1  # -1: MuJoCo's own
    with opening():
        renderer = mujoco.Renderer(model, height, width)
    images = []
    with renderer:
        for pose in poses:
            data.qpos[:] = pose
            mujoco.mj_forward(model, data)
            renderer.update_scene(data, camera=camera)
            images.append(renderer.render())
    return images


if __name__ == "__main__":
    answer(_make)
