"""What `joda export` writes for Drake, as Drake reads it; run where its package is installed."""

import mujoco
import numpy as np
import pytest

import joda
from joda.component import Component
from joda.profile import Channel, Channels, Joint, Profile, Resistance

pydrake = pytest.importorskip("pydrake")

SCENE = """
<mujoco>
  <asset><mesh name="wedge" vertex="0 0 0  .2 0 0  0 .3 0  0 0 .1"/></asset>
  <worldbody>
    <body name="case" pos=".1 .2 .3" euler="30 20 10">
      <geom type="box" size=".1 .2 .3" pos="0 .1 0"/>
      <body name="lid" pos=".1 0 .2" quat=".8 .6 0 0">
        <joint name="lid" axis="0 .6 .8" pos=".05 -.1 .2" range="-20 80" limited="true" ref="15"/>
        <geom type="capsule" size=".03 .2" pos=".1 0 0" euler="0 50 0"/>
        <geom type="mesh" mesh="wedge" pos="0 .1 0"/>
        <body name="sensor" pos="0 .1 0"/>
        <body name="slider" pos="0 0 .3" euler="0 30 0">
          <joint name="slider" type="slide" axis=".6 0 .8" range="0 .3" limited="true" damping="7"/>
          <geom type="cylinder" size=".05 .1"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>"""
PROFILE = Profile(
    joint=Joint(name="lid", type="hinge", range=(np.radians(-20), np.radians(80)), unit="rad"),
    channels=Channels(
        conservative=Channel(components=(Component(interval=(0, 1), x=(0, 1), y=(2.0, -1.0)),)),
        damping=Resistance(components=(Component(interval=(0, 1), x=(0, 1), y=(0.5, 0.5)),)),
    ),
)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize("to", ["urdf", "sdf"])
def test_drake_moves_it_as_mujoco(tmp_path, to):
    """Masses, gravity and Coriolis forces, damping, limits, and in SDF the spring."""
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import ForceElementIndex, RevoluteSpring

    (tmp_path / "plain.xml").write_text(SCENE)
    joda.attach(tmp_path / "plain.xml", PROFILE, tmp_path / "scene.xml")
    (told,) = joda.export(tmp_path / "scene.xml", to, tmp_path / f"o.{to}").joints
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "scene.xml"))
    data = mujoco.MjData(model)

    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(tmp_path / f"o.{to}"))
    plant.Finalize()
    assert plant.num_positions() == model.nq == 2
    joints = [plant.GetJointByName(name) for name in ("lid", "slider")]
    assert [one.default_damping_vector()[0] for one in joints] == pytest.approx([0.5, 7], rel=1e-6)
    limits = [(*one.position_lower_limits(), *one.position_upper_limits()) for one in joints]
    assert np.allclose(limits, model.jnt_range, atol=1e-7)

    context = plant.CreateDefaultContext()
    for q, v in (((0.0, 0.0), (0.0, 0.0)), ((1.1, 0.25), (0.7, -0.4))):
        for joint, position, speed in zip(joints, q, v, strict=True):
            setter = getattr(joint, "set_angle", None) or joint.set_translation
            rate = getattr(joint, "set_angular_rate", None) or joint.set_translation_rate
            setter(context, position)
            rate(context, speed)
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_forward(model, data)
        mass = np.zeros((2, 2))
        mujoco.mj_fullM(model, data, mass)
        assert np.allclose(plant.CalcMassMatrix(context), mass, atol=1e-7)
        bias = plant.CalcBiasTerm(context) - plant.CalcGravityGeneralizedForces(context)
        assert np.allclose(bias, data.qfrc_bias, atol=1e-6)

    forces = [
        plant.get_force_element(ForceElementIndex(k)) for k in range(plant.num_force_elements())
    ]
    springs = [one for one in forces if isinstance(one, RevoluteSpring)]
    assert len(springs) == (to == "sdf")
    for spring in springs:
        assert spring.GetStiffness(context) == pytest.approx(told.stiffness[0], rel=1e-6)
        assert spring.GetNominalAngle(context) == pytest.approx(told.reference, rel=1e-6)
