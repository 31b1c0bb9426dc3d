"""Pictures of a scene, rendered off screen in a process of its own.

MuJoCo reads its OpenGL backend from the environment when it is imported, and some drivers abort the
process that asks them in vain. A child process can try one backend after the other.
"""

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

WIDTH, HEIGHT = 640, 480


def render(
    path: str | Path, camera: str, joint: str, positions: Sequence[float]
) -> list[NDArray[np.uint8]] | None:
    """The scene with a joint at each of several positions.

    Args:
        path: MJCF file.
        camera: name of a camera in it.
        joint: name of a hinge or slide.
        positions: rad or m.

    Returns:
        RGB images, shape (480, 640, 3), or None where nothing can render: neither EGL nor OSMesa
        works here, nor what the environment variable MUJOCO_GL asks for.
    """
    asked = os.environ.get("MUJOCO_GL")
    for backend in [asked] if asked else ["egl", "osmesa"]:
        result = subprocess.run(
            [sys.executable, "-m", "joda.offscreen"],
            input=json.dumps([str(path), camera, joint, list(map(float, positions))]).encode(),
            capture_output=True,
            env={**os.environ, "MUJOCO_GL": backend},
        )
        images = np.frombuffer(result.stdout, np.uint8)
        if result.returncode == 0 and images.size == len(positions) * WIDTH * HEIGHT * 3:
            return list(images.reshape(-1, HEIGHT, WIDTH, 3))
    return None


def _main() -> None:
    """The child: a request as JSON on stdin, the images' bytes on stdout."""
    path, camera, joint, positions = json.load(sys.stdin)
    model = mujoco.MjModel.from_xml_path(path)
    data = mujoco.MjData(model)
    with mujoco.Renderer(model, HEIGHT, WIDTH) as renderer:
        for position in positions:
            data.joint(joint).qpos[0] = position
            mujoco.mj_forward(model, data)
            renderer.update_scene(data, camera=camera)
            sys.stdout.buffer.write(renderer.render().tobytes())


if __name__ == "__main__":
    _main()
