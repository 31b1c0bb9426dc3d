"""Rays meet surfaces from behind as MuJoCo's normals say, and without them."""

import secrets

import mujoco
import numpy as np
import pytest

from joda.scenes import rays as rays_of
from joda.scenes.rays import ray, rays

SCENE = """<mujoco><asset><mesh name="m" vertex="0 0 0  .3 0 0  0 .3 0  0 0 .3  .3 .3 .3"/></asset>
<worldbody><geom type="box" size=".4 .3 .2"/><geom type="sphere" size=".2" pos=".7 0 0"/>
<geom type="capsule" size=".1 .3" pos="-.8 0 0"/><geom type="cylinder" size=".3 .1" pos="0 .8 0"/>
<geom type="ellipsoid" size=".3 .2 .1" pos="0 -.8 0"/><geom type="mesh" mesh="m" pos="0 0 .6"/>
</worldbody></mujoco>"""


@pytest.mark.skipif(not rays_of.NORMALS, reason="this MuJoCo tells no normals")
def test_from_behind_is_told_without_normals_as_with_them(monkeypatch):
    model = mujoco.MjModel.from_xml_string(SCENE)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    seed = secrets.randbits(32)
    print("seed", seed)
    rng = np.random.default_rng(seed)
    without = {
        "mj_multiRay": lambda *a: mujoco_multi(*a[:9], np.zeros(len(a[3])), *a[9:]),
        "mj_ray": mujoco.mj_ray,
    }
    mujoco_multi, alike, behind = mujoco.mj_multiRay, [], 0
    for _ in range(60):
        ways = rng.normal(size=(30, 3))
        ways /= np.linalg.norm(ways, axis=1)[:, None]
        at = model.geom_pos[rng.integers(model.ngeom)] + rng.uniform(-0.3, 0.3, 3)
        with_ = rays(model, data, at, ways, 3.0)
        one = ray(model, data, at, ways[0], -1)
        assert one == (with_.geoms[0], pytest.approx(with_.distances[0]), with_.behind[0])
        with monkeypatch.context() as old:
            old.setattr(rays_of, "NORMALS", False)
            for name, function in without.items():
                old.setattr(mujoco, name, function)
            found = rays(model, data, at, ways, 3.0)
            assert ray(model, data, at, ways[0], -1)[2] == found.behind[0]
        assert (found.geoms == with_.geoms).all()
        alike.append(np.mean(found.behind == with_.behind))
        behind += int(with_.behind.sum())
    assert behind > 100
    assert np.mean(alike) > 0.999  # a ray along an edge may be counted otherwise
