"""One joint with a profile, as small as MuJoCo allows: the physics tests' common ground."""

from operator import attrgetter
from pathlib import Path

import mujoco
import numpy as np
import pytest

from joda.scenes.scene import INERT

SOLVERS = ("Newton", "CG", "PGS")
EULER_LIKE = ("Euler", "implicit", "implicitfast")


def has(name: str) -> bool:
    """Whether this MuJoCo has the function, constant or module."""
    try:
        attrgetter(name)(mujoco)
    except AttributeError:
        return (Path(mujoco.__file__).parent / f"{name}.py").is_file()
    return True


def needs(*names: str) -> pytest.MarkDecorator:
    """Skips a test where MuJoCo lacks one of them."""
    missing = [name for name in names if not has(name)]
    return pytest.mark.skipif(
        bool(missing), reason=f"MuJoCo {mujoco.__version__} has no {' and no '.join(missing)}"
    )


DISCRETE = "mjtIntegrator.mjINT_DISCRETE"
SPRING = "mjtDisableBit.mjDSBL_SPRING"
"""Before it there is one flag for springs and dampers."""
SLEEP = "mjtEnableBit.mjENBL_SLEEP"


def flat(value: float, a: float = 0, b: float = 1) -> str:
    """A component that is constant on [a, b]."""
    return f"{a!r} {b!r} | 0 1 | {float(value)!r} {float(value)!r}"


def component(interval, x, y, label="") -> str:
    """A component as in the plugin's attributes."""
    numbers = (" ".join(repr(float(v)) for v in part) for part in (interval, x, y))
    return (f"{label}: " if label else "") + " | ".join(numbers)


def scene(
    conservative: str = "",
    friction: str = "",
    damping: str = "",
    *,
    kind: str = "slide",
    inertia: float = 1.0,
    limits: tuple[float, float] = (0.0, 1.0),
    h: float = 0.002,
    integrator: str = "Euler",
    solver: str = "Newton",
    joint: str = 'frictionloss="1e-12"',
    option: str = 'tolerance="1e-12"',
    flag: str = "",
    equality: bool = True,
    extra: str = "",
    effects: str = "",
) -> str:
    """MJCF of a slide (mass) or hinge (inertia) along x, without gravity."""
    keys = {"conservative": conservative, "friction": friction, "damping": damping}
    keys |= {"effects": effects}
    config = "".join(f'<config key="{k}" value="{v}"/>' for k, v in keys.items() if v)
    i = repr(inertia)
    body = f'<inertial pos="0 0 0" mass="{i}" diaginertia="{i} {i} {i}"/>'
    row = f'<equality><joint name="joda_damping_j" joint1="j" {INERT}/></equality>'
    return f"""
    <mujoco>
      <compiler angle="radian" boundmass="0" boundinertia="0"/>
      <option timestep="{h!r}" integrator="{integrator}" solver="{solver}" gravity="0 0 0" {option}>
        <flag {flag}/>
      </option>
      <extension><plugin plugin="joda.joint_dynamics"><instance name="p">
        <config key="range" value="{limits[0]!r} {limits[1]!r}"/>{config}
      </instance></plugin></extension>
      <worldbody>
        <body name="b">{body}
          <joint name="j" type="{kind}" axis="1 0 0" range="{limits[0]!r} {limits[1]!r}" {joint}/>
          <plugin instance="p"/>
        </body>
      </worldbody>
      {row if equality else ""}
      {extra}
    </mujoco>"""


def load(*args, **kwargs) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The scene's model and data, with the joint in the middle of its range."""
    model = mujoco.MjModel.from_xml_string(scene(*args, **kwargs))
    data = mujoco.MjData(model)
    data.qpos[0] = np.mean(model.jnt_range[0])
    return model, data


def run(model: mujoco.MjModel, data: mujoco.MjData, seconds: float) -> None:
    """Steps for so long."""
    mujoco.mj_step(model, data, round(seconds / model.opt.timestep))


def warnings(data: mujoco.MjData) -> int:
    """How many warnings the engine has counted."""
    return sum(int(warning.number) for warning in data.warning)
