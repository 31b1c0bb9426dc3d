"""The studio without a browser: its folder, its past, edits, solids, guard, and what is saved."""

import asyncio
import json
import socket
import subprocess
import sys
from contextlib import closing
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from joda import JodaError, Profile, attach, compare, read_profiles, simulate, studio
from joda.commands.studio import charts, edits
from joda.commands.studio.folder import Folder
from joda.commands.studio.guard import Guard, free_port
from joda.commands.studio.live import Live
from joda.commands.studio.motions import Outdated, replayed, simulated
from joda.commands.studio.session import StudioSession
from joda.commands.studio.solids import shape
from joda.commands.studio.timeline import Timeline
from joda.commands.studio.work import Stopped, Work
from joda.component import Component
from joda.effects import AddedInertia
from joda.field import evaluate
from joda.measured.run_files import write_run
from joda.plain import plain
from joda.profile import Joint
from joda.scenes.motion import Motion

LID = """\
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <geom type="plane" size="1 1 1" pos="0 0 -.3"/>
    <geom type="box" size=".3 .2 .1" pos="0 0 -.12"/>
    <body pos="-.3 0 0">
      <joint name="lid" axis="0 -1 0" range="0 1.5" damping="0.05" frictionloss="0.1"/>
      <geom type="box" size=".3 .2 .01" pos=".3 0 0" mass=".5" rgba="1 0 0 1"/>
      <geom type="capsule" size=".02 .1" pos=".6 0 0" mass=".01" rgba="0 0 1 1"/>
    </body>
  </worldbody>
</mujoco>
"""


def unexplained(comparison):
    """The errors of its runs without what start and force make of them, which the studio skips."""
    return tuple(replace(run, rmse_explained=None) for run in comparison.runs)


@pytest.fixture
def session(tmp_path):
    (tmp_path / "lid.xml").write_text(LID)
    with closing(StudioSession(tmp_path / "lid.xml")) as opened:
        yield opened


@pytest.fixture
def profile(session):
    curve = Component(label="latch", interval=(0.2, 0.8), x=(0, 0.5, 1), y=(0, -2, 0))
    return session.opened.with_component("conservative", curve)


def latch(profile):
    return profile.channels.conservative.components[0]


LATCH = edits.Handle("conservative", 0, 1)


# --- the folder


def test_a_name_inside_the_folder_is_found(tmp_path):
    (tmp_path / "runs").mkdir()
    folder = Folder(tmp_path)
    assert folder.inside("runs/a.csv") == tmp_path.resolve() / "runs" / "a.csv"
    assert folder.inside(tmp_path / "a.csv") == folder.inside("runs/../a.csv")


@pytest.mark.parametrize("name", ["../a.csv", "/etc/passwd", "runs/../../a.csv", "link/a.csv"])
def test_what_lies_outside_is_refused(tmp_path, name):
    project = tmp_path / "project"
    project.mkdir()
    (project / "link").symlink_to(tmp_path)
    with pytest.raises(JodaError, match="outside the project folder"):
        Folder(project).inside(name)


def test_files_that_links_lead_outside_to_are_not_listed(tmp_path):
    project = tmp_path / "project"
    (project / "runs").mkdir(parents=True)
    for path in (tmp_path / "out.csv", project / "a.csv", project / "runs" / "b.csv"):
        path.write_text("")
    (project / "link.csv").symlink_to(tmp_path / "out.csv")
    assert Folder(project).listed(".csv") == ["a.csv", "runs/b.csv"]


# --- the past


@given(st.lists(st.integers() | st.sampled_from(["undo", "redo"]), max_size=30))
def test_undo_and_redo_are_those_of_two_stacks(steps):
    timeline, past, future, present = Timeline(0), [], [], 0
    for step in steps:
        if step == "undo":
            timeline = timeline.undo()
            if past:
                future.append(present)
                present = past.pop()
        elif step == "redo":
            timeline = timeline.redo()
            if future:
                past.append(present)
                present = future.pop()
        elif step != present:
            timeline = timeline.then(step)
            past.append(present)
            present, future = step, []
        else:
            timeline = timeline.then(step)
        assert timeline.present == present
        assert (list(timeline.past), list(timeline.future)) == (past, future[::-1])


# --- edits


def test_an_inner_point_moves_between_its_neighbours_only(profile):
    there = edits.moved(profile, LATCH, 0.6, 3.0)
    assert edits.positions(latch(there)) == pytest.approx([0.2, 0.6, 0.8])
    assert latch(there).y == (0, 3, 0)
    beyond = edits.moved(profile, LATCH, 0.95, 3.0)
    assert edits.positions(latch(beyond)) == pytest.approx([0.2, 0.8 - edits.GAP, 0.8])


def test_an_end_moves_the_interval_and_leaves_the_points_between(profile):
    there = edits.moved(profile, edits.Handle("conservative", 0, 0), 0.1, 1.0)
    assert latch(there).interval == (0.1, 0.8)
    assert edits.positions(latch(there)) == pytest.approx([0.1, 0.5, 0.8], abs=1e-6)
    snapped = edits.moved(profile, edits.Handle("conservative", 0, 2), 0.99, 1.0)
    assert latch(snapped).interval == (0.2, 1.0)


def test_a_value_alone_changes_nothing_else(profile):
    there = edits.moved(profile, LATCH, 0.5, 3.0)
    assert latch(there) == latch(profile).model_copy(update={"y": (0.0, 3.0, 0.0)})


def test_friction_is_nowhere_negative(profile):
    handle = edits.Handle("friction", 0, 0)
    assert edits.moved(profile, handle, 0, -1).channels.friction.components[0].y[0] == 0


def test_points_come_and_go(profile):
    more = edits.inserted(profile, "conservative", 0, 0.35, -1.0)
    assert edits.positions(latch(more)) == pytest.approx([0.2, 0.35, 0.5, 0.8], abs=1e-6)
    assert latch(edits.removed(more, edits.Handle("conservative", 0, 1))) == latch(profile)
    assert edits.inserted(profile, "conservative", 0, 0.5, 1.0) == profile  # there is one already
    longer = edits.inserted(profile, "conservative", 0, 0.9, 1.0)
    assert latch(longer).interval == (0.2, 0.9)
    two = edits.removed(profile, LATCH)
    none = edits.removed(two, edits.Handle("conservative", 0, 0))
    assert none.channels.conservative.components == ()


def test_a_curve_begins_as_a_hill(session):
    made = edits.begun(session.opened, "conservative", 0.4, 2.0)
    value = evaluate(made.channels.conservative, np.array([0.1, 0.4, 0.7]))[0]
    assert value == pytest.approx([0, 2, 0])


@given(
    steps=st.lists(
        st.tuples(
            st.sampled_from(["move", "insert", "remove", "begin"]),
            st.sampled_from(["conservative", "friction", "damping"]),
            st.floats(-2, 3),
            st.floats(-1e20, 1e20),
            st.integers(0, 5),
        ),
        max_size=12,
    )
)
def test_whatever_is_done_the_profile_stays_valid(steps):
    joint = {"name": "j", "type": "hinge", "range": (0, 1), "unit": "rad"}
    profile = Profile.model_validate({"joint": joint})
    for kind, channel, s, y, number in steps:
        components = getattr(profile.channels, channel).components
        if kind == "begin" or not components:
            profile = edits.begun(profile, channel, float(np.clip(s, 0, 1)), y)
        elif kind == "insert":
            profile = edits.inserted(profile, channel, number % len(components), s, y)
        else:
            at = number % len(components)
            handle = edits.Handle(channel, at, number % len(components[at].x))
            if kind == "move":
                profile = edits.moved(profile, handle, s, y)
            else:
                profile = edits.removed(profile, handle)
        assert Profile.model_validate_json(profile.to_json()) == profile


# --- the desk


def test_the_profile_is_whole_and_a_drag_is_one_step(session):
    assert [c.label for c in session.opened.channels.damping.components] == ["native damping"]
    handle = edits.Handle("damping", 0, 0)
    for y in (0.1, 0.2, 0.3):
        session.drag(handle, 0, y, done=False)
        assert session.profile.channels.damping.components[0].y == (y, 0.05)
        assert not session.unsaved
    session.drag(handle, 0, 0.3, done=True)
    assert session.unsaved
    session.undo()
    assert session.profile == session.opened
    assert not session.unsaved


def test_what_is_saved_is_what_attach_writes(session, profile, tmp_path):
    before = session.scene.read_bytes()
    edited = profile.with_effect(AddedInertia(inertia=0.01))
    session.edit(edited)
    notes = session.save("new.xml")
    assert Profile.read(tmp_path / "new.composed.json") == edited
    assert notes == attach(session.scene, tmp_path / "new.composed.json", tmp_path / "cli.xml")
    assert (tmp_path / "new.xml").read_bytes() == (tmp_path / "cli.xml").read_bytes()
    assert read_profiles(tmp_path / "new.xml")["lid"].channels == edited.channels
    assert not session.unsaved
    assert session.scene.read_bytes() == before


def test_nothing_is_replaced_unasked(session, profile, tmp_path):
    session.edit(profile)
    for name in ("new.xml", "new.composed.json"):
        (tmp_path / name).write_text("precious")
        assert session.taken("new.xml")
        with pytest.raises(JodaError, match="exists already"):
            session.save("new.xml")
        assert (tmp_path / name).read_text() == "precious"
        (tmp_path / name).unlink()
    (tmp_path / "new.xml").write_text("old")
    session.save("new.xml", force=True)
    assert (tmp_path / "new.xml").read_text() != "old"
    with pytest.raises(JodaError, match="the scene at work"):
        session.save("lid.xml", force=True)
    with pytest.raises(JodaError, match=r"new\.csv: must end in \.xml\."):
        session.save("new.csv")


def test_the_joint_that_is_meant(session, profile, tmp_path):
    two = LID.replace(
        "</worldbody>",
        '<body><joint name="knob" range="0 1"/><geom size=".1"/></body></worldbody>',
    )
    (tmp_path / "two.xml").write_text(two)
    with pytest.raises(
        JodaError, match=r"two\.xml: choose a joint with --joint; there are 'lid', 'k"
    ):
        StudioSession(tmp_path / "two.xml")
    attach(tmp_path / "two.xml", profile, tmp_path / "one.xml")
    with closing(StudioSession(tmp_path / "one.xml")) as meant:
        assert meant.joint == "lid"
    with closing(StudioSession(tmp_path / "two.xml", "knob")) as meant:
        assert meant.joint == "knob"


def test_a_bad_upload_is_one_sentence_and_leaves_nothing(session):
    for content, words in ((b"time,position\n0,0\n", "samples"), (b"\xff\xfe", "not a UTF-8")):
        with pytest.raises(JodaError, match=words) as error:
            session.upload("../../bad.csv", content)
        assert str(error.value).startswith("bad.csv")
        assert session.runs == ()
    good = "time,position\n" + "".join(f"{k / 100},{0.3 + k / 100}\n" for k in range(50))
    session.upload("run.csv", good.encode())
    with pytest.raises(JodaError, match="is there already; give it another name"):
        session.upload("run.csv", good.encode())


# --- what the model does


def test_motions_are_those_of_simulate(session, profile, tmp_path):
    path = session.written(profile)
    for asked in ({"release": 0.7}, {"hand": True}):
        shown = simulated(path, "lid", **asked)
        run = simulate(path, "lid", output=tmp_path / "run.csv", force=True, **asked).run
        assert np.array_equal(shown.position, run.position)
        assert np.array_equal(shown.force, run.force)
    with pytest.raises(Outdated):
        simulated(path, "lid", lambda: True, hand=True)


def test_errors_are_those_of_compare(session, profile, tmp_path):
    rng = np.random.default_rng(0)
    for name, start in (("a.csv", 1.2), ("b.csv", 0.7)):
        run = simulate(session.scene, "lid", release=start, duration=1, output=tmp_path / name).run
        run.position[:] += 1e-3 * rng.normal(size=len(run.position))
        write_run(tmp_path / name, run)
        session.add_run(name)
    for scene in (session.scene, session.written(profile)):
        shown, told = (
            replayed(scene, "lid", session.runs, True),
            compare(scene, "lid", session.runs),
        )
        assert shown.runs == unexplained(told)
        assert (shown.rmse, shown.rmse_window, shown.noise_floor) == (
            told.rmse,
            told.rmse_window,
            told.noise_floor,
        )
    with pytest.raises(JodaError, match=r"is there already\.$"):
        session.add_run("a.csv")


def test_the_newest_profile_wins(session, profile):
    told = []

    async def dragged():
        live = Live(session, told.append)
        live.refresh()
        while "rest" not in told:
            await asyncio.sleep(0.02)
        opened = live.found["release"], live.found["hand"]
        for depth in (1.0, 2.0, 30.0):
            session.edit(edits.moved(profile, LATCH, 0.5, depth))
            live.refresh()
            await asyncio.sleep(0.01)
        while live.busy:
            await asyncio.sleep(0.02)
        return live, opened

    live, opened = asyncio.run(dragged())
    assert not live.failed
    path = session.written(session.profile)
    for stage, asked in (("release", {"release": 0.75}), ("hand", {"hand": True})):
        shown = live.found[stage]
        assert np.array_equal(shown.position, simulated(path, "lid", **asked).position)
    assert (live.before["release"], live.before["hand"]) == opened


def test_a_stopped_simulation_ends_and_leaves_nothing(session):
    async def stopped():
        live = Live(session, lambda what: None)
        live.refresh()
        live.stop()
        while live.busy:
            await asyncio.sleep(0.01)
        return live.found

    assert asyncio.run(stopped()) == {}


def test_what_cannot_be_simulated_is_told(session):
    told = []

    async def told_why():
        live = Live(session, told.append)
        live.start = 7.0
        live.refresh()
        while live.busy:
            await asyncio.sleep(0.02)
        return live

    live = asyncio.run(told_why())
    assert "outside the range of joint 'lid'" in live.failed["release"]
    assert "release" not in live.found
    assert "hand" in live.found


# --- what is seen


def test_solids_stand_where_mujoco_has_them(session):
    model, number = session.model, session.number
    seen = shape(model, number)
    assert sorted(solid.moves for solid in seen.solids) == [False, True, True]
    data = mujoco.MjData(model)
    for position in (0.0, 0.4, 1.5):
        data.qpos[model.jnt_qposadr[number]] = position
        mujoco.mj_forward(model, data)
        red = next(solid for solid in seen.solids if solid.rgba == (1, 0, 0, 1))
        rotation, shift = seen.pose(position)
        corners = red.triangles.reshape(-1, 3) @ rotation.T + shift
        geom = 2
        local = (corners - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)
        assert np.abs(np.abs(local) - model.geom_size[geom]).max() < 1e-9


@pytest.mark.parametrize(
    ("geom", "volume"),
    [
        ('type="box" size=".1 .2 .3"', 8 * 0.1 * 0.2 * 0.3),
        ('type="sphere" size=".2"', 4 / 3 * np.pi * 0.2**3),
        ('type="ellipsoid" size=".1 .2 .3"', 4 / 3 * np.pi * 0.1 * 0.2 * 0.3),
        ('type="cylinder" size=".1 .3"', np.pi * 0.1**2 * 0.6),
        ('type="capsule" size=".1 .3"', np.pi * 0.1**2 * 0.6 + 4 / 3 * np.pi * 0.1**3),
        ('type="mesh" mesh="m"', 0.1**3 / 6),
    ],
)
def test_surfaces_are_closed_and_look_outwards(geom, volume):
    """By the divergence theorem, the signed volume under the triangles is the solid's."""
    text = f"""<mujoco><asset><mesh name="m" vertex="0 0 0 .1 0 0 0 .1 0 0 0 .1"/></asset>
    <worldbody><body><joint range="0 1"/><geom {geom}/></body></worldbody></mujoco>"""
    solid = shape(mujoco.MjModel.from_xml_string(text), 0).solids[0]
    a, b, c = solid.triangles.transpose(1, 0, 2)
    assert np.sum(a * np.cross(b, c)) / 6 == pytest.approx(volume, rel=0.03)
    assert len(solid.stl()) == 84 + 50 * len(solid.triangles)


def test_an_editor_shows_values_in_a_fitting_unit(session):
    view = charts.editor(session.opened, session.opened, "damping", 0)
    assert view["ylabel"] == "mN·m·s/rad"
    assert [handle["y"] for handle in view["handles"]] == pytest.approx([50, 50])
    assert [line["kind"] for line in view["lines"]] == ["sum"]
    changed = edits.moved(session.opened, edits.Handle("damping", 0, 1), 1, 0.2)
    view = charts.editor(changed, session.opened, "damping", 0)
    assert [line["kind"] for line in view["lines"]] == ["ghost", "sum"]
    json.dumps(view, allow_nan=False)


def hand_shown(*samples):
    """Ends of the vertical axis of a hand's chart, given positions (rad) and forces (N·m)."""
    position, force = np.array(samples, float).T
    motion = Motion(np.arange(len(force)), position, np.zeros(len(force)), force)
    chart = charts.hand(motion, None, Joint(name="lid", type="hinge", range=(0, 2), unit="rad"))
    json.dumps(chart, allow_nan=False)
    if chart["yAxis"]["min"] is None:
        return None
    return chart["yAxis"]["min"], chart["yAxis"]["max"]


def test_a_knock_at_the_end_leaves_the_frame_of_the_hands_chart():
    way = [(q, 3) for q in np.linspace(0.1, 1.9, 50)] + [(1.0, -4), (0.02, 7)]
    low, high = hand_shown(*way)
    assert (low, high) == (-5, 10)
    assert hand_shown(*way, (1.995, -90), (2.001, -200), (-0.001, 80)) == (low, high)
    assert hand_shown(*way, (1.98, -90))[0] < -90
    assert hand_shown((1, 0), (1.5, 0)) is None
    assert hand_shown((0, 5), (2, -5)) is None


# --- who may ask, and what is answered


PORT = 8642
HERE = f"127.0.0.1:{PORT}"
OTHERS = {
    "another host": {"host": "example.org:8642"},
    "another port": {"host": "127.0.0.1:9000"},
    "no port": {"host": "127.0.0.1"},
    "a longer host": {"host": "127.0.0.1.example.org:8642"},
    "a user": {"host": "me@127.0.0.1:8642"},
    "no host": {"host": ""},
    "a page elsewhere": {"origin": "https://example.org"},
    "a page at another port": {"origin": "http://127.0.0.1:9000"},
    "a page at another name": {"origin": f"http://localhost:{PORT}"},
    "a page of nowhere": {"origin": "null"},
    "no token": {"token": ""},
    "another token": {"token": "x" * 43},
    "a token with more behind": {"more": "x"},
    "a cookie of another port": {"port": 9000},
}


def asked(guard, kind="http", host=HERE, origin=None, port=PORT, token=None, more="", query=""):
    """What the guard sends, and what it lets through."""
    token = guard.address.partition("token=")[2] if token is None else token
    cookie = f"other; joda_studio_{port}={token}{more}; theme=[dark]"
    pairs = {"Host": host, "Origin": origin, "Cookie": cookie}
    headers = [(name.encode(), value.encode()) for name, value in pairs.items() if value]
    scope = {"type": kind, "path": "/", "headers": headers, "query_string": query.encode()}
    reached, sent = [], []

    async def application(scope, receive, send):
        reached.append(scope)
        await send({"type": "http.response.start", "status": 200, "headers": []})

    async def receive():
        return {"type": f"{kind}.connect"}

    async def send(message):
        sent.append(message)

    asyncio.run(guard.protecting(application)(scope, receive, send))
    return sent, reached


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize("other", OTHERS)
def test_what_others_ask_reaches_nothing(other, kind):
    sent, reached = asked(Guard(PORT), kind, **OTHERS[other])
    assert not reached
    if kind == "websocket":
        assert sent == [{"type": "websocket.close", "code": 1008}]
    else:
        assert sent[0]["status"] == 403
        said = sent[1]["body"].decode()
        assert said.startswith("joda studio") and said.endswith(".\n") and said.count("\n") == 1


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize("name", ["127.0.0.1", "localhost"])
def test_the_studios_own_page_may_ask(name, kind):
    host = f"{name}:{PORT}"
    sent, reached = asked(Guard(PORT), kind, host=host, origin=f"http://{host}")
    assert len(reached) == 1
    assert (b"x-frame-options", b"DENY") in sent[0]["headers"]


def test_the_address_gives_the_browser_a_cookie_once():
    guard = Guard(PORT)
    address, _, query = guard.address.partition("?")
    assert address == f"http://{HERE}/" and len(query) > 40
    sent, reached = asked(guard, token="", query=query)
    headers = dict(sent[0]["headers"])
    assert not reached and sent[0]["status"] == 303 and headers[b"location"] == b"/"
    value, *rules = headers[b"set-cookie"].decode().split("; ")
    assert value == f"joda_studio_{PORT}={query.removeprefix('token=')}"
    assert set(rules) == {"Path=/", "HttpOnly", "SameSite=Strict"}
    for kind, wrong in (("http", query + "x"), ("http", "token=%ff"), ("websocket", query)):
        assert not asked(guard, kind, token="", query=wrong)[1]
    assert Guard(PORT).address != guard.address


@pytest.mark.parametrize("name", ["..", "../../evil.csv", "a\0b.csv", "\x1b[2J.csv", "x" * 999])
def test_a_name_that_is_handed_over_is_no_path(session, name):
    before = set(session.folder.path.rglob("*"))
    samples = "".join(f"{k / 50},{0.5 + 0.3 * np.sin(k / 9):.5f}\n" for k in range(99))
    session.upload(name, f"time,position\n{samples}".encode())
    (run,) = session.runs
    assert run.parent == session.scratch("runs") and set(session.folder.path.rglob("*")) == before
    assert plain(run.name) == run.name and len(run.name) < 200


def test_a_taken_port_is_told():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(JodaError, match="cannot be used: it is taken, or not yours; choose"):
            free_port(port)
    assert free_port(None) > 0


def test_what_the_command_raises_in_the_child_is_raised(session, tmp_path):
    asked = Work().diagnose(session.scene, "lid", (tmp_path / "no.csv",), tmp_path / "d", print)
    with pytest.raises(JodaError, match=r"no\.csv: cannot be read"):
        asyncio.run(asked)


@pytest.mark.slow
def test_runs_of_a_driven_joint_are_for_who_says_that_it_was_off(session, tmp_path):
    motor = '<actuator><motor name="servo" joint="lid"/></actuator></mujoco>'
    scene = tmp_path / "driven.xml"
    scene.write_text(LID.replace("</mujoco>", motor))
    run = simulate(session.scene, "lid", release=1.1, duration=2, output=tmp_path / "a.csv").run
    noisy = run.position + 1e-3 * np.random.default_rng(1).normal(size=len(run.position))
    write_run(tmp_path / "a.csv", replace(run, position=noisy, forced=False))
    with (
        closing(StudioSession(scene)) as opened,
        pytest.raises(JodaError, match=r"'servo' acts on joint 'lid'.* with --passive"),
    ):
        opened.add_run("a.csv")
    with closing(StudioSession(scene, passive=True)) as opened:
        opened.add_run("a.csv")
        shown = replayed(scene, "lid", opened.runs, True, passive=True)
        assert shown.runs == unexplained(compare(scene, "lid", opened.runs, passive=True))
        work, output = Work(), tmp_path / "d.json"
        asked = work.diagnose(scene, "lid", opened.runs, output, lambda *told: None, True)
        found = asyncio.run(asked)
        assert found["joint"] == "lid" and found["verdict"]
    with pytest.raises(JodaError, match="with --passive"):
        asyncio.run(Work().diagnose(scene, "lid", opened.runs, output, lambda *told: None))


def test_what_else_goes_wrong_in_the_child_is_for_the_terminal():
    with pytest.raises(JodaError, match="nothing failed; the terminal says why"):
        asyncio.run(Work()._ask({"do": "nothing"}, print))


def test_one_thing_is_computed_at_a_time(session, tmp_path):
    async def twice():
        work = Work()
        again = [work.diagnose(session.scene, "lid", (), tmp_path / "d", print) for _ in range(2)]
        return await asyncio.gather(*again, return_exceptions=True)

    sentences = map(str, asyncio.run(twice()))
    assert "something is being computed already; wait for it or stop it." in sentences


def test_the_child_can_be_stopped(session, tmp_path):
    simulate(session.scene, "lid", release=1.2, output=tmp_path / "a.csv")

    async def stopped():
        work = Work()
        done = work.diagnose(
            session.scene, "lid", (tmp_path / "a.csv",), tmp_path / "d", lambda *_: work.stop()
        )
        with pytest.raises(Stopped):
            await done
        assert not work.busy

    asyncio.run(stopped())


def test_mistakes_are_told_before_a_page_is_served(tmp_path):
    pytest.importorskip("nicegui")
    (tmp_path / "lid.xml").write_text(LID)
    with pytest.raises(JodaError, match="no such file"):
        studio(tmp_path / "no.xml")
    with pytest.raises(JodaError, match="no such folder; give the project's folder"):
        studio(tmp_path / "lid.xml", folder=tmp_path / "no")
    with pytest.raises(JodaError, match="is no file name"):
        studio(tmp_path / "lid.xml", runs=["a\0.csv"])
    with pytest.raises(JodaError, match="lies outside the project folder"):
        studio(tmp_path / "lid.xml", runs=[tmp_path.parent / "a.csv"])


def test_without_nicegui_it_says_what_to_install(tmp_path):
    (tmp_path / "lid.xml").write_text(LID)
    code = (
        "import sys, importlib.util as u; real = u.find_spec\n"
        "u.find_spec = lambda name, *rest: None if name == 'nicegui' else real(name, *rest)\n"
        "from joda.cli import main; sys.argv = ['joda', 'studio', 'lid.xml']; main()"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True
    )
    assert result.returncode == 2
    assert result.stderr == (
        'joda: joda studio needs NiceGUI: install it with: pip install "joda[studio]"\n'
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["joda", "joda.cli", "joda.commands.studio.session", "joda.commands.studio.work"]
)
def test_nothing_else_imports_the_page_library(name):
    code = f"import {name}, sys; sys.exit('nicegui' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
