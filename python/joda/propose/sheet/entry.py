"""A joint on the contact sheet: what its folder tells, made small."""

import base64
import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from joda.field import evaluate
from joda.files import write_bytes
from joda.profile import Profile
from joda.propose.history import History, Round
from joda.scenes.context import Context

Array = NDArray[np.float64]

SIZE = (240, 171)
"""Of a small picture, pixels; two are beside each other."""
SHOWN = 0.95
"""Of the height of a picture; below is its caption, which nobody could read."""
QUALITY = 70
"""Of its JPEG."""
SMALL = "small.jpg"
WIDTH, HEIGHT = 240, 80
"""Of a sketch."""
FULL = 0.75
"""Share of its height that the largest force takes."""


@dataclass(frozen=True)
class Entry:
    """A joint.

    Attributes:
        label: model and joint, as they are told.
        failed: why it has no profile; then all else is empty.
        joint: its name or address in the scene.
        folder: where everything is.
        kind: what it was taken for.
        likely: how sure that is, 0 to 1.
        others: what else it could be, in words.
        met, unmet, notes: of the last round, a sentence each.
        rounds: all of them, oldest first.
        remarks: what was told of the model and its files.
        force: that opening takes at the handle, N; None where a hand cannot open it.
        band: what such joints take, N; None where nothing is known.
        picture: JPEG, closed beside open, in base64; empty where nothing could render.
        sketch: the profile as SVG.
    """

    label: str
    failed: str = ""
    joint: str = ""
    folder: Path = Path()
    kind: str = ""
    likely: float = 0.0
    others: tuple[str, ...] = ()
    met: tuple[str, ...] = ()
    unmet: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    rounds: tuple[Round, ...] = ()
    remarks: tuple[str, ...] = ()
    force: float | None = None
    band: tuple[float, float] | None = None
    picture: str = ""
    sketch: str = ""

    @classmethod
    def read(cls, label: str, folder: Path, history: History, remarks: tuple[str, ...]) -> "Entry":
        """Of a joint that has rounds.

        Args:
            label: as it is told.
            folder: where everything is.
            history: what the folder's `history.json` holds.
            remarks: what was told of the model and its files.

        Raises:
            JodaError: a file of the folder cannot be read or written.
        """
        last = history.rounds[-1]
        profile = Profile.read(folder / "composed.json")
        context = Context.model_validate_json((folder / "context.json").read_text("utf-8"))
        way, found = last.behaviour.opening, last.recognised
        summary = last.proposal.joint_summary
        names = (history.pictures or ())[:: 1 if last.behaviour.closed_end == "low_end" else -1]
        force = way.force if way.steady is None else way.steady
        return cls(
            label=label,
            joint=profile.joint.name,
            folder=folder,
            kind=found.title if found else summary.motion_description.split(" (")[0],
            likely=last.sure,
            others=tuple(f"{one.title} {one.likely:.0%}" for one in found.others) if found else (),
            met=last.met,
            unmet=last.unmet,
            notes=last.notes,
            rounds=history.rounds,
            remarks=remarks,
            force=force / context.lever_arm if way.arrived else None,
            band=found.force.opening if found and found.force else None,
            picture=base64.b64encode(_small(folder / "pictures", names)).decode(),
            sketch=_sketch(profile, context),
        )


def _small(folder: Path, names: tuple[str, ...]) -> bytes:
    """The first picture beside the last, in little; made once, `small.jpg` holds it."""
    from PIL import Image

    paths = [folder / name for name in (*names[:1], *names[-1:])]
    if not paths or not all(path.is_file() for path in paths):
        return b""
    made = folder / SMALL
    if made.is_file() and made.stat().st_mtime >= max(path.stat().st_mtime for path in paths):
        return made.read_bytes()
    both = Image.new("RGB", (2 * SIZE[0], SIZE[1]))
    try:
        for number, path in enumerate(paths):
            with Image.open(path) as picture:
                shown = (0, 0, picture.width, round(SHOWN * picture.height))
                little = picture.convert("RGB").resize(SIZE, Image.Resampling.BOX, shown)
            both.paste(little, (number * SIZE[0], 0))
    except OSError:  # somebody has put something else there
        return b""
    content = io.BytesIO()
    both.save(content, "jpeg", quality=QUALITY)
    write_bytes(made, content.getvalue())
    return content.getvalue()


def _sketch(profile: Profile, context: Context) -> str:
    """The profile as SVG: the conservative force in red, the band of friction, gravity dashed."""
    s, channels = np.linspace(0, 1, 121), profile.channels
    force, friction = (evaluate(c, s)[0] for c in (channels.conservative, channels.friction))
    balance = np.interp(s, np.linspace(0, 1, len(context.gravity_force)), context.gravity_force)
    high = max(float(np.abs([force - friction, force + friction, -balance]).max()), 1e-9)

    def points(values: Array) -> str:
        rows = HEIGHT / 2 * (1 - FULL * values / high)
        return " ".join(f"{WIDTH * a:.0f},{b:.1f}" for a, b in zip(s, rows, strict=True))

    back = " ".join(points(force - friction).split()[::-1])
    unit = profile.joint.force_unit
    return (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img"><title>force over position, up to '
        f'{high:.3g} {unit}</title><line x2="{WIDTH}" y1="{HEIGHT / 2}" y2="{HEIGHT / 2}"/>'
        f'<polygon points="{points(force + friction)} {back}"/>'
        f'<polyline class="gravity" points="{points(-balance)}"/>'
        f'<polyline points="{points(force)}"/><text x="2" y="10">{high:.2g} {unit}</text></svg>'
    )
