"""A joint's scene made ready to be looked at: cameras, highlight, axis and arrow.

Runs in the child process of `joda.offscreen`.
"""

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.model import load
from joda.offscreen import HEIGHT, WIDTH, Image

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FOVY = 30.0
MARGIN = 0.88
"""Share of the frame, in width or height, that the motion takes."""

HIGHLIGHT = (0.08, 0.40, 0.95)
ARROW = (0.95, 0.36, 0.05)
AXIS = (0.12, 0.12, 0.14)
BACKGROUND = (0.91, 0.92, 0.93)

THROUGH = 0.35
"""How much of the axis and the arrow shows through what stands before them."""

SCOUT = (96, 72)


def _alpha(model: mujoco.MjModel) -> Array:
    """Opacity with which MuJoCo draws each geom: its own, or its material's."""
    own = model.geom_rgba
    material = (model.geom_matid >= 0) & np.all(
        own == np.array([0.5, 0.5, 0.5, 1], np.float32), axis=1
    )
    alpha: Array = own[:, 3].astype(float)
    alpha[material] = model.mat_rgba[model.geom_matid[material], 3]
    return alpha


def _groups(model: mujoco.MjModel, joint: int) -> list[int]:
    """The groups to show: MuJoCo's default, and if the moving part has none of it, its own."""
    geoms = _subtree(model, int(model.jnt_bodyid[joint]))
    own = sorted({int(model.geom_group[g]) for g in geoms})
    return [0, 1, 2] if not own or own[0] <= 2 else [0, 1, 2, own[0]]


def _subtree(model: mujoco.MjModel, body: int) -> list[int]:
    """The geoms of a body and of all below it that are not wholly transparent."""
    inside = np.zeros(model.nbody, bool)
    inside[body] = True
    for k in range(body + 1, model.nbody):
        inside[k] = inside[model.body_parentid[k]]
    return np.flatnonzero(inside[model.geom_bodyid] & (_alpha(model) > 0)).tolist()


def moving(model: mujoco.MjModel, joint: int) -> list[int]:
    """The geoms that the joint moves and the pictures show."""
    shown = _groups(model, joint)
    return [
        g for g in _subtree(model, int(model.jnt_bodyid[joint])) if model.geom_group[g] in shown
    ]


def _outline(model: mujoco.MjModel, geom: int) -> Array:
    """Points in the geom's frame that it lies within, a mesh nearly; shape (n, 3)."""
    if model.geom_type[geom] != int(mujoco.mjtGeom.mjGEOM_MESH):
        box = model.geom_aabb[geom]
        return np.asarray(
            box[:3] + np.stack(np.meshgrid(*[[-1, 1]] * 3), -1).reshape(-1, 3) * box[3:]
        )
    mesh = int(model.geom_dataid[geom])
    first, number = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    vertices = model.mesh_vert[first : first + number].astype(float)
    directions = np.random.default_rng(0).normal(size=(3, 100))
    return np.asarray(vertices[np.unique(np.argmax(vertices @ directions, axis=0))])


@dataclass(frozen=True)
class View:
    """A direction to look in, in degrees as MjvCamera has it: elevation is negative from above."""

    azimuth: float
    elevation: float

    def frame(self) -> Array:
        """Unit vectors to the right, up and forward, as rows."""
        a, e = np.deg2rad([self.azimuth, self.elevation])
        forward = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([np.sin(a), -np.cos(a), 0.0])
        return np.stack([right, np.cross(right, forward), forward])

    def camera(self, points: Array) -> mujoco.MjvCamera:
        """The nearest camera that has all points, shape (n, 3), within MARGIN of the frame."""
        right, up, forward = self.frame()
        depth = points @ forward
        slope = MARGIN * np.tan(np.deg2rad(FOVY / 2))
        centre, start = [], []
        for across, tangent in ((right, slope * WIDTH / HEIGHT), (up, slope)):
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


class Studio:
    """A model with one joint's part highlighted, lit from the camera, before a plain background.

    Attributes:
        model, data: changed for the pictures; the data hold the kinematics of the last pose.
        joint: index.
        part: geoms that the joint moves.
    """

    def __init__(self, path: Path, joint: int) -> None:
        """Loads the model and makes the OpenGL context; raises what its backend raises."""
        self.model = model = _with_sky(path)
        self.data = mujoco.MjData(model)
        self.joint, self.part = joint, moving(model, joint)
        self._outlines = [_outline(model, g) for g in self.part]
        self._dress()
        self._gl = mujoco.GLContext(WIDTH, HEIGHT)
        self._gl.make_current()
        self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        self._scene = mujoco.MjvScene(model, maxgeom=4 * model.ngeom + 2000)
        for flag in ("SHADOW", "REFLECTION", "HAZE"):
            self._scene.flags[getattr(mujoco.mjtRndFlag, f"mjRND_{flag}")] = False
        self._option = mujoco.MjvOption()
        self._option.sitegroup[:] = 0
        for group in _groups(model, joint):
            self._option.geomgroup[group] = 1

    def _dress(self) -> None:
        """Highlights the part, evens out background and light, and sizes the frame."""
        model, alpha = self.model, _alpha(self.model)
        for texture in np.flatnonzero(model.tex_type == int(mujoco.mjtTexture.mjTEXTURE_SKYBOX)):
            channels, first = int(model.tex_nchannel[texture]), int(model.tex_adr[texture])
            size = int(model.tex_width[texture] * model.tex_height[texture]) * channels
            pixel = [round(255 * c) for c in (*BACKGROUND, 1.0)][:channels]
            model.tex_data[first : first + size].reshape(-1, channels)[:] = pixel
        for g in self.part:
            material = int(model.geom_matid[g])
            plain = model.mat_rgba[material] if material >= 0 else model.geom_rgba[g]
            shade = 0.8 + 0.2 * float(plain[:3].mean())
            model.geom_rgba[g] = [*(shade * c for c in HIGHLIGHT), max(0.35, alpha[g])]
            model.geom_matid[g] = -1
        model.light_active[:] = 0
        model.vis.headlight.active = 1
        model.vis.headlight.ambient[:] = 0.48
        model.vis.headlight.diffuse[:] = 0.50
        model.vis.headlight.specular[:] = 0.08
        model.vis.global_.fovy = FOVY
        model.vis.global_.offwidth, model.vis.global_.offheight = WIDTH, HEIGHT
        model.vis.quality.offsamples = 4
        model.vis.quality.shadowsize = 0

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
        self._update(cameras[0])
        shown = self._scene.geoms[: self._scene.ngeom]
        geom, part = int(mujoco.mjtObj.mjOBJ_GEOM), set(self.part)
        ids = [g.segid + 1 for g in shown if g.objtype == geom and g.objid in part]
        masks = []
        for camera in cameras:
            mujoco.mjv_updateCamera(self.model, self.data, camera, self._scene)
            pixels = self._read(*SCOUT, segments=True).astype(np.int64)
            masks.append(np.isin(pixels @ [1, 256, 65536], ids))
        return masks

    def shoot(self, camera: mujoco.MjvCamera, marks: "Marks") -> Image:
        """The picture in this pose; marks that stand behind something show through faintly."""
        self._update(camera)
        self._scene.ngeom = 0
        marks.add(self._scene)
        alone = self._read(WIDTH, HEIGHT).astype(float)
        self._update(camera)
        marks.add(self._scene)
        picture = self._read(WIDTH, HEIGHT).astype(float)
        marked = np.abs(alone - 255 * np.array(BACKGROUND)).max(axis=2, keepdims=True) > 8
        picture += THROUGH * marked * (alone - picture)
        return np.clip(np.round(picture), 0, 255).astype(np.uint8)

    def _update(self, camera: mujoco.MjvCamera) -> None:
        everything = mujoco.mjtCatBit.mjCAT_ALL.value
        model, data, scene = self.model, self.data, self._scene
        mujoco.mjv_updateScene(model, data, self._option, None, camera, everything, scene)
        # The headlight, but from over the left shoulder: faces that differ in direction differ.
        right, up, forward = View(camera.azimuth, camera.elevation).frame()
        light = scene.lights[0]
        light.headlight = 0
        light.dir[:] = forward - 0.55 * up + 0.35 * right

    def _read(self, width: int, height: int, segments: bool = False) -> Image:
        for flag in (mujoco.mjtRndFlag.mjRND_SEGMENT, mujoco.mjtRndFlag.mjRND_IDCOLOR):
            self._scene.flags[flag] = segments
        rect = mujoco.MjrRect(0, 0, width, height)
        mujoco.mjr_render(rect, self._scene, self._context)
        image = np.empty((height, width, 3), np.uint8)
        mujoco.mjr_readPixels(image, None, rect, self._context)
        return image[::-1]


def _with_sky(path: Path) -> mujoco.MjModel:
    """The model, given a background if it has none; raises JodaError."""
    spec, model = load(path)
    if int(mujoco.mjtTexture.mjTEXTURE_SKYBOX) in model.tex_type:
        return model
    if spec.compiler.discardvisual:  # it discards textures too, as for URDF; do the rest by hand
        spec.compiler.discardvisual = False
        for geom in [g for g in spec.geoms if not (g.contype or g.conaffinity)]:
            spec.delete(geom)
    sky = spec.add_texture(name="joda_sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX)
    sky.builtin, sky.width, sky.height = mujoco.mjtBuiltin.mjBUILTIN_FLAT, 8, 48
    return spec.compile()


@dataclass(frozen=True)
class Marks:
    """The axis and the arrow towards +q.

    Attributes:
        line: ends of the axis, shape (2, 3).
        path: the arrow's corners, shape (n, 3).
        width: radius of the arrow, m.
    """

    line: Array
    path: Array
    width: float

    def add(self, scene: mujoco.MjvScene) -> None:
        """Adds them to what the scene draws."""
        kind = mujoco.mjtGeom
        _connect(scene, kind.mjGEOM_CAPSULE, 0.45 * self.width, self.line, AXIS)
        for ends in zip(self.path[:-2], self.path[1:-1], strict=True):
            _connect(scene, kind.mjGEOM_CAPSULE, self.width, ends, ARROW)
        _connect(scene, kind.mjGEOM_ARROW, 2.2 * self.width, self.path[-2:], ARROW)


def _connect(
    scene: mujoco.MjvScene,
    kind: mujoco.mjtGeom,
    width: float,
    ends: Array | tuple[Array, Array],
    colour: tuple[float, float, float],
) -> None:
    geom = scene.geoms[scene.ngeom]
    rgba = np.array([*colour, 1], np.float32)
    mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.eye(3).ravel(), rgba)
    mujoco.mjv_connector(geom, kind, width, *ends)
    geom.emission = 0.35
    scene.ngeom += 1
