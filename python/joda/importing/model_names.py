"""The names of a model, and how a log may spell them."""

import mujoco

from joda.errors import JodaError
from joda.importing.log import listed
from joda.importing.names import normal
from joda.scenes.actuators import acting_on
from joda.scenes.model import joint_name, joint_type


class Names:
    """The hinges, slides and actuators of a model by their names, and how a log may spell them."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """Takes the compiled model."""
        self.model = model
        scalar = [k for k in range(model.njnt) if joint_type(model, k) in ("hinge", "slide")]
        self.joints = {joint_name(model, k): k for k in scalar}
        self.actuators = {model.actuator(k).name: k for k in range(model.nu)}
        self.actuators.pop("", None)
        self.driven = {k: acting_on(model, k) for k in scalar}
        self.aliases: dict[str, int] = {}

    def joint(self, spelt: str) -> int | None:
        """The joint of a name, or of one spelled alike; raises JodaError if that may be several."""
        if spelt in self.joints:
            return self.joints[spelt]
        if (alias := self.aliases.get(normal(spelt))) is not None:
            return alias
        found = [name for name in self.joints if normal(name) == normal(spelt)]
        if len(found) > 1:
            raise JodaError(
                f"'{spelt}' may be any of the joints {listed(found)}; say --column position:JOINT="
                "NAME of the column."
            )
        return self.joints[found[0]] if found else None

    def actuator(self, spelt: str) -> int | None:
        """The actuator of a name or one spelled alike, or the only one on such a joint.

        Raises:
            JodaError: it may be several.
        """
        if spelt in self.actuators:
            return self.actuators[spelt]
        found = [name for name in self.actuators if normal(name) == normal(spelt)]
        if not found and (joint := self.joint(spelt)) is not None:
            found = [self.model.actuator(k).name for k in self.driven[joint]]
        if len(found) > 1:
            raise JodaError(
                f"'{spelt}' may be any of the actuators {listed(found)}; say --column "
                "ctrl:ACTUATOR=NAME of the column."
            )
        return self.actuators.get(found[0]) if found else None

    def moved_by(self, actuator: int) -> int:
        """The joint that an actuator alone acts on; -1 if there are none or several."""
        found = [joint for joint, acting in self.driven.items() if actuator in acting]
        return found[0] if len(found) == 1 else -1
