"""Models that are loaded once: the same within, as their files are outside, pictures alike."""

import mujoco
import numpy as np
import pytest
from scenes import write

from joda import generate_all, render
from joda.pictures import offscreen
from joda.pictures.offscreen import NoRenderer
from joda.propose.offline import Offline
from joda.propose.session import NONE, Session
from joda.scenes import model as loading
from joda.scenes.model import load, load_model
from joda.scenes.model_cache import MAX_MODELS, cache_name, loading_once

PAIR = """<mujoco><compiler angle="radian"/>
  <asset><texture name="wood" type="2d" builtin="checker" width="64" height="64" rgb1="1 .8 .5"/>
    <material name="wood" texture="wood"/></asset>
  <worldbody>
    <geom type="box" size=".3 .2 .3" material="wood"/>
    <body pos="-.3 -.23 0"><joint name="left" axis="0 0 -1" range="0 1.5"/>
      <geom type="box" size=".14 .02 .28" pos=".14 0 0" material="wood"/></body>
    <body pos=".3 -.23 0"><joint name="right" axis="0 0 1" range="0 {widest}"/>
      <geom type="box" size=".14 .02 .28" pos="-.14 0 0" rgba=".2 .6 .2 1"/></body>
  </worldbody></mujoco>"""


def pair(folder, widest=1.5, name="pair.xml"):
    return write(folder, PAIR.format(widest=widest), name)


def content(model):
    out = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, out)
    return out


def widest(path):
    return load_model(path).joint("right").range[1]


def test_a_model_is_the_same_within_though_its_file_changes(tmp_path):
    before, after = np.random.default_rng().uniform(0.5, 3, 2)
    path = pair(tmp_path, before)
    with loading_once(tmp_path):
        first = load(path)
        pair(tmp_path, after)
        assert load(path) is first
        with loading_once(tmp_path):
            assert widest(path) == pytest.approx(after)
    assert widest(path) == pytest.approx(after)


def test_what_lies_elsewhere_is_loaded_each_time(tmp_path):
    (tmp_path / "inside").mkdir()
    path = pair(tmp_path)
    with loading_once(tmp_path / "inside"):
        assert load(path) is not load(path)


def test_only_the_last_models_are_kept(tmp_path):
    paths = [pair(tmp_path, name=f"{k}.xml") for k in range(MAX_MODELS + 1)]
    with loading_once(tmp_path):
        models = [load(path) for path in paths]
        assert all(load(path) is one for path, one in zip(paths[1:], models[1:], strict=True))
        assert load(paths[0]) is not models[0]


def test_a_folder_of_joints_loads_its_model_once(tmp_path, monkeypatch):
    (tmp_path / "models").mkdir()
    path, compiled = pair(tmp_path / "models"), []

    def counted(place):
        compiled.append(place)
        return original(place)

    original = loading._load
    monkeypatch.setattr(loading, "_load", counted)
    made = generate_all(tmp_path / "models", tmp_path / "out", proposer="offline", rounds=1)
    assert len(made) == 2 and compiled.count(path) == 1


def test_a_session_leaves_the_model_as_it_was(tmp_path):
    (tmp_path / "models").mkdir()
    path = pair(tmp_path / "models")
    with loading_once(path):
        for joint in ("left", "right"):
            Session.start(tmp_path / joint, path, joint, pictures=NONE).ask(Offline())
        kept = content(load_model(path))
    assert np.array_equal(kept, content(load_model(path)))


def test_pictures_of_one_opened_model_are_those_of_a_fresh_one(tmp_path):
    try:
        offscreen.render(pair(tmp_path), [])
    except NoRenderer:
        pytest.skip("nothing can render here")
    path = tmp_path / "pair.xml"
    with loading_once(tmp_path):
        assert cache_name()
        kept = [*render(path, "right", tmp_path / "a"), *render(path, "left", tmp_path / "a")]
    assert cache_name() is None
    fresh = [*render(path, "right", tmp_path / "b"), *render(path, "left", tmp_path / "b")]
    for one, other in zip(kept, fresh, strict=True):
        assert one.read_bytes() == other.read_bytes()
    pair(tmp_path, 0.3)  # another file is another picture
    _, changed = render(path, "right", tmp_path / "c", count=2)
    assert changed.read_bytes() != kept[4].read_bytes()
