"""What the studio works on: a joint's profile and its past, measured runs, and where it is saved.

The profile is whole (`joda.scenes.native`): MuJoCo's own spring, friction and damping are
components of it. Whatever is shown or done is done by the functions behind the commands, on the
scene that would be saved.
"""

import tempfile
from itertools import count
from pathlib import Path
from threading import Lock

from joda.commands.studio import edits
from joda.commands.studio.folder import Folder
from joda.commands.studio.timeline import Timeline
from joda.diagnosis.outcome import scene_files
from joda.errors import JodaError
from joda.files import check_target, make_folder, write_bytes, write_together
from joda.measured.reading import read_measured
from joda.plain import plain
from joda.profile import Profile
from joda.scenes.attaching import attach
from joda.scenes.context import context
from joda.scenes.model import describe_joint, find_joint, joint_name, joint_type, load_model
from joda.scenes.native import whole_profile
from joda.scenes.scene import profiles_of

LONGEST_NAME = 100
"""Letters of a name under which a file that is handed over is kept."""


class StudioSession:
    """A joint of a scene at work.

    Attributes:
        folder: of the project.
        scene: the file that was opened.
        model: compiled from it.
        number: the joint's id there.
        joint: its name or address.
        context: of the joint, as opened.
        opened: its profile, as opened.
        timeline: its profile, and those before and after.
        runs: the measured ones.
        passive: whether the actuators on the joint were off meanwhile.
        kept: the profiles that are in files: as opened, and those that were saved.
    """

    def __init__(
        self,
        scene: Path,
        joint: str | None = None,
        folder: Path | None = None,
        passive: bool = False,
    ) -> None:
        """Opens a scene.

        Args:
            scene: MJCF or URDF.
            joint: name or address; None: the one that carries a profile, or that is the only one.
            folder: of the project; None: the scene's.
            passive: whether the actuators on the joint were off while it was measured.

        Raises:
            JodaError: the file lies outside the folder or cannot be loaded, or which joint is meant
                is not clear.
        """
        self.folder = Folder(folder or scene.parent)
        self.scene = self.folder.inside(scene.absolute())
        self.model = load_model(scene)
        carried = profiles_of(self.model)
        self.number = find_joint(self.model, joint or self._only(list(carried)))
        self.joint = joint_name(self.model, self.number)
        self.context = context(self.scene, self.joint)
        bare = Profile(joint=describe_joint(self.model, self.number))
        own = carried.get(self.joint, bare)
        self.opened = whole_profile(self.model, self.number, own)
        self.timeline = Timeline(self.opened)
        self.kept = [self.opened]
        self.runs: tuple[Path, ...] = ()
        self.passive = passive
        self._dragged: Profile | None = None
        self._scratch = tempfile.TemporaryDirectory(prefix="joda_studio_")
        self._written: tuple[Profile, Path] | None = None
        self._writing, self._numbers = Lock(), count(1)

    def _only(self, carrying: list[str]) -> str:
        """The joint that is meant if none is named; raises JodaError."""
        limits = self.model.jnt_range
        able = [
            joint_name(self.model, k)
            for k in range(self.model.njnt)
            if joint_type(self.model, k) in ("hinge", "slide") and limits[k, 0] < limits[k, 1]
        ]
        for names in (carrying, able):
            if len(names) == 1:
                return names[0]
        listed = ", ".join(f"'{name}'" for name in carrying or able) or "none with a range"
        raise JodaError(f"{self.scene.name}: choose a joint with --joint; there are {listed}.")

    @property
    def profile(self) -> Profile:
        """As it is shown: while a control point is dragged, with the point where it is."""
        return self._dragged or self.timeline.present

    @property
    def unsaved(self) -> bool:
        """Whether closing the studio would lose something."""
        return self.timeline.present not in self.kept

    def drag(self, handle: edits.Handle, s: float, y: float, done: bool) -> None:
        """Moves a control point; one drag is one step of undo, made when it is done."""
        moved = edits.moved(self.timeline.present, handle, s, y)
        self._dragged = None if done else moved
        if done:
            self.edit(moved)

    def edit(self, profile: Profile) -> None:
        """Makes this the profile; the one before can be brought back."""
        self._dragged = None
        self.timeline = self.timeline.then(profile)

    def undo(self) -> None:
        """Brings back the profile before."""
        self._dragged = None
        self.timeline = self.timeline.undo()

    def redo(self) -> None:
        """Brings back what was undone."""
        self._dragged = None
        self.timeline = self.timeline.redo()

    def scratch(self, name: str) -> Path:
        """A file for the time of this session, outside the project."""
        return Path(self._scratch.name) / name

    def written(self, profile: Profile) -> Path:
        """A scene with the profile, as it would be saved; the opened one if that carries it."""
        with self._writing:
            if profile == self.opened:
                return self.scene
            if self._written is None or self._written[0] != profile:
                path = self.scratch(f"scene_{next(self._numbers)}.xml")
                attach(self.scene, profile, path, joint=self.joint)
                self._written = profile, path
            return self._written[1]

    def add_run(self, name: str | Path) -> None:
        """Adds a measured run of the project; raises JodaError if it is none, or lies outside."""
        self._take(self.folder.inside(name))

    def upload(self, name: str, content: bytes) -> None:
        """Adds a run that was handed over as a file's content; raises JodaError if it is none."""
        own = plain(Path(name.replace("\\", "/")).name).strip(".")[-LONGEST_NAME:]
        path = self.scratch("runs") / (own or "run.csv")
        if path in self.runs:
            raise JodaError(f"{path.name}: is there already; give it another name.")
        make_folder(path.parent)
        write_bytes(path, content)
        try:
            self._take(path)
        except JodaError as error:
            raise JodaError(str(error).replace(str(path), path.name)) from None

    def _take(self, path: Path) -> None:
        if path in self.runs:
            raise JodaError(f"{path.name}: is there already.")
        read_measured(self.scene, self.joint, [path], self.passive)
        self.runs = (*self.runs, path)

    def drop_run(self, path: Path) -> None:
        """Takes a run away again."""
        self.runs = tuple(run for run in self.runs if run != path)

    def taken(self, name: str) -> bool:
        """Whether saving under that name would replace something; raises JodaError as `save`."""
        return any(path.exists() for path in self._targets(name))

    def _targets(self, name: str) -> tuple[Path, Path]:
        """The scene's and the profile's file."""
        scene = self.folder.inside(name)
        if scene.suffix != ".xml":
            raise JodaError(f"{name}: must end in .xml.")
        if scene == self.scene:
            raise JodaError(f"{name}: is the scene at work, which stays as it is; choose another.")
        return scene, self.folder.inside(scene.with_suffix(".composed.json"))

    def save(self, name: str, force: bool = False) -> list[str]:
        """Writes the scene with the profile, and the profile beside it, as `joda add` does.

        Args:
            name: of the scene, in the project's folder; ends in .xml. The profile goes beside it,
                to NAME.composed.json.
            force: overwrite them.

        Returns:
            what was done, a sentence each.

        Raises:
            JodaError: the name lies outside the folder, is that of the opened scene or exists, or
                cannot be written.
        """
        scene, composed = self._targets(name)
        for path in (scene, composed):
            check_target(path, force)
        profile = self.timeline.present
        files, notes = scene_files(self.scene, profile, scene, composed)
        write_together(files)
        self.kept.append(profile)
        return notes

    def close(self) -> None:
        """Removes what was written for the time of the session."""
        self._scratch.cleanup()
