"""NEW.corrections.json: what a measurement has wrong, beside the scene that has all else right."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from joda.errors import JodaError
from joda.files import named_like, read_json
from joda.measured.sensing import RIGHT, Sensing

ENDING = ".corrections.json"
Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class SensedJoint(BaseModel):
    """What the measurement of a joint has wrong; what is not named is right."""

    model_config = ConfigDict(extra="forbid")

    force_scale: Positive = Field(1.0, description="true force over logged force")
    force_offset: Finite = Field(0.0, description="true less scaled logged force, N·m or N")
    time_delay: Finite = Field(
        0.0, description="what is logged as force or command acts that much later, s"
    )
    position_offset: Finite = Field(0.0, description="logged position minus true, rad or m")
    actuator_gain: Positive = Field(1.0, description="true gain of the actuators over the model's")


class Corrections(BaseModel):
    """What the measurements of joints have wrong, by the joints' names."""

    model_config = ConfigDict(extra="forbid")

    schema_version: Literal[1] = 1
    joints: dict[str, SensedJoint]


def corrections_beside(scene: Path) -> Path:
    """The file of a scene."""
    return named_like(scene, ENDING)


def corrections_text(joints: dict[str, Sensing]) -> str:
    """What such a file holds."""
    found = Corrections(joints={name: SensedJoint(**asdict(one)) for name, one in joints.items()})
    return json.dumps(found.model_dump(), indent=2, ensure_ascii=False) + "\n"


def read_corrections(path: str | Path) -> dict[str, Sensing]:
    """What is wrong by joint; raises JodaError where a file is no such one."""
    try:
        found = Corrections.model_validate_json(read_json(Path(path)))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"])) or "the file"
        raise JodaError(f"{path}: {place}: {first['msg']}.") from None
    return {name: Sensing(**one.model_dump()) for name, one in found.joints.items()}


def sensing_of(path: str | Path | None, joint: str) -> Sensing:
    """What the measurement of a joint has wrong; raises JodaError where a file has not the joint.

    `path`: of the file; None: nothing is wrong.
    """
    if path is None:
        return RIGHT
    found = read_corrections(path)
    if joint not in found:
        names = ", ".join(f"'{name}'" for name in found) or "none"
        raise JodaError(f"{path}: has no joint '{joint}'; it has {names}.")
    return found[joint]
