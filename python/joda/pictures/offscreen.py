"""Pictures of a scene, rendered off screen in a process of its own.

MuJoCo reads its OpenGL backend from the environment when it is imported, and some drivers abort the
process that asks them in vain. A child process can try one backend after the other.
"""

import json
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
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
    for backend in [asked] if asked else ["egl", "osmesa"]:
        result = subprocess.run(
            [sys.executable, "-P", "-m", module],  # -P: not what lies in the user's folder
            input=json.dumps(request).encode(),
            capture_output=True,
            env={**os.environ, "MUJOCO_GL": backend},
        )
        if result.stdout and result.returncode == 0:
            made = pickle.loads(result.stdout)
            if isinstance(made, JodaError):
                raise made
            return made
        if result.returncode == FAILED:
            raise RuntimeError(f"{module} failed:\n{result.stderr.decode(errors='replace')}")
    raise NoRenderer


def answer(make: Callable[[Any], Any]) -> None:
    """The child: the request as JSON on stdin, what is made of it, or a JodaError, on stdout.

    Args:
        make: given the request, makes the OpenGL context within `opening`, and then the rest.
    """
    # MuJoCo prints its warnings to stdout; they go where the errors go.
    with os.fdopen(os.dup(1), "wb") as stdout:
        os.dup2(2, 1)
        made: Any
        try:
            made = make(json.load(sys.stdin))
        except NoRenderer:
            raise
        except JodaError as error:
            made = error
        except Exception:
            sys.excepthook(*sys.exc_info())
            sys.exit(FAILED)
        stdout.write(pickle.dumps(made))


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
