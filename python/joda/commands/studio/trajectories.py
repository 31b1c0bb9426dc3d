"""The right of the page: what the joint does, beside how it was and beside measured runs."""

import math
from typing import Any

from nicegui import events, ui

from joda.commands.studio import charts
from joda.commands.studio.motions import Replayed
from joda.commands.studio.shared import Shared, user_errors_shown
from joda.plain import plain


class Trajectories:
    """Release, hand, and measured runs."""

    def __init__(self, shared: Shared) -> None:
        """Builds the column where the page is being built."""
        self._shared, self._number = shared, 0
        self._charts: dict[str, ui.echart] = {}
        for name, title in (("release", "Let go"), ("hand", "Opened and shut by a hand")):
            with ui.element("section").classes(f"card chart {name}"):
                with ui.element("header"):
                    ui.label(title).classes("title")
                    if name == "release":
                        self._from = ui.label().classes("aside")
                self._add_chart(name)
        with ui.element("section").classes("card chart replay"):
            with ui.element("header"):
                ui.label("Measured runs").classes("title")
                ui.element("div").classes("space")
                add = ui.button("Add runs", icon="add", on_click=self._open)
                add.props("flat dense no-caps size=sm").classes("add-runs")
            self._told = ui.label().classes("aside numbers")
            self._runs = ui.element("div").classes("chips")
            self._add_chart("replay")
        self._dialog = _RunDialog(shared)
        shared.news.subscribe(self._heard)
        for what in ("release", "hand", "replay", "runs"):
            self._heard(what)

    def _add_chart(self, name: str) -> None:
        chart = ui.echart(
            charts.release(None, None, self._shared.session.opened.joint), renderer="svg"
        )
        self._charts[name] = chart.classes(f"drawn {name}")

    def _open(self) -> None:
        self._dialog.open()

    def _heard(self, what: str) -> None:
        live, joint = self._shared.live, self._shared.session.opened.joint
        if what in ("release", "hand"):
            draw = charts.release if what == "release" else charts.hand
            options = draw(live.found.get(what), live.before.get(what), joint)
            self._show(what, options, live.failed.get(what))
            self._from.set_text(f"from {live.start:.4g} {joint.unit}, at rest")
        elif what == "replay":
            self._show_replay()
        elif what == "runs":
            self._number = min(self._number, max(len(self._shared.session.runs) - 1, 0))
            self._list()
            self._show_replay()

    def _show(self, name: str, options: dict[str, Any], failed: str | None) -> None:
        chart = self._charts[name]
        if failed:
            style = {"text": failed, "fill": charts.NOW, "width": 320, "overflow": "break"}
            graphic = {"type": "text", "left": "center", "top": "middle", "style": style}
            options = {"graphic": [graphic]}
        chart.options.clear()
        chart.options.update(options)
        chart.update()

    def _show_replay(self) -> None:
        live = self._shared.live
        now: Replayed | None = live.found.get("replay")
        before = live.before.get("replay")
        failed = live.failed.get("replay")
        timed = [run.name for run in now.measured.runs] if now else []
        chosen = self._chosen()
        empty = not (failed or chosen in timed)
        self._charts["replay"].set_visibility(not empty)
        if failed or (now and chosen in timed):
            options = {} if failed or not now else charts.run(now, before, timed.index(chosen))
            self._show("replay", options, failed)
        self._told.set_text(_numbers(now, before, self._shared.session.opened.joint.unit))

    def _chosen(self) -> str:
        runs = self._shared.session.runs
        return runs[self._number].name if runs else ""

    def _list(self) -> None:
        self._runs.clear()
        with self._runs:
            if not self._shared.session.runs:
                ui.label(
                    "Add measured runs to see them beside the model, and to ask what it lacks."
                ).classes("aside")
            for number, path in enumerate(self._shared.session.runs):
                chosen = " chosen" if number == self._number else ""
                with ui.element("span").classes(f"chip run{chosen}"):
                    name = ui.label(plain(path.stem)).tooltip(plain(path.name))
                    name.on("click", lambda k=number: self._choose(k))
                    drop = ui.button(icon="close", on_click=lambda p=path: self._drop(p))
                    drop.props("flat round size=xs").tooltip("leave this run out")

    def _choose(self, number: int) -> None:
        self._number = number
        self._list()
        self._show_replay()

    def _drop(self, path: Any) -> None:
        self._shared.session.drop_run(path)
        self._shared.measured()


def _numbers(now: Replayed | None, before: Replayed | None, unit: str) -> str:
    """Errors as `joda compare` tells them, as opened → now."""
    if now is None or not now.runs:
        return " ".join(now.notes) if now else ""

    def change(name: str) -> str:
        value = getattr(now, name)
        first = getattr(before, name) if before else value
        shown = "…" if math.isnan(value) else f"{value:.3g}"
        return shown if f"{first:.3g}" == shown or math.isnan(first) else f"{first:.3g} → {shown}"

    return (
        f"RMS: free run {change('rmse')} {unit} · segments of 0.4 s {change('rmse_window')} "
        f"{unit} · noise {now.noise_floor:.2g} {unit}"
    )


class _RunDialog:
    """Runs from the project's folder, or handed over by the browser."""

    def __init__(self, shared: Shared) -> None:
        self._shared = shared
        with ui.dialog() as self._dialog, ui.card().classes("asking"):
            ui.label("Add measured runs").classes("title")
            ui.label(
                "CSV files with time (s), position (rad or m) and perhaps force (N·m or N)."
            ).classes("aside")
            with ui.element("div").classes("posing"):
                self._name = ui.input("File in the project folder").props("dense outlined")
                self._name.classes("run-name").on(
                    "keydown.enter", lambda: self._add(self._name.value)
                )
                ui.button("Add", on_click=lambda: self._add(self._name.value)).props("no-caps")
            self._files = ui.element("div").classes("chips files")
            upload = ui.upload(
                label="…or drop files here", multiple=True, auto_upload=True,
                on_upload=self._uploaded, max_file_size=200_000_000,
            )  # fmt: skip
            upload.props('accept=".csv" flat bordered').classes("upload")
            ui.button("Close", on_click=self._dialog.close).props("flat no-caps")

    def open(self) -> None:
        """Shows it, with the files that there are."""
        self._list()
        self._dialog.open()

    def _list(self) -> None:
        session = self._shared.session
        self._files.clear()
        with self._files:
            for name in session.folder.listed(".csv"):
                if session.folder.path / name not in session.runs:
                    file = ui.element("span").classes("chip")
                    with file:
                        ui.label(plain(name)).on("click", lambda n=name: self._add(n))

    @user_errors_shown
    def _add(self, name: str) -> None:
        if name:
            self._shared.session.add_run(name)
            self._name.set_value("")
            self._list()
            self._shared.measured()

    @user_errors_shown
    async def _uploaded(self, event: events.UploadEventArguments) -> None:
        self._shared.session.upload(event.file.name, await event.file.read())
        self._shared.measured()
