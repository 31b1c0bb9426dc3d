"""A model's meshes and textures on the graphics card, and what is drawn with them.

Runs in the child process of `joda.pictures.offscreen`.
"""

from collections.abc import Iterable

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.pictures.offscreen import HEIGHT, WIDTH, Image, opening

SMALL = (96, 72)
"""Pixels of a canvas for looks that are not kept."""


class Canvas:
    """An OpenGL context for pictures of one model, large or small."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """Uploads the model but for its textures, small to draw on; raises NoRenderer.

        What the model says of the quality of pictures is changed.
        """
        model.vis.global_.offwidth, model.vis.global_.offheight = SMALL
        model.vis.quality.offsamples = 4
        model.vis.quality.shadowsize = 0
        # textures are slow to upload; they have their sizes again when they are needed
        sizes = model.tex_width.copy(), model.tex_height.copy()
        flat = model.tex_type == int(mujoco.mjtTexture.mjTEXTURE_2D)
        model.tex_width[:], model.tex_height[:] = 1, np.where(flat, 1, 6)
        with opening():
            self._gl = mujoco.GLContext(WIDTH, HEIGHT)
            self._gl.make_current()
            self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_50.value)
        model.tex_width[:], model.tex_height[:] = sizes
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        self._uploaded: set[int] = set()

    def resize(self, width: int, height: int) -> None:
        """Makes it as large as the largest picture to come, pixels."""
        if (self._context.offWidth, self._context.offHeight) != (width, height):
            mujoco.mjr_resizeOffscreen(width, height, self._context)

    def upload(self, model: mujoco.MjModel, textures: Iterable[int]) -> None:
        """Uploads those of the model's textures that are not there yet."""
        for texture in set(textures) - self._uploaded:
            mujoco.mjr_uploadTexture(model, self._context, texture)
            self._uploaded.add(texture)

    def draw(self, scene: mujoco.MjvScene, width: int, height: int) -> Image:
        """The scene as its camera sees it; shape (height, width, 3)."""
        rect = mujoco.MjrRect(0, 0, width, height)
        mujoco.mjr_render(rect, scene, self._context)
        image: NDArray[np.uint8] = np.empty((height, width, 3), np.uint8)
        mujoco.mjr_readPixels(image, None, rect, self._context)
        return image[::-1]
