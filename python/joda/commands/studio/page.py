"""The page: what it is made of, what is at its top, and how it is served."""

import asyncio
from collections.abc import Callable
from pathlib import Path

from nicegui import app, background_tasks, ui
from starlette.responses import Response

from joda.commands.studio.diagnosis_panel import DiagnosisPanel
from joda.commands.studio.editors import Editors
from joda.commands.studio.guard import HOST, Guard
from joda.commands.studio.shared import Shared, say, user_errors_shown
from joda.commands.studio.solids import Shape, shape
from joda.commands.studio.trajectories import Trajectories
from joda.commands.studio.view3d import View3D
from joda.errors import JodaError
from joda.plain import plain

HERE = Path(__file__).parent
BLUE = "#1f5fbf"

KEYS = """
<script>
window.unsaved = false;
window.addEventListener("beforeunload", (event) => {
  if (window.unsaved) { event.preventDefault(); event.returnValue = ""; }
});
window.addEventListener("keydown", (event) => {
  if (!(event.ctrlKey || event.metaKey) || event.altKey) return;
  const typing = ["INPUT", "TEXTAREA"].includes(document.activeElement.tagName);
  const key = event.key.toLowerCase();
  const what = key === "s" ? "save" : typing ? null : key === "y" || (key === "z" && event.shiftKey)
    ? "redo" : key === "z" ? "undo" : null;
  if (what) { event.preventDefault(); emitEvent("studio_key", what); }
});
</script>
"""


class Page:
    """One browser tab."""

    def __init__(self, shared: Shared, solid: Shape) -> None:
        """Builds the page; Args: the studio, and what its scene looks like."""
        self._shared = shared
        ui.colors(primary=BLUE)
        ui.add_css(HERE / "studio.css")
        ui.add_body_html(KEYS)
        with ui.element("div").classes("whole"):
            self._header()
            with ui.element("main"):
                with ui.element("div").classes("column"):
                    self._view = ui.element("div").classes("viewing")
                    DiagnosisPanel(shared)
                with ui.element("div").classes("column"):
                    editors = Editors(shared)
                with ui.element("div").classes("column"):
                    Trajectories(shared)
        with self._view:
            View3D(shared, solid, editors.show_position)
        self._saving = _SaveDialog(shared)
        ui.on("studio_key", lambda event: self._key(event.args))
        shared.news.subscribe(self._heard)
        self._heard("profile")

    def _header(self) -> None:
        session = self._shared.session
        joint = session.opened.joint
        lo, hi = joint.range
        with ui.element("header").classes("top"):
            ui.label("joda studio").classes("brand")
            ui.label(plain(session.scene.name)).classes("file").tooltip(plain(str(session.scene)))
            ui.label(
                f"{plain(joint.name)} · {joint.type} · {lo:.4g} to {hi:.4g} {joint.unit}".replace(
                    "-", "\N{MINUS SIGN}"
                )
            ).classes("aside")
            ui.element("div").classes("space")
            self._state = ui.label().classes("aside state")
            self._undo = ui.button(icon="undo", on_click=lambda: self._key("undo"))
            self._undo.props('flat round dense aria-label="undo"').tooltip("undo (Ctrl+Z)")
            self._redo = ui.button(icon="redo", on_click=lambda: self._key("redo"))
            self._redo.props('flat round dense aria-label="redo"').tooltip("redo (Ctrl+Shift+Z)")
            save = ui.button("Save as…", on_click=lambda: self._key("save"))
            save.props("unelevated dense no-caps").classes("save").tooltip("Ctrl+S")

    def _key(self, what: str) -> None:
        if what == "save":
            self._saving.open()
        elif what in ("undo", "redo"):
            self._shared.step(what)

    def _heard(self, what: str) -> None:
        if what != "profile":
            return
        session = self._shared.session
        self._undo.set_enabled(bool(session.timeline.past))
        self._redo.set_enabled(bool(session.timeline.future))
        self._state.set_text("unsaved changes" if session.unsaved else "")
        ui.run_javascript(f"window.unsaved = {str(session.unsaved).lower()}")


class _SaveDialog:
    """Asks for a name, and once more before a file is replaced."""

    def __init__(self, shared: Shared) -> None:
        self._shared = shared
        with ui.dialog() as self._dialog, ui.card().classes("asking"):
            ui.label("Save as").classes("title")
            self._name = ui.input(
                "Scene, in the project folder", value=f"{shared.session.scene.stem}_studio.xml"
            )
            self._name.props("dense outlined autofocus").classes("save-name")
            self._name.on("keydown.enter", self._write).on_value_change(lambda: self._ask(False))
            ui.label("The profile goes beside it, to NAME.composed.json.").classes("aside")
            self._exists = ui.label().classes("outcome")
            with ui.element("div").classes("posing"):
                self._yes = ui.button("Save", on_click=self._write).props("unelevated no-caps")
                self._yes.classes("save-yes")
                ui.button("Cancel", on_click=self._dialog.close).props("flat no-caps")
        self._ask(False)

    def open(self) -> None:
        """Shows it."""
        self._ask(False)
        self._dialog.open()

    def _ask(self, replace: bool) -> None:
        """Whether the file is there and is to be replaced."""
        self._replace = replace
        self._exists.set_visibility(replace)
        self._exists.set_text(f"{self._name.value} exists already. Replace it?")
        self._yes.set_text("Replace" if replace else "Save")

    @user_errors_shown
    def _write(self) -> None:
        name, session = self._name.value, self._shared.session
        if not self._replace and session.taken(name):
            self._ask(True)
            return
        notes = session.save(name, force=self._replace)
        self._dialog.close()
        self._shared.news.emit("profile")
        say(" ".join([f"Saved {name}.", *notes]), "positive")


def serve(shared: Shared, port: int, browser: bool, ready: Callable[[str], None]) -> None:
    """Serves the page on this machine only, until it is interrupted.

    Args:
        shared: the studio.
        port: that is free.
        browser: whether to open one.
        ready: told the page's address, with its token, when it answers.
    """
    guard = Guard(port)
    solid = shape(shared.session.model, shared.session.number)
    files = [one.stl() for one in solid.solids]

    @app.get("/solids/{number}.stl")
    def stl(number: int) -> Response:
        if not 0 <= number < len(files):
            return Response(status_code=404)
        return Response(files[number], media_type="model/stl")

    async def announce() -> None:
        while True:
            try:
                _, writer = await asyncio.open_connection(HOST, port)
            except OSError:
                await asyncio.sleep(0.05)
                continue
            writer.close()
            ready(guard.address)
            return

    def begin() -> None:
        shared.live.refresh()
        background_tasks.create(announce(), name="announce")

    def end() -> None:
        shared.live.stop()
        shared.work.stop()

    app.on_startup(begin)
    app.on_shutdown(end)
    app.add_middleware(guard.protecting)
    try:
        ui.run(
            root=lambda: Page(shared, solid) and None,
            host=HOST,
            port=port,
            title=f"{plain(shared.session.scene.name)} · joda studio",
            show=browser and guard.address.removeprefix(f"http://{HOST}:{port}"),
            reload=False,
            show_welcome_message=False,
            uvicorn_logging_level="critical",  # a second Ctrl-C would be a traceback
            tailwind=False,
            favicon=HERE / "icon.svg",
            reconnect_timeout=20.0,
            cache_control_directives="private, no-cache",  # else a refusal is kept for a year
        )
    except (KeyboardInterrupt, asyncio.CancelledError):
        pass
    except SystemExit:
        raise JodaError(f"--port {port} cannot be used: it was taken just now.") from None
