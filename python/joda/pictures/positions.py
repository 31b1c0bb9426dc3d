"""Pictures of a joint: what it moves, highlighted, from one end of its range to the other.

The camera is chosen by looking: of many directions the one from which most of the moving part, and
of its motion, can be seen. All the work is done in a child process, see `joda.pictures.offscreen`.
"""

import io
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from joda.errors import JodaError
from joda.files import check_target, file_name, make_folder, write_bytes
from joda.pictures.canvas import Canvas
from joda.pictures.caption import captioned
from joda.pictures.offscreen import HEIGHT, WIDTH, Image, answer, ask
from joda.pictures.scene_renderer import SceneRenderer, View
from joda.pictures.style import COMPRESSED, clean
from joda.profile import Joint
from joda.scenes.model import describe_joint, find_joint, load_model
from joda.scenes.model_cache import cache_name
from joda.scenes.part import Array, moving

ARROW = (0.95, 0.36, 0.05)
AXIS = (0.12, 0.12, 0.14)

ELEVATIONS = (-42.0, -22.0)
FROM_BELOW = -ELEVATIONS[1]
TRIED = 8
"""How many of the candidates, the most promising, are rendered."""


def render(
    model: str | Path,
    joint: str,
    output: str | Path,
    *,
    count: int = 5,
    size: tuple[int, int] = (WIDTH, HEIGHT),
    force: bool = False,
) -> list[Path]:
    """Writes pictures of a joint at evenly spaced positions, from the low to the high end.

    What the joint moves is blue, lighter or darker where it has markings; its axis is dark, +q the
    orange arrow; the other joints are at their reference. All pictures have the same camera.

    Args:
        model: MJCF or URDF file.
        joint: a hinge or slide with a range, as `joda.scenes.model.find_joint` takes it.
        output: folder; created if missing.
        count: how many pictures, at least 2.
        size: width and height of each, pixels.
        force: overwrite pictures that exist.

    Returns:
        the pictures, PNG, named by the joint and its normalised position:
        door_0.00.png, door_0.25.png, ...

    Raises:
        JodaError: the file cannot be loaded, the joint does not exist, has no range or moves
            nothing that can be seen, or the pictures cannot be written.
        NoRenderer: a JodaError; nothing can render here.
    """
    if count < 2:
        raise JodaError(f"count is {count}; give at least 2 pictures, one for each end.")
    request = [str(model), joint, str(output), count, size, force, cache_name()]
    return [Path(target) for target in ask("joda.pictures.positions", request)]


def _make(request: Any) -> list[str]:
    """In the child: renders and writes the pictures that `render` is asked for."""
    path, address, folder, count, size, force, cache = request
    model, canvas = _opened(path, cache)
    index = find_joint(model, address)
    joint = describe_joint(model, index)
    if not moving(model, index):
        raise JodaError(f"{path}: joint '{joint.name}' moves no geom that can be seen.")
    stage = SceneRenderer(copy(model), index, canvas, tuple(size))
    fractions = np.linspace(0, 1, count)
    stem = file_name(joint.name)
    digits = max(2, len(str(count - 2)))
    make_folder(Path(folder))
    targets = [Path(folder) / f"{stem}_{s:.{digits}f}.png" for s in fractions]
    for target in targets:
        check_target(target, force)
    lo, hi = joint.range
    positions = lo + fractions * (hi - lo)
    labels = [_label(joint, q, s) for q, s in zip(positions, fractions, strict=True)]
    # Compressing one picture while the next is rendered.
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(_write, targets, labels, _shots(stage, positions)))
    return [str(target) for target in targets]


def _opened(path: str, cache: str | None) -> tuple[mujoco.MjModel, Canvas]:
    """A file's model and a canvas for it: the last ones, where they are of the same cache."""
    if cache is None or (path, cache) not in _last:
        _last.clear()
        model = load_model(Path(path))
        _last[path, cache] = model, Canvas(model)
    return _last[path, cache]


_last: dict[tuple[str, str | None], tuple[mujoco.MjModel, Canvas]] = {}


def _label(joint: Joint, q: float, s: float) -> str:
    hinge = joint.type == "hinge"
    other = f"{np.rad2deg(q):.1f}°" if hinge else f"{q * 1000:.4g} mm"
    name = clean(joint.name)
    text = f"{name}    q = {q:.3g} {joint.unit} ({other})    s = {s:.2f}"
    return text.replace("-", "\N{MINUS SIGN}") if "-" not in name else text


def _write(target: Path, label: str, image: Image) -> None:
    """Writes the picture as PNG, its label in the lower left corner."""
    content = io.BytesIO()
    captioned(image, label).save(content, "png", compress_level=COMPRESSED)
    write_bytes(target, content.getvalue())


def _views(kind: str, axis: Array, out: Array) -> Iterator[tuple[View, float]]:
    """Candidates and how well each suits the joint's axis, 0 to 1, whatever stands in between."""
    level = axis if np.hypot(*axis[:2]) > 0.3 else out
    start = np.rad2deg(np.arctan2(level[1], level[0]))
    for elevation in (*ELEVATIONS, FROM_BELOW):
        for k in range(12):
            view = View(float(start + 15 + 30 * k), elevation)
            along = abs(view.frame()[2] @ axis)
            best, width = (0.55, 0.5) if kind == "hinge" else (0.65, 0.5)
            suits = float(np.exp(-(((along - best) / width) ** 2)))
            yield view, suits * (0.5 if elevation > 0 else 1.0)


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


def _hinge_marks(anchor: Array, axis: Array, span: float, low: Array, union: Array) -> list[Marks]:
    """Marks of a hinge, the arrow at either end of the part.

    Args:
        anchor: a point of the axis, shape (3,).
        axis: unit vector, shape (3,).
        span: width of the range, rad.
        low: points of the part at the low end, shape (n, 3).
        union: points of the part at all positions, shape (n, 3).
    """
    height = (union - anchor) @ axis
    offset = low - anchor - np.outer((low - anchor) @ axis, axis)
    far = int(np.argmax(np.linalg.norm(offset, axis=1)))
    radius = float(np.linalg.norm(offset[far]))
    size = max(2 * radius, float(np.ptp(height)))
    first = offset[far] / max(radius, 1e-9)
    shown = float(np.clip(span, 0.6, 5.5))
    angles = np.linspace(0, shown, 25) + (span - shown) / 2
    turned = np.outer(np.cos(angles), first) + np.outer(np.sin(angles), np.cross(axis, first))
    # The last step is the head.
    turned = np.concatenate([turned[:-3], turned[-1:]])
    room = 0.12 * size
    line = anchor + np.outer([height.min() - room, height.max() + room], axis)
    return [
        Marks(line, anchor + 1.05 * radius * turned + end * axis, 0.008 * size)
        for end in (height.max(), height.min())
    ]


def _slide_marks(axis: Array, low: Array, union: Array) -> list[Marks]:
    """Marks of a slide, the arrow above or below the part; arguments as for a hinge."""
    side = np.array([0, 0, 1.0]) - axis[2] * axis
    if np.linalg.norm(side) < 0.3:
        side = np.array([1.0, 0, 0]) - axis[0] * axis
    side /= np.linalg.norm(side)
    size = float(np.linalg.norm(np.ptp(low, axis=0)))
    centre = (low.min(axis=0) + low.max(axis=0)) / 2
    reach = union @ axis - centre @ axis
    travel = float(np.ptp(reach) - np.ptp(low @ axis))
    length = max(travel, 0.4 * size)
    middle = travel / 2
    marks = []
    for sign in (1.0, -1.0):
        lift = np.max(sign * ((union - centre) @ side)) + 0.06 * size
        on = centre + sign * lift * side
        ends = on + np.outer([middle - length / 2, middle + length / 2], axis)
        head = ends[1] - 0.35 * length * axis
        line = on + np.outer([reach.min() - 0.1 * size, reach.max() + 0.1 * size], axis)
        marks.append(Marks(line, np.stack([ends[0], head, ends[1]]), 0.009 * size))
    return marks


def _shots(stage: SceneRenderer, positions: Array) -> Iterator[Image]:
    """The pictures at these positions, rad or m, all with the same camera."""
    lo, hi = positions[0], positions[-1]
    clouds = []
    for position in np.linspace(lo, hi, 9):
        stage.pose(position)
        clouds.append(stage.points())
    union = np.concatenate(clouds)
    stage.pose(lo)
    anchor, axis = stage.data.xanchor[stage.joint].copy(), stage.data.xaxis[stage.joint].copy()
    kind = describe_joint(stage.model, stage.joint).type
    if kind == "hinge":
        options = _hinge_marks(anchor, axis, hi - lo, clouds[0], union)
    else:
        options = _slide_marks(axis, clouds[0], union)
    stage.reach(union)
    out = clouds[0].mean(axis=0) - anchor
    view = _choose(stage, _views(kind, axis, out), union, (lo, (lo + hi) / 2, hi))
    # The arrow on the side of the part that is turned to the camera.
    marks = min(options, key=lambda mark: float(mark.path.mean(axis=0) @ view.frame()[2]))
    stage.settle(stage.camera(view, np.concatenate([union, marks.path])), marks.add)
    for position in positions:
        stage.pose(position)
        yield stage.shoot()


def _choose(
    stage: SceneRenderer,
    candidates: Iterator[tuple[View, float]],
    union: Array,
    positions: Sequence[float],
) -> View:
    """The view that shows most of the part at all positions, rad or m, and most of its motion."""
    views, suits = zip(*candidates, strict=True)
    cameras = [stage.camera(view, union) for view in views]
    clear = []
    for position in positions:
        stage.pose(position)
        points = stage.points()
        targets = points[np.linspace(0, len(points) - 1, 12).astype(int)]
        clear.append([stage.clear(camera, targets) for camera in cameras])
    promise = np.array(suits) * (0.1 + np.mean(clear, axis=0))
    tried = np.argsort(-promise, kind="stable")[:TRIED]
    seen = []
    for position in positions:
        stage.pose(position)
        seen.append(np.stack(stage.scout([cameras[k] for k in tried])))
    cover = np.stack([masks.mean(axis=(1, 2)) for masks in seen])
    changed = (seen[0] ^ seen[-1]).mean(axis=(1, 2))
    shown = cover.mean(axis=0) + 8 * cover.min(axis=0) + changed
    best: View = views[tried[int(np.argmax(shown * promise[tried]))]]
    return best


if __name__ == "__main__":
    answer(_make)
