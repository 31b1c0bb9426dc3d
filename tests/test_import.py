"""Logs of other kinds become runs; what is ambiguous is refused with the option that settles it.

Each log is a small one, made by the format's own library.
"""

import json
import sqlite3
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from test_cli import fails, joda

from joda import JodaError, compare, import_log
from joda.importing.ros_messages import CONTROLLER, FIRST, HUMBLE, JOINTS
from joda.measured.run_files import read_run

ARM = """<mujoco><compiler angle="radian"/><worldbody><body>
  <joint name="shoulder_pan" axis="0 0 1" range="-1.9 1.9"/><geom size=".1"/><body pos="0 0 .3">
  <joint name="elbow_flex" axis="0 1 0" range="-1.6 1.4"/><geom size=".1"/><body pos="0 0 .3">
  <joint name="Gripper" axis="0 1 0" range="-0.2 1.8"/><geom size=".1"/><body pos="0 0 .3">
  <joint name="rail" type="slide" axis="0 0 1" range="0 0.5"/><geom size=".1"/></body></body></body>
  </body></worldbody><actuator>
  <position name="pan_servo" joint="shoulder_pan" kp="20" gear="2"/>
  <position name="elbow_flex" joint="elbow_flex" kp="20"/>
  <position name="gripper" joint="Gripper" kp="5"/><motor name="push" joint="rail"/>
</actuator></mujoco>"""
NAMES = ["shoulder_pan.pos", "elbow_flex.pos", "gripper.pos"]
STEP = 0.02
DELAY = 3
"""Samples by which the measured arm is behind its commands."""


@pytest.fixture
def arm(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    return path


def motion(n: int = 400, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Positions of the three hinges and their commands, rad, (n, 3) each: slow noise."""
    dice = np.random.default_rng(seed)
    path = np.cumsum(dice.normal(size=(n + DELAY, 3)), axis=0)
    path = np.array([np.convolve(one, np.ones(15) / 15, "same") for one in path.T]).T
    path = (path - path.min(axis=0)) / np.ptp(path, axis=0)  # 0 to 1
    path = np.array([-1.9, -1.6, -0.2]) + path * np.array([3.8, 3.0, 2.0])
    return path[:n], path[DELAY:]


def in_degrees(q: np.ndarray) -> np.ndarray:
    """As a robot whose gripper is in percent has them."""
    return np.column_stack([np.rad2deg(q[:, :2]), (q[:, 2] + 0.2) / 2 * 100])


def in_percent(q: np.ndarray) -> np.ndarray:
    """As a calibration from -100 to 100 has them, the gripper from 0 to 100."""
    mid, half = np.array([0, -0.1, 0.8]), np.array([1.9, 1.5, 1.0])
    return (q - mid) / half * np.array([100, 100, 50]) + np.array([0, 0, 50])


def write_info(folder: Path, version: str, **more) -> None:
    """The description of a dataset, as LeRobot writes it."""
    path = "episode_{episode_index:06d}" if version[1] == "2" else "file-{file_index:03d}"
    feature = {"dtype": "float32", "shape": [3], "names": NAMES}
    scalar = {"dtype": "int64", "shape": [1], "names": None}
    info = {
        "codebase_version": version, "robot_type": "so101_follower", "total_episodes": 2, "fps": 50,
        "total_frames": 700, "data_path": f"data/chunk-000/{path}.parquet",
        "features": {
            "action": feature, "observation.state": feature, "timestamp": scalar,
            "frame_index": scalar, "episode_index": scalar,
        },
    }  # fmt: skip
    (folder / "meta").mkdir(parents=True, exist_ok=True)
    (folder / "meta" / "info.json").write_text(json.dumps({**info, **more}))


def episode(number: int, q: np.ndarray, u: np.ndarray, start: int = 0, fixed: bool = True):
    """An episode's table."""
    n = len(q)
    kind = pa.list_(pa.float32(), 3) if fixed else pa.list_(pa.float32())
    return pa.table(
        {
            "observation.state": pa.array(q.astype(np.float32).tolist(), kind),
            "action": pa.array(u.astype(np.float32).tolist(), kind),
            "timestamp": pa.array((STEP * np.arange(n)).astype(np.float32)),
            "frame_index": pa.array(np.arange(n)),
            "episode_index": pa.array(np.full(n, number)),
            "index": pa.array(start + np.arange(n)),
        }
    )


def dataset(folder: Path, version: str, tables, **more) -> Path:
    """A dataset of these episodes: a file for each in version 2, one for all in version 3."""
    write_info(folder, version, **more)
    data = folder / "data" / "chunk-000"
    data.mkdir(parents=True, exist_ok=True)
    if version.startswith("v2"):
        lines = [json.dumps({"episode_index": k, "length": len(t)}) for k, t in enumerate(tables)]
        (folder / "meta" / "episodes.jsonl").write_text("\n".join(lines))
        for k, table in enumerate(tables):
            pq.write_table(table, data / f"episode_{k:06d}.parquet")
    else:
        meta = folder / "meta" / "episodes" / "chunk-000"
        meta.mkdir(parents=True)
        lengths = {"episode_index": range(len(tables)), "length": [len(t) for t in tables]}
        pq.write_table(
            pa.table({k: list(v) for k, v in lengths.items()}), meta / "file-000.parquet"
        )
        pq.write_table(pa.concat_tables(tables), data / "file-000.parquet")
    return folder


def read(path: Path) -> dict[str, np.ndarray]:
    """A run's columns, as NumPy reads them."""
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    rows = np.array([line.split(",") for line in lines[1:]], float)
    return dict(zip(lines[0].split(","), rows.T, strict=True))


def sentence(match: str, *arguments, **options) -> str:
    """The error of an import, which leaves no file."""
    with pytest.raises(JodaError, match=match) as caught:
        import_log(*arguments, **options)
    output = Path(arguments[2])
    assert not output.exists() or not any(output.iterdir())
    return str(caught.value)


# --- LeRobot
@pytest.mark.parametrize("version", ["v2.0", "v2.1", "v3.0"])
@pytest.mark.parametrize("scale", [in_degrees, in_percent])
def test_a_lerobot_dataset_becomes_a_run_per_episode(arm, tmp_path, version, scale):
    motions = [motion(400, 1), motion(300, 2)]
    tables = [episode(k, scale(q), scale(u), fixed=k == 0) for k, (q, u) in enumerate(motions)]
    tables = [tables[0], tables[1].cast(tables[0].schema)] if version == "v3.0" else tables
    log = dataset(tmp_path / "set", version, tables)
    units = [] if scale is in_degrees else ["shoulder_pan.pos=-100..100", "elbow*=-100..100"]
    made = import_log(log, arm, tmp_path / "runs", units=units)
    assert [path.name for path in made.runs] == ["episode_000000.csv", "episode_000001.csv"]
    assert (made.samples, made.unused, made.notes) == (700, (), ())
    for (q, u), path in zip(motions, made.runs, strict=True):
        run = read(path)
        joints = [f"position:{name}" for name in ("shoulder_pan", "elbow_flex", "Gripper")]
        assert list(run) == ["time", *joints, "ctrl:pan_servo", "ctrl:elbow_flex", "ctrl:gripper"]
        assert run["time"] == pytest.approx(STEP * np.arange(len(q)), abs=1e-6)
        assert np.column_stack([run[name] for name in joints]) == pytest.approx(q, abs=1e-5)
        assert run["ctrl:pan_servo"] == pytest.approx(2 * u[:, 0], abs=1e-5)  # its gear
        assert run["ctrl:gripper"] == pytest.approx(u[:, 2], abs=1e-5)
    units = {one.target: (one.unit, one.why) for one in made.columns}
    assert units["position:Gripper"] == ("0..100", "LeRobot's so101_follower")
    assert units["position:elbow_flex"][0] == ("deg" if scale is in_degrees else "-100..100")
    for one in made.columns[3:]:
        assert one.sign == "same"
        assert one.delay == pytest.approx(DELAY * STEP, abs=0.1 * STEP)
        assert one.delay_resolution == pytest.approx(STEP, rel=1e-3)


def test_degrees_and_percent_are_told_apart_or_asked_for(arm, tmp_path):
    q, u = motion()
    far = dataset(tmp_path / "far", "v3.0", [episode(0, in_degrees(q), in_degrees(u))])
    found = import_log(far, arm, tmp_path / "far_runs")  # beyond 100: degrees
    assert found.columns[0].unit == "deg"
    assert found.columns[0].why == "by its range: not rad, -100..100"
    near = dataset(tmp_path / "near", "v3.0", [episode(0, in_degrees(0.7 * q), in_degrees(u))])
    told = sentence("2 units fit", near, arm, tmp_path / "runs")
    assert "--unit 'observation.state/shoulder_pan.pos=deg or -100..100'" in told
    assert "in deg -1.33 to 1.33 rad; in -100..100 -1.448 to 1.448 rad" in told
    assert "the model's range is -1.9 to 1.9" in told
    made = import_log(near, arm, tmp_path / "deg", units=["*.pos=deg", "gripper.pos=percent"])
    assert read(made.runs[0])["position:elbow_flex"] == pytest.approx(0.7 * q[:, 1], abs=1e-5)
    assert made.columns[0].why == "as said"


def test_percent_is_not_taken_for_sure_where_another_zero_of_degrees_would_do_too(arm, tmp_path):
    q, u = motion()
    model = tmp_path / "short.xml"
    model.write_text(ARM.replace("-1.6 1.4", "-0.8 0.8"))
    turned = np.rad2deg(0.2 * q) + np.array([0, 60, 0])  # degrees, of which elbow_flex has its zero
    log = dataset(tmp_path / "set", "v3.0", [episode(0, turned, turned)])
    told = sentence("its unit is not sure", log, model, tmp_path / "runs")
    assert "/elbow_flex.pos" in told and "in -100..100" in told and "in deg" in told
    full = dataset(tmp_path / "full", "v3.0", [episode(0, in_percent(q), in_percent(u))])
    made = import_log(full, arm, tmp_path / "runs")
    assert made.columns[1].unit == "-100..100"  # it goes from end to end, and not in degrees


def test_radians_and_units_of_info_json(arm, tmp_path):
    q, u = (one * np.array([1, 1, 0.45]) + np.array([0, 0, 0.1]) for one in motion())
    tables = [episode(0, q, u)]
    log = dataset(tmp_path / "a", "v2.1", tables, robot_type="mine", total_episodes=3)
    told = sentence("gripper.pos: 2 units fit", log, arm, tmp_path / "a_runs")
    assert told.endswith("Say --unit 'observation.state/gripper.pos=rad or 0..1'.")
    made = import_log(log, arm, tmp_path / "a_runs", units=["gripper.pos=rad"])
    assert made.columns[0].unit == "rad"
    assert "total_episodes is 3, and 1 are there" in made.notes[0]
    info = json.loads((log / "meta" / "info.json").read_text())
    for name in ("action", "observation.state"):
        info["features"][name]["units"] = "rad"
    (log / "meta" / "info.json").write_text(json.dumps(info))
    made = import_log(log, arm, tmp_path / "b_runs")
    assert {(one.unit, one.why) for one in made.columns} == {("rad", "info.json")}


def test_names_that_are_not_the_models_are_listed_with_the_option(arm, tmp_path):
    q, u = motion()
    names = {"motors": ["base", "Elbow-Flex", "jaw.pos"]}
    feature = {"dtype": "float32", "shape": [3], "names": names}
    features = {"observation.state": feature, "action": feature}
    tables = [episode(0, in_degrees(q), in_degrees(u))]
    log = dataset(tmp_path / "set", "v2.0", tables, features=features)
    made = import_log(log, arm, tmp_path / "runs", units=["*=deg"])
    assert [one.target for one in made.columns] == ["position:elbow_flex", "ctrl:elbow_flex"]
    told = {one.name: one.why for one in made.unused}
    assert "--column 'position:JOINT=observation.state/base'" in told["observation.state/base"]
    assert "no joint is called 'jaw'" in told["observation.state/jaw.pos"]
    made = import_log(
        log, arm, tmp_path / "more", units=["*=deg", "jaw.pos=percent"],
        columns=["position:shoulder_pan=base", "position:Gripper=jaw.pos"],
    )  # fmt: skip
    assert [one.target for one in made.columns if one.target.startswith("ctrl")] == [
        "ctrl:pan_servo", "ctrl:elbow_flex", "ctrl:gripper",
    ]  # fmt: skip
    assert read(made.runs[0])["position:Gripper"] == pytest.approx(q[:, 2], abs=1e-5)


def test_two_joints_spelt_alike_are_asked_for(tmp_path):
    model = tmp_path / "arm.xml"
    model.write_text(
        ARM.replace('"rail"', '"shoulder-pan"').replace('"shoulder_pan"', '"Shoulder pan"')
    )
    q, u = motion()
    log = dataset(tmp_path / "set", "v3.0", [episode(0, in_degrees(q), in_degrees(u))])
    told = sentence("may be any of the joints", log, model, tmp_path / "runs")
    assert "'Shoulder pan', 'shoulder-pan'" in told and "--column position:JOINT=" in told


def test_only_some_episodes_and_only_one_joint(arm, tmp_path):
    tables = [episode(k, *map(in_degrees, motion(100, k))) for k in range(3)]
    log = dataset(tmp_path / "set", "v3.0", tables)
    units = ["*.pos=deg", "gripper.pos=percent"]
    made = import_log(log, arm, tmp_path / "runs", joint="elbow_flex", episodes=[2], units=units)
    assert [path.name for path in made.runs] == ["episode_000002.csv"]
    run = read_run(made.runs[0])
    assert run.position == pytest.approx(motion(100, 2)[0][:, 1], abs=1e-5)
    assert not run.forced and run.velocity is None and run.unread == ()
    assert "only if the actuator was off" in made.notes[-1]
    assert "becomes ctrl:elbow_flex" in made.unused[-1].why
    sentence(": no episode 7", log, arm, tmp_path / "no", episodes=[0, 7], units=units)
    with pytest.raises(JodaError, match=r"exists already; choose another name or add --force"):
        import_log(log, arm, tmp_path / "runs", units=units)
    assert len(list((tmp_path / "runs").iterdir())) == 1
    assert len(import_log(log, arm, tmp_path / "runs", units=units, force=True).runs) == 3


# --- bags
def store(definition: str = HUMBLE):
    """Types of ROS 2 with the controller's state."""
    types = get_typestore(Stores.ROS2_HUMBLE)
    types.register(get_types_from_msg(definition, CONTROLLER))
    return types


def header(types, t: float, origin: int = 1_700_000_000):
    nanoseconds = round(1e9 * t)
    stamp = types.types["builtin_interfaces/msg/Time"](
        sec=origin + nanoseconds // 10**9, nanosec=nanoseconds % 10**9
    )
    return types.types["std_msgs/msg/Header"](stamp=stamp, frame_id="")


def joint_state(types, t: float, names, position, velocity=(), effort=(), origin=1_700_000_000):
    numbers = [np.array(values, float) for values in (position, velocity, effort)]
    return types.types[JOINTS](header(types, t, origin), list(names), *numbers)


def controller_state(types, t: float, names, **positions):
    """The message with these points; the others are empty."""
    point, multi = (
        types.types[f"trajectory_msgs/msg/{name}"]
        for name in ("JointTrajectoryPoint", "MultiDOFJointTrajectoryPoint")
    )
    duration = types.types["builtin_interfaces/msg/Duration"](sec=0, nanosec=0)
    kind = types.types[CONTROLLER]
    filled = {"header": header(types, t), "joint_names": list(names)}
    for name in kind.__dataclass_fields__:
        if name == "multi_dof_joint_names":
            filled[name] = []
        elif name.startswith("multi_dof"):
            filled[name] = multi([], [], [], duration)
        elif name not in filled and name != "__msgtype__":
            values = np.array(positions.get(name, ()), float)
            filled[name] = point(values, *[np.zeros(0)] * 3, duration)
    return kind(**filled)


def write_bag(folder: Path, plugin: StoragePlugin, types, messages, bare: bool = False) -> Path:
    """A bag of messages (topic, type, received s, message); `bare`: without their definitions."""
    with Writer(folder, version=9, storage_plugin=plugin) as bag:
        topics = {}
        for topic, kind, received, message in messages:
            if topic not in topics:
                topics[topic] = bag.add_connection(topic, kind, typestore=types)
            data = types.serialize_cdr(message, kind)
            bag.write(topics[topic], round(1e9 * (received + 1_700_000_005)), data)
    if bare:
        (file,) = folder.glob("*.db3")
        with sqlite3.connect(file) as base:
            base.execute("DELETE FROM message_definitions")
        base.close()
    return folder


def states(types, q, names=("shoulder_pan", "elbow_flex", "Gripper"), topic="/joint_states"):
    velocity = np.gradient(q, STEP, axis=0)
    for k in range(len(q)):
        t = STEP * k
        message = joint_state(types, t, names, q[k], velocity[k], 0.1 * q[k])
        yield topic, JOINTS, t + 0.01 * (k % 3), message


@pytest.mark.parametrize("plugin", list(StoragePlugin))
@pytest.mark.parametrize("as_file", [False, True])
def test_a_bag_of_joint_states_becomes_a_run(arm, tmp_path, plugin, as_file):
    q, _ = motion()
    types = store()
    bag = write_bag(tmp_path / "recording", plugin, types, states(types, q))
    path = next(iter(bag.glob("*.mcap")), None) or next(iter(bag.glob("*.db3")))
    made = import_log(path if as_file else bag, arm, tmp_path / "runs")
    assert made.runs[0].name == f"{path.stem if as_file else 'recording'}.csv"
    run = read(made.runs[0])
    assert run["time"] == pytest.approx(STEP * np.arange(len(q)), abs=1e-6)  # not the recorder's
    assert run["position:Gripper"] == pytest.approx(q[:, 2], abs=1e-8)
    velocity = np.gradient(q[:, 1], STEP)
    assert run["velocity:elbow_flex"] == pytest.approx(velocity, abs=1e-6)
    assert not [name for name in run if name.startswith(("force", "ctrl"))]
    (told,) = {one.why for one in made.unused if "shoulder" in one.name}
    assert "--column 'force:shoulder_pan=/joint_states:shoulder_pan.effort'" in told
    assert {one.sign for one in made.columns if one.target.startswith("velocity")} == {"same"}
    taken = import_log(
        bag, arm, tmp_path / "forced", joint="elbow_flex", columns=["force=elbow_flex.effort"]
    )
    run = read_run(taken.runs[0])
    assert run.force == pytest.approx(0.1 * q[:, 1])
    assert run.velocity == pytest.approx(velocity, abs=1e-6)


@pytest.mark.parametrize("plugin", list(StoragePlugin))
@pytest.mark.parametrize("definition", [HUMBLE, FIRST])
def test_a_controllers_state_has_the_commands(arm, tmp_path, plugin, definition):
    q, u = motion()
    types = store(definition)
    first = definition == FIRST
    names = ("desired", "actual") if first else ("reference", "feedback")
    messages = []
    for k in range(len(q)):
        points = dict(zip(names, (u[k], q[k]), strict=True))
        if not first:
            points |= {"desired": u[k], "actual": q[k]}  # deprecated, beside the others
        message = controller_state(
            types, STEP * k, ["shoulder_pan", "elbow_flex", "Gripper"], **points
        )
        messages.append(("/arm/state", CONTROLLER, STEP * k, message))
    bare = plugin == StoragePlugin.SQLITE3  # as ROS 2 Humble records it
    bag = write_bag(tmp_path / "bag", plugin, types, messages, bare)
    made = import_log(bag, arm, tmp_path / "runs")
    run = read(made.runs[0])
    assert run["position:shoulder_pan"] == pytest.approx(q[:, 0], abs=1e-8)
    assert run["ctrl:pan_servo"] == pytest.approx(2 * u[:, 0], abs=1e-8)
    assert run["ctrl:gripper"] == pytest.approx(u[:, 2], abs=1e-8)
    delays = [one.delay for one in made.columns if one.target.startswith("ctrl")]
    assert delays == pytest.approx([DELAY * STEP] * 3, abs=0.1 * STEP)


def test_two_topics_of_one_joint_are_asked_for_and_commands_hold(arm, tmp_path):
    q, u = motion()
    types = store()
    messages = list(states(types, q))
    for k in range(5, len(q), 5):  # slower, and it begins later
        message = controller_state(
            types, STEP * k, ["elbow_flex"], reference=[u[k, 1]], feedback=[q[k, 1]]
        )
        messages.append(("/arm/state", CONTROLLER, STEP * k, message))
    bag = write_bag(tmp_path / "bag", StoragePlugin.MCAP, types, messages)
    told = sentence("position:elbow_flex may be", bag, arm, tmp_path / "runs")
    assert "'/joint_states:elbow_flex.position' or '/arm/state:elbow_flex.feedback'" in told
    assert "--column position:elbow_flex=NAME, or --topic" in told
    choice = ["position:elbow_flex=elbow_flex.position"]
    made = import_log(bag, arm, tmp_path / "runs", columns=choice)
    run = read(made.runs[0])
    k = np.arange(5, len(q))
    assert run["position:elbow_flex"] == pytest.approx(q[5:, 1], abs=1e-8)
    assert run["ctrl:elbow_flex"] == pytest.approx(u[5 * (k // 5), 1], abs=1e-8)
    assert run["time"][0] == 0
    assert "5 samples are left out" in made.notes[0]
    made = import_log(bag, arm, tmp_path / "slow", topics=["/arm/state"])
    assert read(made.runs[0])["position:elbow_flex"] == pytest.approx(q[5::5, 1], abs=1e-8)
    sentence("no topic '/x'; it has '/arm/state'", bag, arm, tmp_path / "no", topics=["/x"])


def test_joints_with_times_of_their_own_are_refused_or_interpolated(arm, tmp_path):
    types = store()
    t = STEP * np.arange(300)
    messages = [
        one
        for k in range(300)
        for one in (
            ("/js", JOINTS, t[k], joint_state(types, t[k], ["elbow_flex"], [np.sin(t[k])])),
            (
                "/js",
                JOINTS,
                t[k],
                joint_state(types, t[k] + 0.007, ["Gripper"], [np.cos(t[k] + 0.007)]),
            ),
        )
    ]
    bag = write_bag(tmp_path / "bag", StoragePlugin.MCAP, types, messages)
    told = sentence("has times of its own", bag, arm, tmp_path / "runs")
    assert "--joint" in told and "--interpolate" in told
    made = import_log(bag, arm, tmp_path / "runs", interpolate=True)
    run = read(made.runs[0])
    assert run["position:Gripper"] == pytest.approx(np.cos(run["time"] + STEP), abs=1e-4)
    assert read_run(import_log(bag, arm, tmp_path / "one", joint="Gripper").runs[0]).position[
        0
    ] == pytest.approx(np.cos(0.007))


def test_stamps_that_repeat_go_back_or_are_not_there(arm, tmp_path):
    types = store()
    times = [0, 0.02, 0.02, 0.04, 0.06, 0.08]
    cases = {
        "twice": (times, [0, 1, 1, 2, 3, 4], None),
        "still": (times, [0, 1, 2, 3, 4, 5], "message 2: time does not increase: it is that of"),
        "back": ([0, 0.02, 0.01, 0.04, 0.06], [0, 1, 2, 3, 4], "message 2: .* it goes back"),
    }
    for name, (at, values, match) in cases.items():
        messages = [
            ("/js", JOINTS, k / 50, joint_state(types, t, ["elbow_flex"], [0.1 * v]))
            for k, (t, v) in enumerate(zip(at, values, strict=True))
        ]
        bag = write_bag(tmp_path / name, StoragePlugin.MCAP, types, messages)
        if match:
            sentence(match, bag, arm, tmp_path / "no")
        else:  # a message published twice is one sample
            made = import_log(bag, arm, tmp_path / "runs")
            assert read(made.runs[0])["time"] == pytest.approx([0, 0.02, 0.04, 0.06, 0.08])
    messages = [
        ("/js", JOINTS, k / 50, joint_state(types, 0, ["elbow_flex"], [0.1 * k], origin=0))
        for k in range(9)
    ]
    bag = write_bag(tmp_path / "unstamped", StoragePlugin.MCAP, types, messages)
    made = import_log(bag, arm, tmp_path / "unstamped_runs")
    assert "have no stamps" in made.notes[0]
    assert read(made.runs[0])["time"] == pytest.approx(np.arange(9) / 50, abs=1e-6)


def test_nan_of_drivers_is_no_column_and_nan_between_numbers_is_refused(arm, tmp_path):
    types = store()
    q = np.sin(STEP * np.arange(50))

    def bag(name, values):
        messages = [
            ("/js", JOINTS, STEP * k, joint_state(types, STEP * k, ["elbow_flex"], [x], [np.nan]))
            for k, x in enumerate(values)
        ]
        return write_bag(tmp_path / name, StoragePlugin.SQLITE3, types, messages)

    made = import_log(bag("good", q), arm, tmp_path / "runs")
    assert [one.target for one in made.columns] == ["position:elbow_flex"]
    hole = np.where(np.arange(50) == 20, np.nan, q)
    sentence(
        r"/js, message 20: .*elbow_flex.position is not a number",
        bag("hole", hole),
        arm,
        tmp_path / "no",
    )
    late = np.where(np.arange(50) < 5, np.nan, q)
    made = import_log(bag("late", late), arm, tmp_path / "late_runs")
    assert read(made.runs[0])["position:elbow_flex"] == pytest.approx(q[5:])


def test_a_bag_of_ros_1(arm, tmp_path):
    types = get_typestore(Stores.ROS1_NOETIC)
    q, _ = motion(50)
    time = types.types["builtin_interfaces/msg/Time"]
    with Writer1(tmp_path / "old.bag") as bag:
        topic = bag.add_connection("/joint_states", JOINTS, typestore=types)
        for k in range(50):
            head = types.types["std_msgs/msg/Header"](k, time(7, 20_000_000 * k), "")
            message = types.types[JOINTS](head, ["elbow_flex"], q[k, 1:2], np.zeros(0), np.zeros(0))
            bag.write(topic, 8 * 10**9 + k, types.serialize_ros1(message, JOINTS))
    run = read(import_log(tmp_path / "old.bag", arm, tmp_path / "runs").runs[0])
    assert run["position:elbow_flex"] == pytest.approx(q[:, 1])
    assert run["time"] == pytest.approx(STEP * np.arange(50), abs=1e-8)


def test_what_is_no_bag_or_has_no_joints(arm, tmp_path):
    types = store()
    kind = "std_msgs/msg/Float64"
    message = types.types[kind](data=1.0)
    bag = write_bag(tmp_path / "bag", StoragePlugin.MCAP, types, [("/x", kind, 0, message)])
    sentence(r"no messages of .*it has '/x \(std_msgs/msg/Float64\)'", bag, arm, tmp_path / "runs")
    good = write_bag(tmp_path / "good", StoragePlugin.MCAP, types, states(types, motion(40)[0]))
    raw = next(good.glob("*.mcap")).read_bytes()
    for name, content in (
        ("a.mcap", raw[: len(raw) // 2]),
        ("b.mcap", b"no"),
        ("c.db3", raw),
        ("d.bag", b""),
    ):
        (tmp_path / name).write_bytes(content)
        sentence("cannot be read as a ROS bag", tmp_path / name, arm, tmp_path / "runs")
    (good / "metadata.yaml").write_text("rosbag2_bagfile_information: [1")
    sentence("cannot be read as a ROS bag", good, arm, tmp_path / "runs")
    sentence("neither a LeRobot dataset", tmp_path, arm, tmp_path / "runs")
    for name, joints, numbers, match in (
        (
            "twice",
            ["rail", "rail"],
            [0.1, 0.2],
            "message 0: has a joint twice among 'rail', 'rail'",
        ),
        ("short", ["rail", "Gripper"], [0.1], "position has 1 numbers for 2 joints"),
        ("nobody", [], [], ": its messages name no joints"),
    ):
        message = joint_state(types, 0.0, joints, numbers)
        rows = [("/joint_states", JOINTS, 0.0, message)]
        bag = write_bag(tmp_path / name, StoragePlugin.MCAP, types, rows)
        sentence(match, bag, arm, tmp_path / "runs")
    sentence(": no topic '/none'; it has", bag, arm, tmp_path / "runs", topics=["/none"])
    sentence("no such file or folder", tmp_path / "none", arm, tmp_path / "runs")


# --- CSV
def write_csv(path: Path, columns: dict[str, np.ndarray]) -> Path:
    rows = zip(*columns.values(), strict=True)
    path.write_text("\n".join([",".join(columns), *(",".join(map(str, row)) for row in rows)]))
    return path


def test_a_csv_in_degrees_with_names_of_its_own(arm, tmp_path):
    q, u = motion()
    n = len(q)
    log = write_csv(
        tmp_path / "log.csv",
        {
            "stamp_ms": 5e6 + 1e3 * STEP * np.arange(n), "elbow_deg": np.rad2deg(q[:, 1]),
            "elbow_cmd": np.rad2deg(u[:, 1]), "height": 250 + 100 * np.sin(np.arange(n) / 30),
            "effort": np.arange(n), "note": ["fine"] * n,
        },
    )  # fmt: skip
    told = sentence("no column is the position of any joint", log, arm, tmp_path / "runs")
    assert "'elbow_deg'" in told and "--column position:JOINT=NAME" in told
    made = import_log(
        log, arm, tmp_path / "runs",
        columns=[
            "position:elbow_flex=elbow_deg", "ctrl:elbow_flex=elbow_cmd", "position:rail=height",
            "ctrl:push=effort",
        ],
        units=["elbow_deg=deg", "height=mm"],
    )  # fmt: skip
    run = read(made.runs[0])
    assert run["time"] == pytest.approx(STEP * np.arange(n), abs=1e-6)
    assert run["position:elbow_flex"] == pytest.approx(q[:, 1])
    assert run["ctrl:elbow_flex"] == pytest.approx(u[:, 1])  # in degrees too, as its position
    assert run["position:rail"] == pytest.approx(0.25 + 0.1 * np.sin(np.arange(n) / 30))
    assert run["ctrl:push"] == pytest.approx(np.arange(n))
    assert [one.name for one in made.unused] == ["note"]
    known = {one.target: (one.unit, one.why) for one in made.columns}
    assert known["ctrl:elbow_flex"] == ("deg", "its position's")
    assert known["ctrl:push"] == ("raw", "no position servo: its own unit")


def test_times_in_units_and_the_same_for_all_other_columns(arm, tmp_path):
    q = np.linspace(-80, 70, 50)
    log = write_csv(tmp_path / "log.csv", {"T": np.arange(0, 1000, 20), "elbow_flex.pos": q})
    sentence("--unit T=ms, us or ns", log, arm, tmp_path / "no", units=["*=deg"])
    made = import_log(log, arm, tmp_path / "runs", units=["*=deg", "T=ms"])
    run = read(made.runs[0])
    assert run["time"] == pytest.approx(np.arange(50) / 50)
    assert run["position:elbow_flex"] == pytest.approx(np.deg2rad(q))
    sentence("times are in 's', 'ms'", log, arm, tmp_path / "no", units=["T=deg"])


def test_a_run_of_ones_own_is_read_as_it_is(arm, tmp_path):
    q, u = motion()
    columns = {
        "time": 3 + STEP * np.arange(len(q)), "position:elbow_flex": q[:, 1],
        "ctrl:pan_servo": u[:, 0], "position:shoulder_pan": q[:, 0],
    }  # fmt: skip
    log = write_csv(tmp_path / "log.csv", columns)
    made = import_log(log, arm, tmp_path / "runs")
    again = import_log(made.runs[0], arm, tmp_path / "again")
    assert made.runs[0].read_text().splitlines()[2:] == again.runs[0].read_text().splitlines()[2:]
    assert read(made.runs[0])["ctrl:pan_servo"] == pytest.approx(u[:, 0])


def test_a_run_of_one_joint_stays_one(arm, tmp_path):
    time, q = STEP * np.arange(100), np.sin(STEP * np.arange(100))
    columns = {"Time": time, "position": q, "velocity": np.cos(time), "force": 0.1 * q}
    log = write_csv(tmp_path / "log.csv", columns)
    made = import_log(log, arm, tmp_path / "runs", joint="elbow_flex")
    run, own = read_run(made.runs[0]), read_run(log)
    assert run.position == pytest.approx(own.position)
    assert run.velocity == pytest.approx(own.velocity)
    assert run.force == pytest.approx(own.force)
    text = log.read_text().replace(f",{columns['force'][7]}", ",")  # an empty cell: not known
    log.write_text(text)
    made = import_log(log, arm, tmp_path / "hole", joint="elbow_flex", units=["force=-raw"])
    force = read_run(made.runs[0]).force
    assert np.flatnonzero(np.isnan(force)).tolist() == [7]
    assert force[:7] == pytest.approx(-own.force[:7])
    made = import_log(log, arm, tmp_path / "less", columns=["position:rail=position"])
    assert [one.target for one in made.columns] == ["position:rail"]
    assert "it tells no joint; --column 'velocity:JOINT=velocity'" in made.unused[0].why


def test_sign_zero_and_delay_that_are_wrong_are_said(arm, tmp_path):
    q, u = motion()
    inner = 0.4 * (q[:, 1] + 0.1)
    late = 0.4 * (u[:, 1] + 0.1)
    time = STEP * np.arange(len(q))
    columns = {
        "time": time,
        "elbow_flex.pos_deg": np.rad2deg(-inner) + 170,
        "ctrl:elbow_flex": late,
    }
    log = write_csv(tmp_path / "log.csv", columns)
    made = import_log(log, arm, tmp_path / "wrong")
    told = " ".join(made.notes)
    assert "position:elbow_flex: 100 % of it is outside the model's range" in told
    assert "--zero 'elbow_flex.pos_deg=" in told and "goes against its command" in told
    (command,) = (one for one in made.columns if one.target == "ctrl:elbow_flex")
    (place,) = (one for one in made.columns if one.target == "position:elbow_flex")
    assert (command.sign, place.outside) == ("opposite", 1)
    made = import_log(
        log, arm, tmp_path / "right", units=["*.pos_deg=-deg"], zeros=["elbow_flex.pos_deg=170"]
    )
    assert made.notes == ()
    assert read(made.runs[0])["position:elbow_flex"] == pytest.approx(inner)
    (command,) = (one for one in made.columns if one.target == "ctrl:elbow_flex")
    assert (command.sign, command.offset) == ("same", pytest.approx(0, abs=0.02))
    ahead = {"time": time, "position:elbow_flex": late, "ctrl:elbow_flex": inner}
    made = import_log(write_csv(tmp_path / "b.csv", ahead), arm, tmp_path / "ahead")
    assert "moves 59.9 ms before its command" in made.notes[0]
    still = {"time": time, "position:elbow_flex": 0 * inner, "ctrl:elbow_flex": inner}
    made = import_log(write_csv(tmp_path / "c.csv", still), arm, tmp_path / "still")
    assert {(one.sign, one.delay) for one in made.columns} == {("", None)}


def test_a_periodic_command_is_followed_and_not_led(arm, tmp_path):
    time = STEP * np.arange(500)
    for period in (0.4, 0.8, 3.0):
        u, q = (0.3 * np.sin(2 * np.pi * (time - by) / period) for by in (0, 0.1))
        columns = {"time": time, "position:elbow_flex": q, "ctrl:elbow_flex": u}
        log = write_csv(tmp_path / f"{period}.csv", columns)
        found = import_log(log, arm, tmp_path / "runs").columns[-1]
        assert (found.sign, found.delay) == ("same", pytest.approx(0.1, abs=0.5 * STEP))


WRONG = [
    ("time,a\n0,1\n", {}, "no column is the position"),
    ("x,position:elbow_flex\n0,0.1\n1,0.2\n", {}, "the column of times is not among"),
    ("time,t,position:elbow_flex\n0,0,1\n", {"columns": ["time=z"]}, "no column 'z'"),
    ("t,stamp,position:elbow_flex\n0,0,1\n", {}, "may be any of 't', 'stamp'; say --column time="),
    ("time,position:elbow_flex\n0,0.1\n20,0.2\n40,0.3\n60,0.4\n", {}, "--unit time=ms, us or ns"),
    ("time,position:elbow_flex\n0,0.1\n0.1,0.2\n0.1,0.3\n", {}, "line 4: time does not increase"),
    ("time,position:elbow_flex\n0,0.1\n0.1,\n0.2,0.3\n0.3,0.4\n", {}, "line 3: .* not a number"),
    ("time,position:elbow_flex\n0,0.1\n0.1,nan\n0.2,0.3\n", {}, "line 3: .* is 'nan'"),
    ("time,position:elbow_flex\n0,0.1\n0.1,1e400\n", {}, "line 3: position:elbow_flex"),
    ("time,position:elbow_flex\n0,0.1\n0.1,0.2\n", {}, "a run needs at least 4"),
    ("time,position:elbow_flex\n", {}, "a header and no rows"),
    ("", {}, "the column of times is not among none"),
    ("time,position:elbow_flex\n0,1\n", {"columns": ["elbow=time"]}, "must be TARGET=NAME"),
    ("time,position:elbow_flex\n0,1\n", {"columns": ["position:nose=b"]}, "no column 'b'"),
    ("time,b\n0,1\n", {"columns": ["position:nose=b"]}, "joint 'nose' not found"),
    ("time,b\n0,1\n", {"columns": ["ctrl:nose=b"]}, "no actuator 'nose'; the model's are"),
    ("time,b\n0,1\n", {"columns": ["position=b"]}, "of which joint"),
    ("time,b\n0,1\n", {"units": ["b=parsec"]}, "no unit 'parsec'; give one of rad"),
    ("time,b\n0,1\n", {"units": ["b"]}, "must be NAME=VALUE"),
    ("time,position:elbow_flex\n0,1\n", {"units": ["c=deg"]}, "no column 'c'; it has"),
    ("time,position:elbow_flex\n0,1\n", {"zeros": ["c=1e400"]}, "must be a number"),
    ("time,position:rail\n0,1\n", {"units": ["position:rail=deg"]}, "no unit of a slide"),
    ("time,position:elbow_flex\n0,1\n", {"without": ["c"]}, "no column 'c'"),
    ("time,position:elbow_flex\n0,1\n", {"episodes": [1]}, "LeRobot datasets; leave it out"),
    ("time,position:elbow_flex\n0,1\n", {"topics": ["/x"]}, "--topic is of ROS bags"),
    ("time,position:elbow_flex\n0,0.1\n,0.2\n", {}, "is empty; give each row its time"),
    ("time,b\n0,1\n", {"columns": ["position:Gripper=b"], "joint": "rail"},
     "is not of joint 'rail', which --joint names"),
    ("time,a,b\n0,1,2\n", {"columns": ["position:rail=a", "position:elbow_flex=a"]}, "already"),
]  # fmt: skip


@pytest.mark.parametrize(("content", "options", "match"), WRONG)
def test_wrong_files_and_options_are_one_sentence(arm, tmp_path, content, options, match):
    log = tmp_path / "log.csv"
    log.write_text(content)
    assert len(sentence(match, log, arm, tmp_path / "runs", **options)) < 700


BROKEN_INFO = [
    ("[]", "info.json"),
    ("{", "info.json"),
    ('{"codebase_version": "v3.0"}', "fps"),
    ({"fps": 10**400}, "fps"),
    ({"fps": 0}, "fps"),
    ({"codebase_version": "v1.6"}, "versions 2 and 3 are read"),
    ({"features": {"action": {}}}, "features has no 'observation.state'"),
    ({"features": {"observation.state": {"shape": [3], "names": [1, 2, 3]}}}, "a list of names"),
    ({"features": {"observation.state": {"shape": [2], "names": NAMES}}}, "3 names and the shape"),
    ({"features": {"observation.state": {"shape": [2], "names": ["a", "a"]}}},
     r"\.names has 'a' twice"),
    ({"features": {"observation.state": {"shape": [10**30], "names": None}}}, "list of names"),
    ({"features": {"observation.state": {"shape": [3], "names": NAMES, "units": 3}}},
     " must be a unit, or a list"),
    ({"features": {"observation.state": {"shape": [3], "names": NAMES, "units": "x"}}}, "no unit"),
]  # fmt: skip


@pytest.mark.parametrize(("info", "match"), BROKEN_INFO)
def test_a_broken_info_json_is_one_sentence(arm, tmp_path, info, match):
    q, u = motion(20)
    log = dataset(tmp_path / "set", "v3.0", [episode(0, q, u)])
    if isinstance(info, dict):
        write_info(log, "v3.0", **info)
    else:
        (log / "meta" / "info.json").write_text(info)
    assert "info.json" in sentence(match, log, arm, tmp_path / "runs")


def changed(table, name: str, values) -> pa.Table:
    """The table with another column."""
    return table.set_column(table.schema.get_field_index(name), name, values)


def test_broken_parquet_files_are_one_sentence(arm, tmp_path):
    q, u = motion(20)
    units = ["*.pos=rad"]
    table = episode(0, q, u)
    hole = q.copy()
    hole[7, 1] = np.nan
    ragged = pa.array([[0.0]] * 10 + [[0.0] * 5] * 10, pa.list_(pa.float32()))
    texts = pa.array([["a", "b", "c"]] * 20)
    cases = {
        "nan": (episode(0, hole, u), "frame 7: observation.state/elbow_flex.pos is not a number"),
        "ragged": (changed(table, "observation.state", ragged), "lists of several lengths"),
        "texts": (changed(table, "observation.state", texts), "has string, not numbers"),
        "flat": (changed(table, "action", pa.array(np.zeros(20))), "has 1 numbers a row"),
        "none": (table.drop_columns(["action"]), "no column 'action', which info.json has"),
        "empty": (table.slice(0, 0), "its files have no frames"),
        "short": (table.slice(0, 2), "a run needs at least 4"),
        "huge": (episode(0, q * 1e30, u), "too large to be meant"),
        "still": (changed(table, "timestamp", pa.array(np.zeros(20))), "frame 1: time does not"),
        "late": (changed(table, "timestamp", pa.array([np.nan] * 20)), ": its time is no number"),
        "null": (changed(table, "episode_index", pa.nulls(20, pa.int64())), "no number of one"),
    }  # fmt: skip
    for name, (broken, match) in cases.items():
        log = dataset(tmp_path / name, "v3.0", [broken])
        told = sentence(match, log, arm, tmp_path / "runs", units=units)
        assert str(log) in told
    log = dataset(tmp_path / "void", "v3.0", [episode(0, np.full_like(q, np.nan), u)])
    sentence(r"column '.*' has no numbers\.", log, arm, tmp_path / "runs")
    void = q.copy()
    void[:, 1] = np.nan
    log = dataset(tmp_path / "half", "v3.0", [table, episode(1, void, u)])
    sentence("elbow_flex.pos has no numbers there", log, arm, tmp_path / "runs", units=units)
    both = {"units": units, "columns": ["velocity:elbow_flex=elbow_flex.pos"]}
    sentence("may be .*; give the whole name", log, arm, tmp_path / "runs", **both)
    (tmp_path / "taken").write_text("")
    with pytest.raises(JodaError, match=": is a file; give a folder for the runs"):
        import_log(log, arm, tmp_path / "taken", units=units)
    log = dataset(tmp_path / "cut", "v2.1", [table])
    (file,) = (log / "data" / "chunk-000").iterdir()
    file.write_bytes(file.read_bytes()[:-50])
    sentence("cannot be read as Parquet", log, arm, tmp_path / "runs", units=units)
    file.unlink()
    sentence(
        r"no file data/chunk.*; is the dataset whole\?", log, arm, tmp_path / "runs", units=units
    )
    log = dataset(tmp_path / "twice", "v2.1", [table, table])
    sentence("episode 0 is in .*episode_000000", log, arm, tmp_path / "runs", units=units)


def test_actuators_that_are_no_position_servos_get_no_positions(arm, tmp_path):
    feature = {"dtype": "float32", "shape": [1], "names": ["rail.pos"]}
    q = 0.25 + 0.2 * np.sin(np.arange(100) / 10)
    table = episode(0, np.zeros((100, 3)), np.zeros((100, 3)))
    for name in ("observation.state", "action"):
        table = changed(table, name, pa.array(q[:, None].tolist(), pa.list_(pa.float32())))
    log = dataset(
        tmp_path / "set",
        "v3.0",
        [table],
        features={"observation.state": feature, "action": feature},
    )
    units = ["observation.state/rail.pos=m", "action/rail.pos=m"]
    told = sentence(
        "'push' of the model is no position servo", log, arm, tmp_path / "no", units=units
    )
    assert "--unit 'action/rail.pos=raw'" in told and "--without" in told
    made = import_log(log, arm, tmp_path / "runs", units=units[:1], without=["action/*"])
    assert [one.target for one in made.columns] == ["position:rail"]


@pytest.mark.slow
# --- the command
def test_the_command_prints_a_table_and_json_and_its_runs_are_compared(tmp_path):
    model = tmp_path / "pendulum.xml"
    model.write_text(
        '<mujoco><worldbody><body><joint name="hinge" axis="0 1 0" range="-170 170" damping=".05"/>'
        '<geom type="capsule" fromto="0 0 0 0 0 -.5" size=".03"/></body></worldbody></mujoco>'
    )
    time = 0.01 * np.arange(300)
    swing = 60 * np.exp(-0.1 * time) * np.cos(5.2 * time)
    log = write_csv(tmp_path / "log.csv", {"t": time, "Hinge_pos_deg": swing})
    done = joda("import", log, "--model", model, "--joint", "hinge", "-o", tmp_path / "runs")
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    assert lines[0] == "CSV: 1 run, 2.99 s, 300 samples."
    assert " ".join(lines[1].split()).endswith("unit known by range model's sign zero delay")
    assert lines[2].split()[:5] == ["Hinge_pos_deg", "position:hinge", "deg", "its", "name"]
    assert lines[-1] == str(tmp_path / "runs" / "log.csv")
    found = compare(model, "hinge", [tmp_path / "runs" / "log.csv"])
    assert found.rmse_window is not None and found.rmse_window < 0.1
    done = joda("import", log, "--model", model, "-o", tmp_path / "more", "--json")
    told = json.loads(done.stdout)
    assert told["runs"] == [str(tmp_path / "more" / "log.csv")]
    assert told["columns"][0]["target"] == "position:hinge"
    assert told["columns"][0]["range"] == pytest.approx(np.deg2rad([swing.min(), swing.max()]))
    assert "exists already" in fails("import", log, "--model", model, "-o", tmp_path / "more")
    hostile = write_csv(tmp_path / "bad.csv", {"time": time, "\x1b[2Jpos": swing})
    assert "\x1b" not in fails("import", hostile, "--model", model, "-o", tmp_path / "no")


@pytest.mark.parametrize(
    ("library", "log", "told"),
    [
        ("pyarrow", "set", 'LeRobot datasets need pyarrow; run: pip install ".[import]"'),
        ("rosbags.highlevel", "a.mcap", 'ROS bags need rosbags; run: pip install ".[import]"'),
    ],
)
def test_without_the_extra_a_sentence_says_what_to_install(
    arm, tmp_path, monkeypatch, library, log, told
):
    dataset(tmp_path / "set", "v3.0", [episode(0, *motion(20))])
    (tmp_path / "a.mcap").write_bytes(b"")
    monkeypatch.setitem(sys.modules, library, None)
    assert sentence("need", tmp_path / log, arm, tmp_path / "runs") == told
