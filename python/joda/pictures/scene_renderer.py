"""A joint's scene made ready to be looked at: cameras, highlight, axis and arrow.

Runs in the child process of `joda.pictures.offscreen`.
"""

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.pictures.canvas import SMALL, Canvas
from joda.pictures.offscreen import Image
from joda.scenes.part import Array, groups, moving, outline

Mask = NDArray[np.bool_]

FOVY = 30.0
MARGIN = 0.88
"""Share of the frame, in width or height, that the motion takes."""

HIGHLIGHT = (0.08, 0.40, 0.95)
BACKGROUND = (0.91, 0.92, 0.93)

LIGHTER, DARKER, TINGE = 0.6, 0.65, 0.85
"""How far white markings on a black part lighten the highlight, black ones on a white part darken
it, and coloured ones colour it."""

AMBIENT, DIFFUSE = 0.48, 0.50

THROUGH = 0.35
"""How much of the axis and the arrow shows through what stands before them."""


@dataclass(frozen=True)
class View:
    """A direction to look in, in degrees as MjvCamera has it: elevation is negative from above."""

    azimuth: float
    elevation: float

    def frame(self) -> Array:
        """Unit vectors to the right, up and forward, as rows."""
        a, e = np.deg2rad(self.azimuth), np.deg2rad(self.elevation)
        right = np.sin(a), -np.cos(a), 0.0
        up = -np.cos(a) * np.sin(e), -np.sin(a) * np.sin(e), np.cos(e)
        return np.array([right, up, (np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e))])

    def camera(self, points: Array, aspect: float) -> mujoco.MjvCamera:
        """The nearest camera that has all points, shape (n, 3), within MARGIN of the frame.

        The frame is `aspect` times as wide as high.
        """
        right, up, forward = self.frame()
        depth = points @ forward
        slope = MARGIN * np.tan(np.deg2rad(FOVY / 2))
        centre, start = [], []
        for across, tangent in ((right, slope * aspect), (up, slope)):
            high = np.max(points @ across - tangent * depth)
            low = np.max(-points @ across - tangent * depth)
            centre.append((high - low) / 2)
            start.append(-(high + low) / (2 * tangent))
        middle = (depth.min() + depth.max()) / 2
        camera = mujoco.MjvCamera()
        camera.azimuth, camera.elevation = self.azimuth, self.elevation
        camera.lookat[:] = centre[0] * right + centre[1] * up + middle * forward
        camera.distance = middle - min(start)
        return camera


class SceneRenderer:
    """A model with one joint's part highlighted, lit from the camera, before a plain background.

    Attributes:
        model, data: changed for the pictures; the data hold the kinematics of the last pose.
        joint: index.
        part: geoms that the joint moves.
    """

    def __init__(
        self, model: mujoco.MjModel, joint: int, canvas: Canvas, size: tuple[int, int]
    ) -> None:
        """Sets it up.

        Args:
            model: is changed.
            joint: its index.
            canvas: that was made for the same model.
            size: width and height of the pictures, pixels.
        """
        self._size, self._aspect = size, size[0] / size[1]
        self.model, self.data = model, mujoco.MjData(model)
        self._canvas = canvas
        self.joint, self.part = joint, moving(model, joint)
        self._outlines = [outline(model, g) for g in self.part]
        self._prepare()
        self._scene = mujoco.MjvScene(model, maxgeom=4 * model.ngeom + 2000)
        for flag in ("SHADOW", "REFLECTION", "HAZE", "SKYBOX"):
            self._scene.flags[getattr(mujoco.mjtRndFlag, f"mjRND_{flag}")] = False
        self._option = mujoco.MjvOption()
        self._option.sitegroup[:] = 0
        for group in groups(model, joint):
            self._option.geomgroup[group] = 1

    def _prepare(self) -> None:
        """Evens out the light, and sizes the frame for scouting."""
        model = self.model
        self._canvas.resize(*SMALL)
        model.light_active[:] = 0
        model.vis.headlight.active = 1
        model.vis.headlight.ambient[:] = AMBIENT
        model.vis.headlight.diffuse[:] = DIFFUSE
        model.vis.headlight.specular[:] = 0.08
        model.vis.global_.fovy = FOVY

    def pose(self, position: float) -> None:
        """Moves the joint, rad or m."""
        model, data = self.model, self.data
        data.qpos[:] = model.qpos0
        data.qpos[model.jnt_qposadr[self.joint]] = position
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_camlight(model, data)
        mujoco.mj_tendon(model, data)

    def points(self) -> Array:
        """Points around the part in this pose, shape (n, 3)."""
        rotation, origin = self.data.geom_xmat, self.data.geom_xpos
        return np.concatenate(
            [
                local @ rotation[g].reshape(3, 3).T + origin[g]
                for g, local in zip(self.part, self._outlines, strict=True)
            ]
        )

    def camera(self, view: View, points: Array) -> mujoco.MjvCamera:
        """The nearest camera that looks in a direction and has all points, shape (n, 3)."""
        return view.camera(points, self._aspect)

    def clear(self, camera: mujoco.MjvCamera, targets: Array) -> float:
        """Share of the targets, shape (n, 3), towards which the camera has nothing in its way.

        A camera inside a wall sees out of it, since OpenGL draws no surface from behind; a ray does
        not.
        """
        view = View(camera.azimuth, camera.elevation)
        eye = np.asarray(camera.lookat - camera.distance * view.frame()[2])
        hit, geom = 0, np.zeros(1, np.int32)
        for target in targets:
            way, groups = target - eye, self._option.geomgroup
            length = mujoco.mj_ray(self.model, self.data, eye, way, groups, 1, -1, geom)
            hit += length < 0 or length > 0.98 or int(geom[0]) in self.part
        return hit / len(targets)

    def reach(self, points: Array) -> None:
        """Sets the clipping planes for cameras around these points, shape (n, 3)."""
        size = float(np.linalg.norm(np.ptp(points, axis=0)))
        scene = self.model.stat.extent + float(np.linalg.norm(self.model.stat.center - points[0]))
        self.model.stat.extent = size
        self.model.vis.map.znear = 0.02
        self.model.vis.map.zfar = max(50.0, 4 * scene / size)

    def scout(self, cameras: list[mujoco.MjvCamera]) -> list[Mask]:
        """Where each camera sees the part in this pose, shape (72, 96)."""
        model = self.model
        own = model.geom_matid.copy(), model.geom_rgba.copy()
        masks = []
        for camera in cameras:
            self._hide(self._away(camera))
            self._update(camera)
            ids = [geom.segid + 1 for geom, inside in self._drawn() if inside]
            pixels = self._read(*SMALL, segments=True).astype(np.int64)
            masks.append(np.isin(pixels @ [1, 256, 65536], ids))
            model.geom_matid[:], model.geom_rgba[:] = own
        return masks

    def settle(self, camera: mujoco.MjvCamera, mark: Callable[[mujoco.MjvScene], None]) -> None:
        """Fixes the camera, what adds the marks, and which of the part's colours is usual."""
        self._camera, self._mark = camera, mark
        self._forget(camera)
        mask = self.scout([camera])[0]
        self._usual = np.full(3, 0.5)
        if mask.any():
            self._usual = np.median(self._bare(*SMALL)[mask], axis=0) / 255
        materials = [g.matid for g, inside in self._drawn() if inside and g.matid >= 0]
        self._textured = bool(np.any(self.model.mat_texid[materials] >= 0))
        self._canvas.resize(*self._size)
        self._update(camera)
        self._scene.ngeom = 0
        self._add_backdrop()
        mark(self._scene)
        alone = self._read(*self._size)
        self._through = _differs(alone, BACKGROUND, 8)
        self._faint = alone[self._through].astype(float)

    def _forget(self, camera: mujoco.MjvCamera) -> None:
        """Hides the geoms that the camera cannot see, and uploads the textures of the others."""
        model, away = self.model, self._away(camera)
        others = (model.geom_matid[~away], model.skin_matid, model.flex_matid, model.tendon_matid)
        unused = set(model.geom_matid[away]).difference(*others)
        self._hide(away)
        used = [k for k in range(model.nmat) if k not in unused]
        self._canvas.upload(model, set(model.mat_texid[used].ravel().tolist()) - {-1})

    def _away(self, camera: mujoco.MjvCamera) -> NDArray[np.bool_]:
        """The geoms, of the part none, that lie wholly outside what a camera sees in this pose."""
        model = self.model
        forward = View(camera.azimuth, camera.elevation).frame()[2]
        way = self.data.geom_xpos - (camera.lookat - camera.distance * forward)
        depth = way @ forward
        aside = np.linalg.norm(way - np.outer(depth, forward), axis=1)
        angle = np.arctan(np.tan(np.deg2rad(FOVY / 2)) * np.hypot(1, self._aspect))
        away = aside * np.cos(angle) - depth * np.sin(angle) > model.geom_rbound
        away &= model.geom_rbound > 0  # a plane has no bound
        away[self.part] = False
        return np.asarray(away)

    def _hide(self, geoms: NDArray[np.bool_]) -> None:
        self.model.geom_matid[geoms], self.model.geom_rgba[geoms] = -1, 0

    def shoot(self) -> Image:
        """The picture in this pose; marks that stand behind something show through faintly."""
        self._update(self._camera)
        for geom, inside in self._drawn():
            if inside:
                geom.matid, geom.emission, geom.specular = -1, 0, 0.5
                change = 0 * self._usual if self._textured else geom.rgba[:3] - self._usual
                geom.rgba = [*_tint(np.array(HIGHLIGHT), change), max(0.35, geom.rgba[3])]
        self._add_backdrop()
        self._mark(self._scene)
        picture = self._read(*self._size)
        if self._textured:
            own = self._bare(*self._size)
            differs = _differs(own, self._usual, 4)
            tinted = _tint(picture[differs] / 255, own[differs] / 255 - self._usual)
            picture[differs] = np.round(255 * tinted)
        through = picture[self._through].astype(float)
        through += THROUGH * (self._faint - through)
        picture[self._through] = np.round(through)
        return picture

    def _bare(self, width: int, height: int) -> Image:
        """The part in its own colours, unlit; all else in the colour that is usual on it."""
        self._update(self._camera)
        for geom, inside in self._drawn():
            geom.emission = 0
            if inside:
                geom.rgba[3] = max(0.35, geom.rgba[3])
            else:
                geom.matid = -1
                geom.rgba[:3] = self._usual
        self._add_backdrop()
        self._scene.geoms[self._scene.ngeom - 1].rgba[:3] = self._usual
        light = self._scene.lights[0]
        light.ambient[:], light.diffuse[:], light.specular[:] = 1, 0, 0
        return self._read(width, height)

    def _drawn(self) -> list[tuple[mujoco.MjvGeom, bool]]:
        """What the scene draws, and whether it is of the part."""
        geom, part = int(mujoco.mjtObj.mjOBJ_GEOM), set(self.part)
        shown = self._scene.geoms[: self._scene.ngeom]
        return [(g, g.objtype == geom and g.objid in part) for g in shown]

    def _add_backdrop(self) -> None:
        """A plain background; MuJoCo has none for a model without a sky."""
        frame = View(self._camera.azimuth, self._camera.elevation).frame()
        far = 0.9 * self.model.vis.map.zfar * self.model.stat.extent
        centre = self._camera.lookat + (far - self._camera.distance) * frame[2]
        geom = self._scene.geoms[self._scene.ngeom]
        rotation = (frame * [[1], [1], [-1]]).T.ravel()
        lit = AMBIENT + DIFFUSE * float(frame[2] @ self._scene.lights[0].dir)
        rgba = np.array([*(c / lit for c in BACKGROUND), 1], np.float32)
        plane = mujoco.mjtGeom.mjGEOM_PLANE
        mujoco.mjv_initGeom(geom, plane, np.full(3, far), centre, rotation, rgba)
        geom.specular = 0
        self._scene.ngeom += 1

    def _update(self, camera: mujoco.MjvCamera) -> None:
        everything = mujoco.mjtCatBit.mjCAT_ALL.value
        model, data, scene = self.model, self.data, self._scene
        mujoco.mjv_updateScene(model, data, self._option, None, camera, everything, scene)
        # The headlight, but from over the left shoulder: faces that differ in direction differ.
        right, up, forward = View(camera.azimuth, camera.elevation).frame()
        light = scene.lights[0]
        light.headlight = 0
        way = forward - 0.55 * up + 0.35 * right
        light.dir[:] = way / np.linalg.norm(way)

    def _read(self, width: int, height: int, segments: bool = False) -> Image:
        for flag in (mujoco.mjtRndFlag.mjRND_SEGMENT, mujoco.mjtRndFlag.mjRND_IDCOLOR):
            self._scene.flags[flag] = segments
        return self._canvas.draw(self._scene, width, height)


def _tint(colour: Array, change: Array) -> Array:
    """The highlight's colour where the part's own is changed by this; both RGB, shape (..., 3)."""
    grey = change.mean(axis=-1, keepdims=True)
    lit = colour + LIGHTER * np.maximum(grey, 0) * (1 - colour)
    lit += DARKER * np.minimum(grey, 0) * colour
    return np.asarray(np.clip(lit + TINGE * (change - grey), 0, 1))


def _differs(image: Image, colour: Array | tuple[float, ...], by: int) -> Mask:
    """Which pixels differ from the colour, 0 to 1, by more than this in a channel, 0 to 255."""
    middle = np.round(255 * np.array(colour))
    low, high = (np.clip(middle + k, 0, 255).astype(np.uint8) for k in (-by, by))
    far = (image < low) | (image > high)
    return np.asarray(far[..., 0] | far[..., 1] | far[..., 2])
