"""The studio in a real browser: headless Chromium, with WebGL in software."""

import io
import json
import math
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from contextlib import closing
from types import SimpleNamespace
from urllib.parse import urlsplit

import numpy as np
import pytest
from matplotlib.image import imread

from joda import Profile, add, attach, compare, diagnose, simulate
from joda.commands.studio.session import StudioSession
from joda.component import Component
from joda.measured.run_files import write_run
from joda.measured.runs import Run

pytest.importorskip("selenium", reason='needs selenium: pip install ".[test]"')
pytest.importorskip("nicegui", reason='needs NiceGUI: pip install ".[studio]"')

from selenium import webdriver
from selenium.common.exceptions import (
    ElementClickInterceptedException,
    ElementNotInteractableException,
    StaleElementReferenceException,
)
from selenium.webdriver import ActionChains, Keys
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
DRIVER = shutil.which("chromedriver")
if not (CHROMIUM and DRIVER):
    pytest.skip("needs chromium and chromedriver (chromium-driver)", allow_module_level=True)

FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--window-size=1500,960",
)  # fmt: skip
PATIENCE = 240
EFFECT = "constant_friction_hinge"
NAME = "input[aria-label='Scene, in the project folder']"
LID = """\
<mujoco model="box">
  <compiler angle="radian"/>
  <worldbody>
    <geom type="box" size=".3 .2 .1" pos="0 0 -.12" rgba=".7 .66 .6 1"/>
    <body name="lid" pos="-.3 0 0">
      <joint name="lid" axis="0 -1 0" range="0 1.5" damping="0.05"/>
      <geom type="box" size=".3 .2 .01" pos=".3 0 0" mass=".5" rgba=".8 .75 .7 1"/>
    </body>
  </worldbody>
</mujoco>
"""


def falling(scene, start, path):
    """A run of the lid that falls shut, as an encoder sees it."""
    run = simulate(scene, "lid", release=start, duration=0.5, output=path.with_suffix(".sim")).run
    kept = np.flatnonzero(run.position > 0.1)[::5]
    noise = 1e-3 * np.random.default_rng(1).normal(size=len(kept))
    position = run.position[kept] + noise
    write_run(path, Run(path.name, run.time[kept], position, None, run.force[kept], forced=False))


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A lid whose model lacks friction, and two runs of the true one."""
    folder, elsewhere = tmp_path_factory.mktemp("project"), tmp_path_factory.mktemp("elsewhere")
    model, true = folder / "model.xml", elsewhere / "true.xml"
    model.write_text(LID)
    rubbing = Component(label="hidden", interval=(0, 1), x=(0, 1), y=(0.3, 0.3))
    with closing(StudioSession(model)) as session:
        attach(model, session.opened.with_component("friction", rubbing), true)
    runs = [folder / "far.csv", folder / "near.csv"]
    for path, start in zip(runs, (1.2, 0.8), strict=True):
        falling(true, start, path)
    (elsewhere / "secret.csv").write_text(runs[0].read_text())
    (elsewhere / "bad.csv").write_text("time,position\n0,0\n1,two\n2,3\n3,4\n")
    return SimpleNamespace(folder=folder, elsewhere=elsewhere, model=model, runs=runs)


@pytest.fixture(scope="module")
def server(project):
    command = "import sys; from joda.cli import main; sys.argv[0] = 'joda'; main()"
    process = subprocess.Popen(
        [sys.executable, "-c", command, "studio", "model.xml", "--no-browser"],
        cwd=project.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        # NiceGUI serves pytest something else
        env={name: value for name, value in os.environ.items() if "PYTEST" not in name},
    )  # fmt: skip
    try:
        line = process.stdout.readline()
        assert line.startswith("http://127.0.0.1:"), line
        address = line.split()[0]
        origin = address.partition("/?")[0] + "/"
        yield SimpleNamespace(address=address, origin=origin, process=process)
    finally:
        process.kill()
        process.communicate()


@pytest.fixture(scope="module")
def browser(server, tmp_path_factory):
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for flag in (*FLAGS, f"--user-data-dir={tmp_path_factory.mktemp('chromium')}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    yield driver
    driver.quit()


@pytest.fixture(scope="module")
def page(browser, server):
    browser.get(server.address)
    found = Page(browser)
    found.until(lambda: found.drawn("release") and found.drawn("hand"))
    return found


class Page:
    """What a user sees and does."""

    def __init__(self, browser):
        self.browser = browser

    def all(self, selector):
        return self.browser.find_elements(By.CSS_SELECTOR, selector)

    def one(self, selector):
        self.until(lambda: self.all(selector))
        return self.all(selector)[0]

    def until(self, true):
        redrawn = [StaleElementReferenceException, ElementNotInteractableException]
        redrawn.append(ElementClickInterceptedException)
        wait = WebDriverWait(self.browser, PATIENCE, 0.1, ignored_exceptions=redrawn)
        return wait.until(lambda _: true())

    def text(self, selector):
        return " ".join(self.read(selector, "innerText"))

    def read(self, selector, what):
        """A property or attribute of all there, in one go: the page redraws any time."""
        code = """return Array.from(document.querySelectorAll(arguments[0]),
            (one) => one[arguments[1]] ?? one.getAttribute(arguments[1]))"""
        return self.browser.execute_script(code, selector, what)

    def clicked(self, selector):
        """Clicks on it, if it is there to be clicked on."""
        found = self.all(selector)
        if not (found and found[0].is_displayed() and found[0].is_enabled()):
            return False
        found[0].click()
        return True

    def click(self, selector):
        self.until(lambda: self.clicked(selector))

    def drawn(self, chart):
        """The paths of a chart's red line: the model as it is now."""
        return self.read(f".chart.{chart} svg path[stroke='#c8202f']", "d")

    def curve(self, channel):
        code = "return document.querySelector(arguments[0]).getAttribute('points')"
        return self.browser.execute_script(code, f".editor.{channel} polyline.sum")

    def drag(self, channel, handle, x, y):
        grip = self.one(f".editor.{channel} [data-handle='{handle}']")
        chain = ActionChains(self.browser).click_and_hold(grip)
        for _ in range(4):
            chain.move_by_offset(x / 4, y / 4).pause(0.05)
        chain.release().perform()

    def keys(self, *keys):
        chain = ActionChains(self.browser)
        for key in keys[:-1]:
            chain.key_down(key)
        chain.send_keys(keys[-1])
        for key in keys[:-1]:
            chain.key_up(key)
        chain.perform()

    def typed(self, selector, text):
        """Types it; whether the field holds it then: a dialog that opens may take the focus."""
        if not self.clicked(selector):
            return False
        self.keys(Keys.CONTROL, "a")
        ActionChains(self.browser).send_keys(text).perform()
        return self.read(selector, "value") == [text]

    def fill(self, selector, text):
        self.until(lambda: self.typed(selector, text))

    def upload(self, path):
        def sent():
            self.one("input[type='file']").send_keys(str(path))
            return True

        self.until(sent)

    def said(self, *words):
        """Waits for a message with these words, and returns it."""
        self.until(lambda: all(word in self.text(".said") for word in words))
        return self.text(".said")

    def view(self):
        """The picture of the 3D view, shape (height, width, 3)."""
        return imread(io.BytesIO(self.one(".scene canvas").screenshot_as_png))[..., :3]

    def warns(self):
        """Whether closing the page would ask first."""
        return self.browser.execute_script("return window.unsaved")

    def save(self, name):
        pressed = -math.inf

        def asked():
            nonlocal pressed
            if any(button.is_displayed() for button in self.all(".save-yes")):
                return True
            if time.monotonic() - pressed > 5.0:
                self.keys(Keys.CONTROL, "s")
                pressed = time.monotonic()
            return False

        # a dialog that is just closing may take the key, and be seen before it is gone
        self.until(lambda: asked() and self.typed(NAME, name) and self.clicked(".save-yes"))


@pytest.mark.long
def test_the_joint_is_seen_and_moves(page):
    page.until(lambda: len(np.unique(page.view().reshape(-1, 3), axis=0)) > 20)
    before, told = page.view(), page.text(".view .number")
    track = page.one(".view .q-slider")
    place = int(0.4 * track.size["width"])  # from the middle
    ActionChains(page.browser).move_to_element_with_offset(track, place, 0).click().perform()
    page.until(lambda: page.text(".view .number") != told)
    page.until(lambda: np.mean(np.abs(page.view() - before).max(axis=2) > 0.1) > 0.005)


def test_a_dragged_point_changes_the_trajectory_and_undo_brings_it_back(page):
    curve, release, hand = page.curve("damping"), page.drawn("release"), page.drawn("hand")
    page.drag("damping", "0-1", 0, -60)
    page.until(lambda: page.curve("damping") != curve)
    page.until(lambda: page.drawn("hand") not in ([], hand))
    page.until(lambda: page.text(".state") == "unsaved changes")
    assert page.read(".chart.hand svg path[stroke='#b3b8bf']", "d")  # as it was opened
    page.until(lambda: page.warns() is True)
    page.keys(Keys.CONTROL, "z")
    page.until(lambda: page.curve("damping") == curve)
    page.until(lambda: (page.drawn("release"), page.drawn("hand")) == (release, hand))
    assert page.text(".state") == ""
    page.keys(Keys.CONTROL, Keys.SHIFT, "z")
    page.until(lambda: page.text(".state") == "unsaved changes")


def test_points_are_added_removed_and_moved_by_keys(page):
    count = len(page.all(".editor.damping circle"))
    svg = page.one(".editor.damping svg")
    ActionChains(page.browser).move_to_element(svg).double_click().perform()
    page.until(lambda: len(page.all(".editor.damping circle")) == count + 1)
    before = page.curve("damping")
    page.one(".editor.damping [data-handle='0-1']").send_keys(Keys.ARROW_UP)
    page.until(lambda: page.curve("damping") != before)
    page.one(".editor.damping [data-handle='0-1']").send_keys(Keys.DELETE)
    page.until(lambda: len(page.all(".editor.damping circle")) == count)


def test_what_was_dragged_is_saved_as_attach_writes_it(page, project):
    page.save("dragged.xml")
    page.said("Saved dragged.xml")
    page.until(lambda: page.warns() is False)
    composed = project.folder / "dragged.composed.json"
    values = Profile.read(composed).channels.damping.components[0].y
    assert values[0] < values[1]
    attach(project.model, composed, project.folder / "attached.xml")
    assert (project.folder / "dragged.xml").read_bytes() == (
        project.folder / "attached.xml"
    ).read_bytes()
    for _ in range(10):
        page.keys(Keys.CONTROL, "z")
    page.until(lambda: not page.one("button[aria-label='undo']").is_enabled())


def test_nothing_is_replaced_unasked_nor_written_elsewhere(page, project):
    precious = project.folder / "precious.xml"
    precious.write_text("precious")
    page.save("precious.xml")
    page.until(lambda: "exists already" in page.text(".outcome"))
    assert precious.read_text() == "precious"
    for name in ("../out.xml", str(project.elsewhere / "out.xml"), "model.xml", "run.csv"):
        page.fill(NAME, name)
        page.click(".save-yes")
        page.said(name, "outside" if "out" in name else "must end" if "csv" in name else "at work")
    assert not (project.elsewhere / "out.xml").exists()
    assert not (project.folder.parent / "out.xml").exists()
    page.keys(Keys.ESCAPE)


def test_runs_are_loaded_and_bad_ones_are_told(page, project):
    page.click(".add-runs")
    for path in (f"../{project.elsewhere.name}/secret.csv", "nothing.csv"):
        page.fill("input[aria-label='File in the project folder']", path)
        page.keys(Keys.ENTER)
        page.said(path, "outside the project" if ".." in path else "cannot be read")
    page.upload(project.elsewhere / "bad.csv")
    page.said("bad.csv, line 3: position is 'two'")
    assert not page.all(".chip.run")
    page.upload(project.runs[0])
    page.until(lambda: len(page.all(".chip.run")) == 1)
    page.fill("input[aria-label='File in the project folder']", project.runs[1].name)
    page.keys(Keys.ENTER)
    page.until(lambda: len(page.all(".chip.run")) == 2)
    page.keys(Keys.ESCAPE)
    page.until(lambda: page.drawn("replay"))
    true = compare(project.model, "lid", project.runs)
    wanted = [f"{x:.3g}" for x in (true.rmse, true.rmse_window)] + [f"{true.noise_floor:.2g}"]
    number = r"free run (\S+) rad · segments of 0.4 s (\S+) rad · noise (\S+) rad"
    page.until(lambda: re.findall(number, page.text(".numbers")) == [tuple(wanted)])


@pytest.mark.long
def test_an_effect_is_diagnosed_added_and_saved_as_on_the_command_line(page, project):
    told = diagnose(project.model, "lid", project.runs, json=project.folder / "d.json")
    added = add(
        project.model, "lid", project.folder / "d.json", project.runs, project.folder / "cli.xml",
        effect=EFFECT,
    )  # fmt: skip
    assert added.added
    page.click("button.diagnose")
    page.until(lambda: page.all(".candidate"))
    assert told.summary in page.text(".lacks .summary")
    assert told.effects[0].explanation in page.text(".candidate")
    release = page.drawn("release")
    page.click(f"button.add-effect.{EFFECT}")
    page.until(lambda: "Added" in page.text(".lacks .outcome"))
    assert f"{added.before.window:.3g} → {added.after.window:.3g}" in page.text(".lacks .outcome")
    page.until(lambda: page.drawn("release") not in ([], release))
    page.save("studio.xml")
    page.said("Saved studio.xml")
    for one, other in (("studio.xml", "cli.xml"), ("studio.composed.json", "cli.composed.json")):
        assert (project.folder / one).read_bytes() == (project.folder / other).read_bytes()


def test_a_diagnosis_can_be_stopped(page):
    page.click("button.diagnose")
    page.click("button.stop")
    page.until(lambda: not page.one(".working").is_displayed())
    page.until(lambda: page.one("button.diagnose").is_enabled())
    assert not page.all(".candidate")


def test_nothing_was_asked_of_the_network_and_nothing_failed(page, server):
    asked = set()
    for entry in page.browser.get_log("performance"):
        message = json.loads(entry["message"])["message"]
        if message["method"] == "Network.requestWillBeSent":
            asked.add(message["params"]["request"]["url"])
    asked = {url for url in asked if not url.startswith(("data:", "blob:", "chrome"))}
    assert len(asked) > 10
    assert {url for url in asked if not url.startswith(server.origin)} == set()
    failed = [
        entry["message"] for entry in page.browser.get_log("browser") if entry["level"] == "SEVERE"
    ]
    assert failed == []


def test_it_listens_on_one_loopback_address_only(server):
    port = urlsplit(server.address).port
    socket.create_connection(("127.0.0.1", port)).close()
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.2", port))


def test_it_ends_cleanly(page, server):
    page.browser.get("about:blank")
    server.process.send_signal(signal.SIGINT)
    _, errors = server.process.communicate(timeout=60)
    assert server.process.returncode == 0
    assert errors == ""
