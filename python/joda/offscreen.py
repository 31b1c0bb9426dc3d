"""Pictures of a scene, rendered off screen in a process of its own.

MuJoCo reads its OpenGL backend from the environment when it is imported, and some drivers abort the
process that asks them in vain. A child process can try one backend after the other.
"""

import io
import json
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
Shots = Callable[[], list[Image]]

WIDTH, HEIGHT = 960, 720

FAILED = 70
"""Exit status of a child that could render and failed all the same."""


def ask(module: str, request: Any) -> list[Image] | None:
    """Images that a module makes in a child process, with the first OpenGL backend that works.

    Args:
        module: to run; it ends in `answer`.
        request: what it reads; anything that JSON can carry.

    Returns:
        its RGB images, all of one shape (height, width, 3), or None where nothing can render:
        neither EGL nor OSMesa works here, nor what the environment variable MUJOCO_GL asks for.

    Raises:
        RuntimeError: the module failed although the backend works.
    """
    asked = os.environ.get("MUJOCO_GL")
    for backend in [asked] if asked else ["egl", "osmesa"]:
        result = subprocess.run(
            [sys.executable, "-m", module],
            input=json.dumps(request).encode(),
            capture_output=True,
            env={**os.environ, "MUJOCO_GL": backend},
        )
        if result.stdout and result.returncode == 0:
            return list(np.load(io.BytesIO(result.stdout)))
        if result.returncode == FAILED:
            raise RuntimeError(f"{module} failed:\n{result.stderr.decode(errors='replace')}")
    return None


def answer(prepare: Callable[[Any], Shots]) -> None:
    """The child: the request as JSON on stdin, the images' bytes on stdout.

    Args:
        prepare: given the request, makes the OpenGL context; what it returns makes the images.
    """
    # MuJoCo prints its warnings to stdout; they go where the errors go.
    with os.fdopen(os.dup(1), "wb") as stdout:
        os.dup2(2, 1)
        shots = prepare(json.load(sys.stdin))
        try:
            content = io.BytesIO()
            np.save(content, np.stack(shots()))
            stdout.write(content.getvalue())
        except Exception:
            sys.excepthook(*sys.exc_info())
            sys.exit(FAILED)


def render(
    path: str | Path, camera: str, joint: str, positions: Sequence[float]
) -> list[Image] | None:
    """The scene with a joint at each of several positions.

    Args:
        path: MJCF file.
        camera: name of a camera in it.
        joint: name of a hinge or slide.
        positions: rad or m.

    Returns:
        RGB images, shape (720, 960, 3), or None where nothing can render, as `ask`.
    """
    return ask("joda.offscreen", [str(path), camera, joint, list(map(float, positions))])


def _prepare(request: Any) -> Shots:
    path, camera, joint, positions = request
    model = mujoco.MjModel.from_xml_path(path)
    data = mujoco.MjData(model)
    model.vis.global_.offwidth, model.vis.global_.offheight = WIDTH, HEIGHT
    renderer = mujoco.Renderer(model, HEIGHT, WIDTH)

    def shots() -> list[Image]:
        images = []
        with renderer:
            for position in positions:
                data.joint(joint).qpos[0] = position
                mujoco.mj_forward(model, data)
                renderer.update_scene(data, camera=camera)
                images.append(renderer.render())
        return images

    return shots


if __name__ == "__main__":
    answer(_prepare)
