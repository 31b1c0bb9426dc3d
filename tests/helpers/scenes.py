"""Scenes and profiles that the tests of attach share."""

import re
import struct
from pathlib import Path

import mujoco
import numpy as np
from matplotlib.image import imsave

from joda import attach
from joda.component import Component
from joda.profile import Channel, Channels, Joint, JointLimitHint, Profile, Resistance


def component(label: str, *y: float) -> Component:
    """A curve over the whole range."""
    x = tuple(float(u) for u in np.linspace(0, 1, len(y)))
    return Component(label=label, interval=(0, 1), x=x, y=y)


def profile(
    name="door",
    force=(-0.5, -0.2),
    friction=(0.02, 0.01),
    damping=(0.1, 0.3),
    limits=(0.0, 1.5),
    kind="hinge",
    hint="none",
) -> Profile:
    def channel(cls, label, y):
        return cls(components=(component(label, *y),)) if y else cls()

    return Profile(
        joint=Joint(name=name, type=kind, range=limits, unit="rad" if kind == "hinge" else "m"),
        channels=Channels(
            conservative=channel(Channel, "seal, strong", force),
            friction=channel(Resistance, "hinge", friction),
            damping=channel(Resistance, "closer", damping),
        ),
        joint_limit_hint=JointLimitHint(
            selected_side="none" if hint == "none" else "high_end", elasticity=hint
        ),
    )


LATCH = dict(force=(-0.5, -0.5), friction=None, damping=(0.05, 0.05))
EMPTY = dict(force=None, friction=None, damping=None)

DOOR = """\
<mujoco model="room">
  <compiler angle="radian"/>
  <!-- a door -->
  <worldbody>
    <body name="frame">
      <geom size="1 .1 .1" type="box"/>
      <body name="leaf" pos="0 0 2">
        <joint name="door" axis="0 0 1" range="0 1.5"/>
        <geom type="box" size=".4 .02 .9" pos=".4 0 0" mass="2"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def write(folder: Path, text: str | bytes = DOOR, name="in.xml") -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def attached(folder, text=DOOR, profiles=None, output="out.xml", **options):
    """Input, output and notes of attach; both files in `folder`."""
    before, after = write(folder, text), folder / output
    after.parent.mkdir(parents=True, exist_ok=True)
    return before, after, attach(before, profiles or profile(), after, **options)


def model_of(path: Path) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(path))


def removed(after: bytes) -> bytes:
    """The text without what attach inserts."""
    for pattern in (
        rb'\s*<extension>\s*<plugin plugin="joda.joint_dynamics">.*?</plugin>\s*</extension>',
        rb"""\s*<plugin instance=("joda_[^"]*"|'joda_[^']*')/>""",
        rb"""\s*<equality>\s*<joint name=["']joda_damping_.*?</equality>""",
        rb' frictionloss="1e-12"',
    ):
        after = re.sub(pattern, b"", after, flags=re.DOTALL)
    return after


def differences(before: mujoco.MjModel, after: mujoco.MjModel, tolerance=0.0) -> set[str]:
    """Fields of the model that are not the same, but for names, plugins and equalities."""
    ignored = r"name|plugin|(actuator|sensor)_plugin|eq_|paths|.*pathadr"
    out = set()
    for field in dir(before):
        value = None if field.startswith("_") else getattr(before, field)
        if isinstance(value, np.ndarray) and not re.match(f"({ignored})", field):
            other = getattr(after, field)
            same = value.shape == other.shape and np.allclose(value, other, tolerance, tolerance)
            if not same:
                out.add(field)
    return out


JOINT = '<joint name="door" axis="0 0 1" range="0 1.5"/>'

TWO = DOOR.replace(JOINT, JOINT + '\n        <joint name="lift" type="slide" range="0 0.2"/>')

LIFT = dict(name="lift", kind="slide", limits=(0.0, 0.2))


def swing(m: mujoco.MjModel, position: float, velocity: float, steps: int) -> np.ndarray:
    """Positions of the first joint, a step apart, from that start."""
    d = mujoco.MjData(m)
    d.qpos[0], d.qvel[0] = position, velocity
    positions = []
    for _ in range(steps):
        mujoco.mj_step(m, d)
        positions.append(d.qpos[0])
    return np.array(positions)


UNNAMED = """\
<mujoco>
  <worldbody>
    <body name="top drawer"><joint type="slide" range="0 1.5"/><geom size="1"/></body>
    <body name="pair">
      <joint range="0 1.5" limited="true"/>
      <joint type="slide" range="0 1.5"/>
      <geom size="1"/>
    </body>
    <body><joint type="slide" range="0 1.5"/><geom size="1"/></body>
  </worldbody>
</mujoco>
"""


URDF = """\
<robot name="box">
  <link name="base"/>
  <link name="lid &amp; seal">
    <inertial>
      <mass value="2"/><inertia ixx=".1" iyy=".1" izz=".2" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <joint name="the &lt;lid&gt;" type="revolute">
    <parent link="base"/><child link="lid &amp; seal"/>
    <axis xyz="1 2 3"/><limit lower="0" upper="1.5" effort="1" velocity="1"/>
    <dynamics damping="0.7" friction="0.3"/>
  </joint>
</robot>
"""


TETRAHEDRON = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]


def stl(size: float) -> bytes:
    corners = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], "<f4") * np.float32(size)
    faces = (b"\0" * 12 + corners[list(f)].tobytes() + b"\0\0" for f in TETRAHEDRON)
    return b"\0" * 80 + struct.pack("<I", 4) + b"".join(faces)


def furnished(folder: Path, compiler: str, mesh: str, texture: str) -> Path:
    """DOOR with a mesh, a height field, a texture, an include and an attached model."""
    write(folder, stl(1), f"{mesh}t.stl")
    write(folder, struct.pack("<ii4f", 2, 2, 0, 1, 2, 3), f"{mesh}h.bin")
    (folder / texture).mkdir(parents=True, exist_ok=True)
    imsave(folder / f"{texture}t.png", np.full((2, 2, 3), 0.5))
    write(folder, stl(2), "child/meshes/t.stl")
    write(
        folder,
        '<mujoco><compiler meshdir="meshes"/><asset><mesh name="t" file="t.stl"/></asset>'
        '<worldbody><body name="b"><joint name="j"/><geom type="mesh" mesh="t"/></body></worldbody>'
        "</mujoco>",
        "child/child.xml",
    )
    write(folder, '<mujoco><geom type="mesh" mesh="t"/></mujoco>', "parts/geom.xml")
    asset = (
        '<asset><mesh name="t" file="t.stl"/><hfield name="h" file="h.bin" size="1 1 1 1"/>'
        '<texture name="x" type="2d" file="t.png"/><model name="c" file="child/child.xml"/></asset>'
    )
    text = DOOR.replace('<compiler angle="radian"/>', f"{compiler}{asset}")
    text = text.replace("</worldbody>", '<geom type="hfield" hfield="h"/></worldbody>')
    text = text.replace(
        "<geom type", '<include file="parts/geom.xml"/><attach model="c" prefix="c-"/><geom type', 1
    )
    return write(folder, text)
