"""Writes profiles into an existing scene: the file stays as it is, but for what the plugin needs.

Per joint that is: a named plugin instance with the profile's numbers, a reference to it in the body
that the joint moves, a trace of `frictionloss` (it makes the solver row that carries the dry
friction), and an equality
constraint on the joint, inert by itself (the plugin makes its row the damping).
"""

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Literal
from xml.sax.saxutils import quoteattr

import mujoco

from joda.errors import JodaError
from joda.files import check_target, write_bytes
from joda.mjcf import Element, MjcfError, Source
from joda.model import find_joint, joint_name, joint_type, load_model, load_spec, sentence
from joda.plugin import PLUGIN
from joda.profile import ATTRIBUTES, Profile
from joda.scene import plugin_name, prefix

TRACE = "1e-12"
"""A frictionloss (N or N·m) that makes a solver row and is otherwise nothing."""

INERT = 'solref="-1e-12 -1e-12" solimp="1e-4 1e-4"'
"""Makes an equality constraint that does nothing until the plugin sets its row."""

DAMP_RATIO = {"weak": 0.5, "medium": 0.25, "strong": 0.1}
"""Damping ratio of the joint's limit, by the elasticity that the joint-limit hint asks for."""


def attach(
    model: str | Path,
    profiles: str | Path | Profile | Sequence[str | Path | Profile],
    output: str | Path,
    *,
    joint: str | None = None,
    native: Literal["replace", "keep"] = "replace",
    force: bool = False,
) -> list[str]:
    """Writes a scene in which joints behave as their profiles say.

    Args:
        model: MJCF or URDF file. All that is not named below stays byte for byte; URDF, and joints
            that MuJoCo generates (replicate, attach), are first written out by MuJoCo.
        profiles: one or several profiles, or their `composed.json` files. A joint that carries one
            already gets the new one in its place.
        output: the scene to write. File references are adapted if its folder is another.
        joint: which joint gets the (only) profile, where that is not the profile's `joint.name`;
            see `joda.model.find_joint` for joints without a name.
        native: "replace" sets the joint's own damping, stiffness and frictionloss to zero; "keep"
            lets them act besides the profile.
        force: overwrite `output`.

    Returns:
        What was done, one sentence each.

    Raises:
        JodaError: a file cannot be read or written, a joint does not exist or does not fit.
    """
    model, output = Path(model), Path(output)
    items = [profiles] if isinstance(profiles, str | Path | Profile) else list(profiles)
    loaded = [item if isinstance(item, Profile) else Profile.read(item) for item in items]
    if joint is not None and len(loaded) != 1:
        raise JodaError("--joint goes with exactly one profile; each profile names its own joint.")
    check_target(output, force)
    compiled = load_model(model)
    targets = [find_joint(compiled, joint or profile.joint.name) for profile in loaded]
    for target in targets:
        if targets.count(target) > 1:
            raise JodaError(f"joint '{joint_name(compiled, target)}' is given two profiles.")

    scene = _Scene(model, compiled)
    for target, profile in zip(targets, loaded, strict=True):
        scene.add(target, profile, native)
    scene.source.relocate(output.parent)
    content = scene.finish()
    _verify(output, content, compiled)
    write_bytes(output, content)
    return scene.notes


class _Scene:
    """A model's text that is being given profiles."""

    def __init__(self, path: Path, model: mujoco.MjModel) -> None:
        self.model = model
        self.notes: list[str] = []
        self.spec = load_spec(path)
        self.source, self.joints = self._open(path)
        self.configs: dict[int, dict[str, str]] = {}  # body: attributes of its instance
        self.names: dict[int, str] = {}  # joint: name given to it here

    def _open(self, path: Path) -> tuple[Source, list[tuple[Element, Element]]]:
        """The text to edit, and its (body, joint) elements by joint id."""
        names = [self.model.joint(k).name for k in range(self.model.njnt)]
        try:
            source = Source(path)
            joints = source.joints()
            if [element.attributes.get("name", "") for _, element in joints] == names:
                return source, joints
            reason = "some of its joints are not in the text"
        except MjcfError as error:
            reason = str(error)
        self.notes.append(f"{path} was written out by MuJoCo first, as {reason}.")
        self.spec.compile()
        source = Source(path, self.spec.to_xml().encode())
        return source, source.joints()

    def add(self, joint: int, profile: Profile, native: str) -> None:
        """Edits the text for one joint."""
        label = f"joint '{joint_name(self.model, joint)}'"
        kind = joint_type(self.model, joint)
        if kind != profile.joint.type:
            raise JodaError(
                f"{label} is a {kind} and the profile is for a {profile.joint.type}; "
                "set joint.type, joint.unit and joint.range of the profile."
            )
        self._compare_range(joint, profile)
        changes = self._native(joint, native)
        changes |= self._limit(joint, profile)
        if not self.model.joint(joint).name:
            self.names[joint] = changes["name"] = self._new_name(joint)
            self.notes.append(f"{label} had no name and is now '{changes['name']}'.")
        if changes:
            self.joints[joint][1].set(**changes)
        body = int(self.model.jnt_bodyid[joint])
        config = self.configs.setdefault(body, self._config(body, joint))
        front = prefix(self.model, joint)
        for key in ATTRIBUTES:
            if config.pop(front + key, None) and key == "range":
                self.notes.append(f"{label} carried a profile already; the new one replaces it.")
        config |= {front + key: text for key, text in profile.attributes().items()}
        own_name = self.names.get(joint, self.model.joint(joint).name)
        row = f"joda_damping_{own_name}"
        if self.spec.equality(row) is None:
            self.source.root.insert_last(
                f"<equality>\n  <joint name={quoteattr(row)} joint1={quoteattr(own_name)} "
                f"{INERT}/>\n</equality>"
            )

    def finish(self) -> bytes:
        """The text, with the plugin's instances in it."""
        declared = {
            element.attributes.get("name"): element
            for element in self.source.root.walk()
            if element.tag == "instance"
        }
        fresh = []
        for body, config in self.configs.items():
            existing = plugin_name(self.model, body)
            first = next(k for k in range(self.model.njnt) if self.model.jnt_bodyid[k] == body)
            name = existing or f"joda_{self.names.get(first, self.model.joint(first).name)}"
            keys = "".join(
                f"\n  <config key={quoteattr(key)} value={quoteattr(value)}/>"
                for key, value in config.items()
            )
            text = f"<instance name={quoteattr(name)}>{keys}\n</instance>"
            if existing:
                indent = declared[existing]._indent()
                declared[existing].replace(text.replace("\n", "\n" + indent))
            else:
                fresh.append(text.replace("\n", "\n    "))
                self._refer(first, name)
        if fresh:
            self.source.root.insert_first(
                f'<extension>\n  <plugin plugin="{PLUGIN}">\n    '
                + "\n    ".join(fresh)
                + "\n  </plugin>\n</extension>"
            )
        return self.source.render()

    def _refer(self, joint: int, name: str) -> None:
        """Puts the reference to the instance into the joint's body."""
        body, element = self.joints[joint]
        reference = f"<plugin instance={quoteattr(name)}/>"
        if element in body.own:
            element.insert_after(reference)
        else:
            body.insert_first(reference)

    def _config(self, body: int, joint: int) -> dict[str, str]:
        """The attributes that the body's instance has now."""
        name = plugin_name(self.model, body)
        if name is None:
            return {}
        for plugin in self.spec.plugins:
            if plugin.name == name and plugin.plugin_name == PLUGIN:
                return {key: value for key, value in plugin.config.items() if value}
        raise JodaError(
            f"the body of joint '{joint_name(self.model, joint)}' carries another plugin already, "
            "and MuJoCo allows one per body; remove it or put it elsewhere."
        )

    def _compare_range(self, joint: int, profile: Profile) -> None:
        own, given = tuple(map(float, self.model.jnt_range[joint])), profile.joint.range
        span = given[1] - given[0]
        if max(abs(a - b) for a, b in zip(own, given, strict=True)) > 1e-3 * span:
            text = f"{own[0]:g} to {own[1]:g}" if own[0] < own[1] else "not set"
            self.notes.append(
                f"joint '{joint_name(self.model, joint)}': the model's range is {text}, the "
                f"profile's {given[0]:g} to {given[1]:g} {profile.joint.unit}; the profile keeps its own."
            )

    def _native(self, joint: int, native: str) -> dict[str, str]:
        """What becomes of the joint's own damping, stiffness and frictionloss."""
        dof = self.model.jnt_dofadr[joint]
        values = {
            "damping": [self.model.dof_damping[dof], *self.model.dof_dampingpoly[dof]],
            "stiffness": [self.model.jnt_stiffness[joint], *self.model.jnt_stiffnesspoly[joint]],
            "frictionloss": [self.model.dof_frictionloss[dof]],
        }
        present = {name: v[0] for name, v in values.items() if any(v) and v[0] != float(TRACE)}
        changes = {}
        if native == "replace":
            changes = {name: "0 0 0" if any(values[name][1:]) else "0" for name in present}
        if native == "replace" or "frictionloss" not in present:
            changes["frictionloss"] = TRACE
        if present:
            listed = ", ".join(f"{name} {value:g}" for name, value in present.items())
            what = "replaced by the profile" if native == "replace" else "kept besides the profile"
            self.notes.append(
                f"joint '{joint_name(self.model, joint)}': native {listed} {what} (--native {native})."
            )
        return changes

    def _limit(self, joint: int, profile: Profile) -> dict[str, str]:
        """The joint-limit hint as the limit's damping ratio."""
        hint = profile.joint_limit_hint
        if hint.selected_side == "none" or hint.elasticity == "none":
            return {}
        time = self.model.jnt_solref[joint][0]
        ratio = DAMP_RATIO[hint.elasticity]
        self.notes.append(
            f"joint '{joint_name(self.model, joint)}': damping ratio of the limits {ratio:g} "
            f"({hint.elasticity} elasticity; MuJoCo has one value for both ends)."
        )
        return {"solreflimit": f"{time if time > 0 else 0.02:g} {ratio:g}"}

    def _new_name(self, joint: int) -> str:
        body = self.model.body(self.model.jnt_bodyid[joint]).name or "unnamed"
        taken = {self.model.joint(k).name for k in range(self.model.njnt)}
        base = re.sub(r"\W+", "_", f"{body}_joint")
        return next(n for n in (base, *(f"{base}{k}" for k in range(10**6))) if n not in taken)


def _verify(output: Path, content: bytes, before: mujoco.MjModel) -> None:
    """Compiles the scene where it will lie; raises JodaError if it is not the model it was."""
    trial = output.with_name(f".{output.stem}.{os.getpid()}.xml")
    write_bytes(trial, content)
    try:
        after = mujoco.MjModel.from_xml_path(str(trial))
        mujoco.MjData(after)
    except (ValueError, mujoco.FatalError) as error:
        raise JodaError(f"{output}: the scene would not load: {sentence(error)}") from None
    finally:
        trial.unlink(missing_ok=True)
    same = before.nq == after.nq and (before.jnt_axis == after.jnt_axis).all()
    if not same or (before.nbody, before.ngeom) != (after.nbody, after.ngeom):
        raise JodaError(f"{output}: MuJoCo writes this model out as another one; attach cannot help.")
