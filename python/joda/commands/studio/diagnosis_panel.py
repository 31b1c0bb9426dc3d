"""What the model lacks: diagnose, see the candidates, click one in."""

from typing import Any

from nicegui import ui

from joda.commands.studio.shared import Shared, user_errors_shown
from joda.diagnosis.phrases import percent


class DiagnosisPanel:
    """The panel below the 3D view."""

    def __init__(self, shared: Shared) -> None:
        """Builds the panel where the page is being built."""
        self._shared = shared
        with ui.element("section").classes("card lacks"):
            with ui.element("header"):
                ui.label("What is missing?").classes("title")
                ui.element("div").classes("space")
                self._ask = ui.button("Diagnose", on_click=self._diagnose)
                self._ask.props("unelevated dense no-caps size=sm").classes("diagnose")
            with ui.element("div").classes("working") as self._working:
                self._bar = ui.linear_progress(0.0, show_value=False).props("rounded")
                self._doing = ui.label().classes("aside")
                stop = ui.button("Stop", on_click=shared.work.stop)
                stop.props("flat dense no-caps size=sm").classes("stop")
            self._body = ui.element("div").classes("found")
        shared.news.subscribe(self._heard)
        for what in ("work", "diagnosis"):
            self._heard(what)

    @user_errors_shown
    async def _diagnose(self) -> None:
        await self._shared.diagnose()

    @user_errors_shown
    async def _add(self, effect: str) -> None:
        await self._shared.add(effect)

    def _heard(self, what: str) -> None:
        if what in ("work", "runs"):
            share, doing = self._shared.doing
            busy = self._shared.work.busy or bool(doing)
            self._working.set_visibility(busy)
            self._ask.set_enabled(not busy and bool(self._shared.session.runs))
            self._bar.props(add="indeterminate") if share is None else self._bar.props(
                remove="indeterminate"
            )
            self._bar.set_value(share or 0.0)
            self._doing.set_text(doing)
        if what in ("diagnosis", "profile", "runs"):
            self._show()

    def _show(self) -> None:
        shared = self._shared
        self._body.clear()
        with self._body:
            for sentence in shared.outcome:
                ui.label(sentence).classes("outcome")
            reported_before = bool(shared.outcome)
            if shared.diagnosis is None:
                if not reported_before:
                    ui.label(
                        "Diagnose compares the model with the runs and says which physical effect "
                        "it lacks."
                        if shared.session.runs
                        else "Add measured runs first."
                    ).classes("aside")
                return
            self._show_diagnosis(shared.diagnosis)

    def _show_diagnosis(self, diagnosis: dict[str, Any]) -> None:
        ui.label(diagnosis["summary"]).classes("summary")
        if self._shared.diagnosed != self._shared.session.timeline.present:
            ui.label("The profile was edited since; diagnose again to be sure.").classes("aside")
        for found in diagnosis["effects"]:
            with ui.element("article").classes("candidate"):
                with ui.element("div").classes("line"):
                    ui.label(percent(found["probability"])).classes("probability")
                    ui.label(found["name"]).classes("name").tooltip(found["effect"])
                    ui.element("div").classes("space")
                    before, after = found["held_out_error_before"], found["held_out_error_after"]
                    unit = diagnosis["unit"]
                    ui.label(f"{before:.2g} → {after:.2g} {unit}").classes("number").tooltip(
                        "error on held-out segments, without and with it"
                    )
                    add = ui.button(
                        "Add", on_click=lambda name=found["effect"]: self._add(name)
                    ).props("outline dense no-caps size=sm")
                    add.classes(f"add-effect {found['effect']}")
                ui.label(found["explanation"]).classes("aside")
        for sentence in filter(None, (diagnosis["next_experiment"], *diagnosis["notes"])):
            ui.label(sentence).classes("aside")
