"""The left of the page: the scene in 3D, and the joint's position."""

from collections.abc import Callable

import numpy as np
from nicegui import ui

from joda.commands.studio.shared import Shared
from joda.commands.studio.solids import Shape
from joda.scenes.motion import Motion

FOVY = 32.0
MOVING = (0.16, 0.44, 0.90)
"""Colour with which what moves is tinted."""
TINT = 0.5
NEAR = 1.3
"""What stands still is framed too, up to so many times the radius of what moves."""
FRAMES = 25.0
"""Pictures per second while a motion is shown."""
LAZILY = """
(() => {
  const renderer = getElement(ID).renderer, draw = renderer.render;
  let drawn = "";
  renderer.render = function (scene, camera) {
    const seen = [renderer.domElement.width, renderer.domElement.height];
    for (const one of [camera, ...scene.children.flatMap((child) => [child, ...child.children])])
      seen.push(one.id, ...one.position.toArray(), ...one.quaternion.toArray(),
        one.material?.color?.getHex(), one.material?.opacity);
    if (drawn === (drawn = seen.join())) return;
    draw.call(renderer, scene, camera);
  };
})()
"""
"""Draws a picture only if something has moved: without a GPU each one costs much."""


class View3D:
    """The scene, a slider for the joint, and buttons that show its motions."""

    def __init__(self, shared: Shared, shape: Shape, moved: Callable[[float], None]) -> None:
        """Builds the panel where the page is being built.

        Args:
            shared: the studio.
            shape: of the scene.
            moved: told the joint's position (rad or m) when it changes.
        """
        self._shared, self._shape, self._moved = shared, shape, moved
        self._motion: Motion | None = None
        joint = shared.session.opened.joint
        lo, hi = joint.range
        with ui.element("section").classes("card view"):
            self._draw(lo, hi)
            with ui.element("div").classes("posing"):
                self._slider = ui.slider(
                    min=lo, max=hi, step=(hi - lo) / 500, value=shared.live.start,
                    on_change=lambda event: self._at(event.value),
                ).props('aria-label="joint position"')  # fmt: skip
                self._label = ui.label().classes("number")
            with ui.element("div").classes("posing"):
                let_go = ui.button("Let go here", on_click=self._let_go)
                let_go.props("outline dense no-caps size=sm").classes("let-go")
                let_go.tooltip("the release on the right begins at this position")
                for kind, words in (("release", "Play the release"), ("hand", "Play the hand")):
                    button = ui.button(words, on_click=lambda k=kind: self._play(k))
                    button.props("flat dense no-caps size=sm icon=play_arrow")
        self._timer = ui.timer(1 / FRAMES, self._frame, active=False)
        self._at(shared.live.start)

    def _draw(self, lo: float, hi: float) -> None:
        shape = self._shape
        eye, centre, far = _camera(shape, lo, hi)
        camera = ui.scene.perspective_camera(fov=FOVY, near=far / 200, far=far * 40)
        with ui.scene(
            width=520, height=400, grid=False, camera=camera, background_color="#eef0f2", fps=30
        ).classes("scene") as self._scene:
            group = self._scene.group()
            for number, solid in enumerate(shape.solids):
                red, green, blue, alpha = solid.rgba
                colour = np.array([red, green, blue])
                if solid.moves:
                    colour = (1 - TINT) * colour + TINT * np.array(MOVING)
                if solid.moves:
                    with group:
                        drawn = self._scene.stl(f"/solids/{number}.stl")
                else:
                    drawn = self._scene.stl(f"/solids/{number}.stl")
                drawn.material(_hex(colour), alpha)
            ends = _axis(shape, lo, hi)
            self._scene.line(*ends.tolist()).material("#d98c1f")
        self._group = group
        lazily = LAZILY.replace("ID", str(self._scene.id))
        self._scene.on("init", lambda: ui.run_javascript(lazily))
        (x, y, z), (at_x, at_y, at_z) = eye, centre
        self._scene.move_camera(x, y, z, at_x, at_y, at_z, duration=0)

    def _at(self, position: float) -> None:
        """Shows the joint at a position, rad or m."""
        joint = self._shared.session.opened.joint
        rotation, shift = self._shape.pose(position)
        self._group.rotate_R(rotation.tolist())
        self._group.move(*map(float, shift))
        other = f" · {np.rad2deg(position):.1f}°" if joint.type == "hinge" else ""
        self._label.set_text(f"{position:.4g} {joint.unit}{other}".replace("-", "\N{MINUS SIGN}"))
        self._moved(position)

    def _let_go(self) -> None:
        self._shared.live.release_at(float(self._slider.value or 0.0))

    def _play(self, kind: str) -> None:
        """Shows a motion from its beginning, in real time."""
        self._motion = self._shared.live.found.get(kind)
        if self._motion is not None:
            self._shown = 0.0
            self._timer.activate()

    def _frame(self) -> None:
        motion = self._motion
        if motion is None or self._shown > motion.time[-1]:
            self._timer.deactivate()
            return
        lo, hi = self._shared.session.opened.joint.range
        position = float(np.interp(self._shown, motion.time, motion.position))
        self._slider.set_value(float(np.clip(position, lo, hi)))
        self._shown += 1 / FRAMES


def _hex(colour: np.ndarray) -> str:
    return "#" + "".join(f"{round(255 * float(part)):02x}" for part in colour)


def _axis(shape: Shape, lo: float, hi: float) -> np.ndarray:
    """Ends of the joint's axis, a little longer than what it moves."""
    along = (shape.reach(lo, hi) - shape.anchor) @ shape.axis
    room = 0.15 * max(float(np.ptp(along)), 1e-3)
    return shape.anchor + np.outer([along.min() - room, along.max() + room], shape.axis)


def _camera(shape: Shape, lo: float, hi: float) -> tuple[list[float], list[float], float]:
    """Eye, centre, and the distance between them: from the side to which the part opens."""
    points = shape.reach(lo, (lo + hi) / 2, hi)
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    own = float(np.linalg.norm(points - centre, axis=1).max())
    still = [s.triangles.reshape(-1, 3) for s in shape.solids if not s.moves]
    near = np.linalg.norm(np.concatenate([points, *still]) - centre, axis=1)
    radius = float(near[near < NEAR * own].max())
    closed, opened = (shape.reach(q).mean(axis=0) for q in (lo, hi))
    way = opened - closed
    if np.linalg.norm(way) < 0.05 * own:  # a knob: look along its axis, from outside
        behind = np.concatenate(still).mean(axis=0) if still else centre - shape.axis
        way = shape.axis * (1.0 if (centre - behind) @ shape.axis >= 0 else -1.0)
    flat = np.array([way[0], way[1], 0.0])
    if np.linalg.norm(flat) < 0.2 * np.linalg.norm(way):
        flat = np.array([1.0, -1.0, 0.0])
    azimuth = np.arctan2(flat[1], flat[0]) + np.deg2rad(38)
    elevation = np.deg2rad(24)
    towards = np.array(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )
    far = radius / np.sin(np.deg2rad(FOVY / 2))
    eye = centre + far * towards
    return list(map(float, eye)), list(map(float, centre)), far
