"""Writes profiles into an existing scene: the file stays as it is, but for what the plugin needs.

Per joint that is: a named plugin instance with the profile's numbers, a reference to it in the body
that the joint moves, a trace of `frictionloss` (it makes the solver row that carries the dry
friction), and an equality constraint on the joint, inert by itself (the plugin makes its row the
damping).
"""

import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Literal
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np

from joda.effects import EndStopRestitution
from joda.errors import JodaError
from joda.files import check_target, write_bytes
from joda.limits import limit_parameters
from joda.mjcf import Element, MjcfError, Source
from joda.model import find_joint, joint_name, joint_type, load, sentence, write_out
from joda.plugin import PLUGIN
from joda.profile import ATTRIBUTES, Profile
from joda.scene import (
    DAMPING_ROW,
    INERT,
    TRACE,
    find_instance,
    has_damping_row,
    prefix,
    profiles_of,
)

DAMP_RATIO = {"weak": 0.5, "medium": 0.25, "strong": 0.1}
"""Damping ratio of the joint's limit, by the elasticity that the joint-limit hint asks for."""

SAME = (
    *("nq", "nu", "nbody", "ngeom", "nsensor", "jnt_type", "jnt_axis", "jnt_pos", "jnt_range"),
    *("qpos0", "body_mass", "dof_invweight0", "geom_size", "actuator_gainprm"),
)
"""What of the model must be the same afterwards."""


def attach(
    model: str | Path,
    profiles: str | Path | Profile | Sequence[str | Path | Profile],
    output: str | Path,
    *,
    joint: str | None = None,
    native: Literal["replace", "keep"] = "replace",
    also: Mapping[str, str] = MappingProxyType({}),
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
        also: further MJCF attributes of the joint to set, with the (only) profile.
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
    spec, compiled = load(model)
    targets = [find_joint(compiled, joint or profile.joint.name) for profile in loaded]
    for target in targets:
        if targets.count(target) > 1:
            raise JodaError(f"joint '{joint_name(compiled, target)}' is given two profiles.")

    scene = _Scene(model, spec, compiled, targets)
    for target, profile in zip(targets, loaded, strict=True):
        scene.add(target, profile, native, also)
    content = scene.finish(output.parent)
    _verify(output, content, compiled, scene.heavier or "armature" in also)
    write_bytes(output, content)
    return scene.notes


@dataclass
class _Instance:
    """A plugin instance to be written: that of the body of `joint`."""

    joint: int
    existing: str  # its name if it stands in <extension> already, else empty
    config: dict[str, str]


class _Scene:
    """A model's text that is being given profiles."""

    def __init__(
        self, path: Path, spec: mujoco.MjSpec, model: mujoco.MjModel, targets: list[int]
    ) -> None:
        self.spec, self.model = spec, model
        self.notes: list[str] = []
        self.heavier = False  # whether a joint gets more or less inertia
        self.source, self.joints = self._open(path, targets)
        self.instances: dict[int, _Instance] = {}  # by body
        self.rows: list[str] = []  # equalities to add
        self.names = [model.joint(k).name for k in range(model.njnt)]

    def _open(
        self, path: Path, targets: list[int]
    ) -> tuple[Source, dict[int, tuple[Element, Element]]]:
        """The text to edit, and its (body, joint) elements by joint id."""
        names = [self.model.joint(k).name for k in range(self.model.njnt)]
        try:
            source = Source(path)
            joints = source.joints()
            written = [element.attributes.get("name", "") for _, element in joints]
            found = dict(enumerate(joints))
            if written != names:  # includes what MuJoCo generates
                pairs = zip(written, joints, strict=True)
                found = {names.index(name): pair for name, pair in pairs if name and name in names}
            lacking = [joint_name(self.model, k) for k in targets if k not in found]
            if not lacking:
                return source, found
            reason = f"joint '{lacking[0]}' is not found there by its name"
        except MjcfError as error:
            reason = str(error)
        self.notes.append(
            f"{path} was written out by MuJoCo first, numbers rounded to six digits: {reason}."
        )
        source = Source(path, write_out(self.spec, path))
        return source, dict(enumerate(source.joints()))

    def add(self, joint: int, profile: Profile, native: str, also: Mapping[str, str]) -> None:
        """Edits the text for one joint."""
        kind = joint_type(self.model, joint)
        if kind != profile.joint.type:
            raise JodaError(
                f"joint '{joint_name(self.model, joint)}' is a {kind} and the profile is for a "
                f"{profile.joint.type}; set joint.type, joint.unit and joint.range of the profile."
            )
        self._compare_range(joint, profile)
        changes = self._native(joint, native)
        changes |= self._limit(joint, profile)
        changes |= self._inertia(joint, profile)
        if self.model.opt.integrator == mujoco.mjtIntegrator.mjINT_DISCRETE:
            changes |= self._discrete(joint)
        if not self.names[joint]:
            changes["name"] = self._new_name(joint)
            self._note(joint, f"had no name and is now '{changes['name']}'")
            self.names[joint] = changes["name"]
        self.joints[joint][1].set(**{**changes, **also})
        self._configure(joint, profile)
        if not has_damping_row(self.model, joint):
            row, name = quoteattr(DAMPING_ROW + self.names[joint]), quoteattr(self.names[joint])
            self.rows.append(f"<joint name={row} joint1={name} {INERT}/>")

    def finish(self, folder: Path) -> bytes:
        """The text with the plugin's instances in it, for a file that will lie in `folder`."""
        declared = {
            e.attributes.get("name"): e for e in self.source.root.walk() if e.tag == "instance"
        }
        fresh = []
        for instance in self.instances.values():
            name = instance.existing or f"joda_{self.names[instance.joint]}"
            keys = "".join(
                f"\n  <config key={quoteattr(key)} value={quoteattr(value)}/>"
                for key, value in instance.config.items()
            )
            text = f"<instance name={quoteattr(name)}>{keys}\n</instance>"
            if instance.existing:
                declared[name].replace(text)
            else:
                fresh.append(text)
                self._refer(instance.joint, name)
        if fresh:
            lines = "\n".join(fresh).replace("\n", "\n    ")
            self.source.root.insert_first(
                f'<extension>\n  <plugin plugin="{PLUGIN}">\n    {lines}\n  </plugin>\n</extension>'
            )
        if self.rows:
            lines = "\n  ".join(self.rows)
            self.source.root.insert_last(f"<equality>\n  {lines}\n</equality>")
        self.source.relocate(folder)
        return self.source.render()

    def _configure(self, joint: int, profile: Profile) -> None:
        """Puts the profile into the instance of the joint's body."""
        body = int(self.model.jnt_bodyid[joint])
        if body not in self.instances:
            found = find_instance(self.spec, self.model, body)
            if found is None and self.model.body_plugin[body] >= 0:
                raise JodaError(
                    f"the body of joint '{joint_name(self.model, joint)}' carries another plugin "
                    "already, and MuJoCo allows one per body; remove it or put it elsewhere."
                )
            self.instances[body] = _Instance(joint, *(found or ("", {})))
        config = self.instances[body].config
        front = prefix(self.model, joint)
        if [key for key in ATTRIBUTES if config.pop(front + key, None)]:
            self._note(joint, "carried a profile already, which the new one replaces")
        config |= {front + key: text for key, text in profile.attributes().items()}

    def _refer(self, joint: int, name: str) -> None:
        """Puts the reference to the instance into the joint's body."""
        body, element = self.joints[joint]
        reference = f"<plugin instance={quoteattr(name)}/>"
        inline = next((child for child in body.children if child.tag == "plugin"), None)
        if inline:
            inline.replace(reference)
        elif element in body.own:
            element.insert_after(reference)
        else:
            body.insert_first(reference)

    def _compare_range(self, joint: int, profile: Profile) -> None:
        own, given = tuple(map(float, self.model.jnt_range[joint])), profile.joint.range
        span = given[1] - given[0]
        if max(abs(a - b) for a, b in zip(own, given, strict=True)) > 1e-3 * span:
            text = f"{own[0]:g} to {own[1]:g}" if own[0] < own[1] else "not set"
            self._note(
                joint,
                f"has range {text} in the model and {given[0]:g} to {given[1]:g} "
                f"{profile.joint.unit} in the profile, which keeps its own",
            )

    def _native(self, joint: int, native: str) -> dict[str, str]:
        """What becomes of the joint's own damping, stiffness and frictionloss."""
        m, dof = self.model, self.model.jnt_dofadr[joint]
        values = {
            "damping": [m.dof_damping[dof], *m.dof_dampingpoly[dof]],
            "stiffness": [m.jnt_stiffness[joint], *m.jnt_stiffnesspoly[joint]],
            "frictionloss": [m.dof_frictionloss[dof]],
        }
        present = {name: v for name, v in values.items() if any(v) and v != [float(TRACE)]}
        changes = {}
        if native == "replace":
            changes = {
                name: " ".join("0" for _ in np.trim_zeros(v, "b")) for name, v in present.items()
            }
            # MuJoCo makes stiffness and damping of it
            if any(self.spec.joints[joint].springdamper):
                changes["springdamper"] = "0 0"
        if native == "replace" or "frictionloss" not in present:
            changes["frictionloss"] = TRACE
        if present:
            listed = ", ".join(
                f"{name} {' '.join(f'{x:g}' for x in np.trim_zeros(v, 'b'))}"
                for name, v in present.items()
            )
            what = "replaced by the profile" if native == "replace" else "kept besides the profile"
            self._note(joint, f"has native {listed}, {what} (--native {native})")
        return changes

    def _limit(self, joint: int, profile: Profile) -> dict[str, str]:
        """The joint-limit hint as the limit's damping ratio, its stiffness as it is."""
        hint = profile.joint_limit_hint
        limited = self.model.jnt_limited[joint]
        for effect in profile.effects:
            if isinstance(effect, EndStopRestitution):
                if not limited:
                    self._note(joint, "has no limits, so end_stop_restitution does nothing")
                    return {}
                step = float(self.model.opt.timestep)
                values, impedance = limit_parameters(effect.restitution, step)
                return {"solreflimit": values, "solimplimit": impedance}
        if not limited or hint.selected_side == "none" or hint.elasticity == "none":
            return {}
        ratio = DAMP_RATIO[hint.elasticity]
        first, second = map(float, self.model.jnt_solref[joint])
        if first > 0:  # time constant (at least 2 h), damping ratio: stiffness ~ 1 / product^2
            time = max(first, 2 * self.model.opt.timestep) * second / ratio
            values = f"{time:g} {ratio:g}"
        else:  # -stiffness, -damping
            values = f"{first:g} {-2 * ratio * math.sqrt(-first):g}"
        self._note(
            joint,
            f"has limits of damping ratio {ratio:g} now ({hint.elasticity} elasticity; MuJoCo has "
            "one value for both ends)",
        )
        return {"solreflimit": values}

    def _inertia(self, joint: int, profile: Profile) -> dict[str, str]:
        """The armature with the profile's added inertia, without that of the one it replaces."""
        name = joint_name(self.model, joint)
        replaced = profiles_of(self.spec, self.model).get(name)
        before, after = replaced.added_inertia if replaced else 0.0, profile.added_inertia
        if before == after:
            return {}
        own = float(self.model.dof_armature[self.model.jnt_dofadr[joint]])
        self.heavier = True
        return {"armature": f"{max(own - before, 0.0) + after:.9g}"}

    def _note(self, joint: int, text: str) -> None:
        name = self.names[joint] or joint_name(self.model, joint)
        self.notes.append(f"joint '{name}' {text}.")

    def _discrete(self, joint: int) -> dict[str, str]:
        """MuJoCo's stiffest friction row, under the integrator that leaves the plugin no row."""
        self._note(joint, "gets a stiff friction row of MuJoCo's own, for integrator discrete")
        return {
            "solreffriction": f"0 {-1 / self.model.opt.timestep:g}",
            "solimpfriction": "0.9999 0.9999",
        }

    def _new_name(self, joint: int) -> str:
        body = self.model.body(self.model.jnt_bodyid[joint]).name or "unnamed"
        base = re.sub(r"\W+", "_", f"{body}_joint")
        return next(n for n in (base, *(f"{base}{k}" for k in range(10**6))) if n not in self.names)


def _verify(output: Path, content: bytes, before: mujoco.MjModel, heavier: bool) -> None:
    """Compiles the scene where it will lie; raises JodaError if it is not the model it was.

    `heavier`: joints were given armature.
    """
    trial = output.with_name(f".{output.stem}.{os.getpid()}.xml")
    try:
        trial.write_bytes(content)
        after = mujoco.MjModel.from_xml_path(str(trial))
        mujoco.MjData(after)
    except OSError as error:
        raise JodaError(f"{output}: cannot be written ({error.strerror}).") from None
    except (ValueError, mujoco.FatalError) as error:
        raise JodaError(f"{output}: the scene would not load: {sentence(error)}") from None
    finally:
        trial.unlink(missing_ok=True)
    for name in SAME:
        if name == "dof_invweight0" and heavier:
            continue
        old, new = np.array(getattr(before, name)), np.array(getattr(after, name))
        if old.shape != new.shape or not np.allclose(old, new, rtol=1e-3, atol=1e-6):
            raise JodaError(
                f"{output}: written out by MuJoCo the model is another one ({name}); "
                "attach to the file in which the joint itself is written."
            )
