"""Pictures of a joint: what it moves, highlighted, from one end of its range to the other.

The camera is chosen by looking: of many directions the one from which most of the moving part, and
of its motion, can be seen. `render` labels and writes what a child process renders.
"""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from joda.draw import write_png
from joda.errors import JodaError
from joda.files import check_target, make_folder
from joda.model import describe_joint, find_joint, load_model
from joda.offscreen import HEIGHT, WIDTH, Image, Shots, answer, ask
from joda.profile import Joint
from joda.studio import Array, Marks, Studio, View, moving

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ELEVATIONS = (-42.0, -22.0)
FROM_BELOW = -ELEVATIONS[1]


def render(
    model: str | Path, joint: str, output: str | Path, *, count: int = 5, force: bool = False
) -> list[Path]:
    """Writes pictures of a joint at evenly spaced positions, from the low to the high end.

    What the joint moves is blue, its axis dark, +q the orange arrow; the other joints are at their
    reference. All pictures have the same camera.

    Args:
        model: MJCF or URDF file.
        joint: a hinge or slide with a range, as `joda.model.find_joint` takes it.
        output: folder; created if missing.
        count: how many pictures, at least 2.
        force: overwrite pictures that exist.

    Returns:
        the pictures, 960 x 720 PNG, named by the joint and its normalised position:
        door_0.00.png, door_0.25.png, ...

    Raises:
        JodaError: the file cannot be loaded, the joint does not exist, has no range or moves
            nothing that can be seen, the pictures cannot be written, or nothing can render here.
    """
    path, folder = Path(model), Path(output)
    if count < 2:
        raise JodaError(f"count is {count}; give at least 2 pictures, one for each end.")
    compiled = load_model(path)
    index = find_joint(compiled, joint)
    about = describe_joint(compiled, index)
    if not moving(compiled, index):
        raise JodaError(f"{path}: joint '{about.name}' moves no geom that can be seen.")
    make_folder(folder)
    fractions = np.linspace(0, 1, count)
    stem = re.sub(r"[^\w.-]+", "_", about.name).strip("_") or "joint"
    digits = max(2, len(str(count - 2)))
    targets = [folder / f"{stem}_{s:.{digits}f}.png" for s in fractions]
    for target in targets:
        check_target(target, force)
    lo, hi = about.range
    positions = [lo + s * (hi - lo) for s in fractions]
    images = ask("joda._render", [str(path), index, positions])
    if images is None:
        raise JodaError(
            "nothing can render here: OpenGL works neither through EGL nor through OSMesa, or not "
            "as MUJOCO_GL asks; on Debian, install libegl1 and libgl1-mesa-dri, or libosmesa6."
        )
    for target, image, q, s in zip(targets, images, positions, fractions, strict=True):
        write_png(_labelled(image, _label(about, q, s)), target, force)
    return targets


def _label(joint: Joint, q: float, s: float) -> str:
    hinge = joint.type == "hinge"
    other = f"{np.rad2deg(q):.1f}°" if hinge else f"{q * 1000:.4g} mm"
    text = f"{joint.name}    q = {q:.3g} {joint.unit} ({other})    s = {s:.2f}"
    return text.replace("-", "\N{MINUS SIGN}") if "-" not in joint.name else text


def _labelled(image: Image, label: str) -> "Figure":
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH / 100, HEIGHT / 100), dpi=100)
    figure.figimage(image)
    box = {"facecolor": "white", "alpha": 0.85, "edgecolor": "none", "boxstyle": "round,pad=0.4"}
    figure.text(
        0.02, 0.032, label, fontsize=14, va="bottom", color="#222222", bbox=box, parse_math=False
    )
    return figure


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


def _prepare(request: Any) -> Shots:
    path, joint, positions = request
    studio = Studio(Path(path), joint)

    def shots() -> list[Image]:
        return _shots(studio, positions)

    return shots


def _shots(studio: Studio, positions: list[float]) -> list[Image]:
    """The pictures at these positions, rad or m, all with the same camera."""
    lo, hi = positions[0], positions[-1]
    clouds = []
    for position in np.linspace(lo, hi, 9):
        studio.pose(position)
        clouds.append(studio.points())
    union = np.concatenate(clouds)
    studio.pose(lo)
    anchor, axis = studio.data.xanchor[studio.joint].copy(), studio.data.xaxis[studio.joint].copy()
    kind = describe_joint(studio.model, studio.joint).type
    if kind == "hinge":
        options = _hinge_marks(anchor, axis, hi - lo, clouds[0], union)
    else:
        options = _slide_marks(axis, clouds[0], union)
    studio.reach(union)
    out = clouds[0].mean(axis=0) - anchor
    view = _choose(studio, _views(kind, axis, out), union, (lo, (lo + hi) / 2, hi))
    # The arrow on the side of the part that is turned to the camera.
    marks = min(options, key=lambda mark: float(mark.path.mean(axis=0) @ view.frame()[2]))
    camera = view.camera(np.concatenate([union, marks.path]))
    pictures = []
    for position in positions:
        studio.pose(position)
        pictures.append(studio.shoot(camera, marks))
    return pictures


def _choose(
    studio: Studio,
    candidates: Iterator[tuple[View, float]],
    union: Array,
    positions: Sequence[float],
) -> View:
    """The view that shows most of the part at all positions, rad or m, and most of its motion."""
    views, suits = zip(*candidates, strict=True)
    cameras = [view.camera(union) for view in views]
    seen, clear = [], []
    for position in positions:
        studio.pose(position)
        seen.append(np.stack(studio.scout(cameras)))
        points = studio.points()
        targets = points[np.linspace(0, len(points) - 1, 12).astype(int)]
        clear.append([studio.clear(camera, targets) for camera in cameras])
    cover = np.stack([masks.mean(axis=(1, 2)) for masks in seen])
    changed = (seen[0] ^ seen[-1]).mean(axis=(1, 2))
    shown = cover.mean(axis=0) + 8 * cover.min(axis=0) + changed
    score = shown * np.array(suits) * (0.1 + np.mean(clear, axis=0))
    best: View = views[int(np.argmax(score))]
    return best


if __name__ == "__main__":
    answer(_prepare)
