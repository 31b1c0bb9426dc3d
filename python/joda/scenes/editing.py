"""A scene's text that is being given profiles: edited joint by joint, then put together."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import mujoco
import numpy as np

from joda.effects import EndStopRestitution
from joda.errors import JodaError
from joda.field import evaluate
from joda.plugin import PLUGIN
from joda.profile import ATTRIBUTES, Profile
from joda.scenes.actuators import Servo, redriven
from joda.scenes.engine import is_discrete, polynomial
from joda.scenes.limits import Stops, firm_limit, limit_parameters, second_stop
from joda.scenes.mass_attributes import MIN_SHARE, Heavier, gravcomp, inertial, moved_bodies
from joda.scenes.mjcf import Element, MjcfError, Source, quoted
from joda.scenes.model import joint_name, joint_type, write_out
from joda.scenes.scene import (
    DAMPING_ROW,
    INERT,
    TRACE,
    damping_equality,
    find_instance,
    prefix,
    profiles_of,
)

STOP = "joda_stop_"
"""Begins the name of the tendon that is a second stop at one end of a joint's range."""
DAMP_RATIO = {"weak": 0.5, "medium": 0.25, "strong": 0.1}
"""Damping ratio of the joint's limit, by the elasticity that the joint-limit hint asks for."""


@dataclass
class Instance:
    """A plugin instance to be written: that of the body of `joint`."""

    joint: int
    existing: str  # its name if it stands in <extension> already, else empty
    config: dict[str, str]


OF_SHORTCUTS = ("kp", "kv", "dampratio", "inheritrange", *("gaintype", "biastype", "dyntype"))
"""What <position>, <velocity> and <general> elements may have that is written anew."""


class EditedScene:
    """A model's text that is being given profiles.

    Attributes:
        notes: what was done, one sentence each.
        heavier: whether a joint gets more or less inertia.
    """

    def __init__(
        self, path: Path, spec: mujoco.MjSpec, model: mujoco.MjModel, targets: list[int]
    ) -> None:
        """Args: the file; its compiled spec and model; the joints that get profiles, by id."""
        self.spec, self.model = spec, model
        self.notes: list[str] = []
        self.heavier = False
        self.source, self.joints = self._open(path, targets)
        self.instances: dict[int, Instance] = {}  # by body
        self.rows: list[str] = []  # equalities to add
        self.tendons: list[str] = []
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
        try:
            source = Source(path, write_out(self.spec, path))
        except MjcfError as error:  # a name with characters that XML has not
            raise JodaError(f"{error}: a name in it is not XML; give it another one.") from None
        return source, dict(enumerate(source.joints()))

    def add(
        self,
        joint: int,
        profile: Profile,
        native: str,
        also: Mapping[str, str],
        heavier: Heavier | None = None,
        stops: Stops | None = None,
    ) -> None:
        """Edits the text for one joint.

        Args:
            joint: its id.
            profile, native, also: see `joda.scenes.attaching.attach`.
            heavier: what it moves is so much so.
            stops: other ends of its range.
        """
        kind = joint_type(self.model, joint)
        if kind != profile.joint.type:
            raise JodaError(
                f"joint '{joint_name(self.model, joint)}' is a {kind} and the profile is for a "
                f"{profile.joint.type}; set joint.type, joint.unit and joint.range of the profile."
            )
        self._compare_range(joint, profile)
        changes = self._native(joint, native)
        changes |= self._limit(joint, profile)
        if "solimplimit" not in changes:
            changes |= self._bearing(joint, profile, changes)
        changes |= self._inertia(joint, profile, heavier.inertia if heavier else 1.0)
        if is_discrete(self.model):
            changes |= self._discrete(joint)
        if not self.names[joint]:
            changes["name"] = self._new_name(joint)
            self._note(joint, f"had no name and is now '{changes['name']}'")
            self.names[joint] = changes["name"]
        changes |= self._stops(joint, stops) if stops else {}
        self.joints[joint][1].set(**{**changes, **also})
        self._configure(joint, profile)
        if damping_equality(self.model, joint) < 0:
            row, name = quoted(DAMPING_ROW + self.names[joint]), quoted(self.names[joint])
            self.rows.append(f"<joint name={row} joint1={name} {INERT}/>")

    def drive(self, joint: int, servo: Servo) -> None:
        """Gives the actuators on a joint another gain and delay."""
        written = [
            element
            for section in self.source.root.children
            if section.tag == "actuator"
            for element in section.children
        ]
        if len(written) != self.model.nu:
            raise JodaError(
                f"{self.source.main.path}: the actuator of joint "
                f"'{joint_name(self.model, joint)}' is not written there, and cannot be changed."
            )
        for k, values in redriven(self.model, joint, servo).items():
            kept = {a: x for a, x in written[k].attributes.items() if a not in OF_SHORTCUTS}
            text = " ".join(f"{a}={quoted(x)}" for a, x in {**kept, **values}.items())
            written[k].replace(f"<general {text}/>")
            told = f"gainprm {values['gainprm']}, biasprm {values['biasprm']}"
            told += f", delay {values['delay']} s" if "delay" in values else ""
            self._note(joint, f"has its actuator as <general> with {told}")

    def weigh(self, joint: int, heavier: Heavier) -> None:
        """Makes what a joint moves heavier, all of its bodies by the same factors."""
        ids = moved_bodies(self.model, joint)
        bodies = [one for one in self.joints[joint][0].walk() if one.tag == "body"]
        if len(bodies) != len(ids):
            raise JodaError(
                f"{self.source.main.path}: the bodies that joint "
                f"'{joint_name(self.model, joint)}' moves are not all written there, and their "
                "masses cannot be changed."
            )
        for body, element in zip(ids, bodies, strict=True):
            if self.model.body_mass[body] <= 0:
                continue
            values = inertial(self.model, joint, body, heavier)
            text = f"<inertial {' '.join(f'{a}={quoted(x)}' for a, x in values.items())}/>"
            own = next((one for one in element.children if one.tag == "inertial"), None)
            if own:
                own.replace(text)
            else:
                element.insert_first(text)
            if carried := gravcomp(self.model, body, heavier):
                element.set(gravcomp=carried)
        self.heavier = True
        told = f"moves masses and inertias {heavier.inertia:.3g} times as large as before"
        if heavier.lifted > MIN_SHARE:
            told += f", of whose weight gravcomp takes {heavier.lifted:.3g}"
        elif heavier.lifted < -MIN_SHARE:
            told += (
                f"; that gravity pulls {heavier.gravity:.3g} times as much MJCF cannot say, and is "
                "left out"
            )
        self._note(joint, told)

    def finish(self, folder: Path) -> bytes:
        """The text with the plugin's instances in it, for a file that will lie in `folder`."""
        declared = {
            e.attributes.get("name"): e for e in self.source.root.walk() if e.tag == "instance"
        }
        fresh = []
        for instance in self.instances.values():
            name = instance.existing or f"joda_{self.names[instance.joint]}"
            keys = "".join(
                f"\n  <config key={quoted(key)} value={quoted(value)}/>"
                for key, value in instance.config.items()
            )
            text = f"<instance name={quoted(name)}>{keys}\n</instance>"
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
        if self.tendons:
            lines = "\n".join(self.tendons).replace("\n", "\n  ")
            self.source.root.insert_last(f"<tendon>\n  {lines}\n</tendon>")
        self.source.relocate(folder)
        return self.source.render()

    def _configure(self, joint: int, profile: Profile) -> None:
        """Puts the profile into the instance of the joint's body."""
        body = int(self.model.jnt_bodyid[joint])
        if body not in self.instances:
            found = find_instance(self.model, body)
            if found is None and self.model.body_plugin[body] >= 0:
                raise JodaError(
                    f"the body of joint '{joint_name(self.model, joint)}' carries another plugin "
                    "already, and MuJoCo allows one per body; remove it or put it elsewhere."
                )
            self.instances[body] = Instance(joint, *(found or ("", {})))
        config = self.instances[body].config
        front = prefix(self.model, joint)
        if [key for key in ATTRIBUTES if config.pop(front + key, None)]:
            self._note(joint, "carried a profile already, which the new one replaces")
        config |= {front + key: text for key, text in profile.attributes().items()}

    def _refer(self, joint: int, name: str) -> None:
        """Puts the reference to the instance into the joint's body."""
        body, element = self.joints[joint]
        reference = f"<plugin instance={quoted(name)}/>"
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
            "damping": polynomial(m, "dof_damping", dof),
            "stiffness": polynomial(m, "jnt_stiffness", joint),
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
        """A restitution of both ends, or else the joint-limit hint: its damping ratio.

        An end with a restitution of its own has it from the plugin.
        """
        hint = profile.joint_limit_hint
        limited = self.model.jnt_limited[joint]
        for effect in profile.effects:
            if isinstance(effect, EndStopRestitution):
                if not limited:
                    self._note(joint, "has no limits, so end_stop_restitution does nothing")
                    return {}
                if effect.end == "both":
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

    def _bearing(self, joint: int, profile: Profile, changes: Mapping[str, str]) -> dict[str, str]:
        """Limits that bear the profile's force at the ends, where the model's would yield."""
        m = self.model
        if not m.jnt_limited[joint]:
            return {}
        low, high = evaluate(profile.channels.conservative, np.array([0.0, 1.0]))[0]
        own = {e.end for e in profile.effects if isinstance(e, EndStopRestitution)}
        against = {"low": -low, "high": high}
        force = max([0.0, *(push for end, push in against.items() if end not in own)])
        pressed = force * float(m.dof_invweight0[m.jnt_dofadr[joint]])
        solref = [float(x) for x in changes.get("solreflimit", "").split()] or m.jnt_solref[joint]
        span = profile.joint.range[1] - profile.joint.range[0]
        firm = firm_limit(pressed, span, solref, m.jnt_solimp[joint], float(m.opt.timestep))
        if firm is None:
            return {}
        self._note(joint, "has firmer limits now, to bear the force with which the profile presses")
        return dict(zip(("solreflimit", "solimplimit"), firm, strict=True))

    def _stops(self, joint: int, stops: Stops) -> dict[str, str]:
        """Ends of the range as they are given; what one has besides is a tendon."""
        if stops.second and stops.second != second_stop(self.model, joint):
            name = STOP + self.names[joint]
            span = float(self.model.jnt_range[joint, 0]), float(self.model.jnt_range[joint, 1])
            self.tendons.append(stops.second.element(name, self.names[joint], span))
        values = {"solreflimit": stops.solref, "solimplimit": stops.solimp}
        return {name: " ".join(f"{x:.6g}" for x in numbers) for name, numbers in values.items()}

    def _inertia(self, joint: int, profile: Profile, factor: float) -> dict[str, str]:
        """The armature with the profile's added inertia, without that of the one it replaces;
        `factor`: of what is left."""
        name = joint_name(self.model, joint)
        replaced = profiles_of(self.model).get(name)
        before, after = replaced.added_inertia if replaced else 0.0, profile.added_inertia
        own = float(self.model.dof_armature[self.model.jnt_dofadr[joint]])
        left = factor * max(own - before, 0.0)
        if before == after and factor == 1:
            return {}
        self.heavier = True
        return {"armature": f"{left + after:.9g}"}

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
        if base not in self.names:
            return base
        return next(name for k in count() if (name := f"{base}{k}") not in self.names)
