"""The middle of the page: an editor for each channel, and the effects beyond them."""

from typing import Any

import numpy as np
from nicegui import ui

from joda.commands.studio import charts, edits
from joda.commands.studio.curves import Curves
from joda.commands.studio.shared import Shared, user_errors_shown
from joda.profile import CHANNELS, Channel, Profile


class Editors:
    """Draws the profile, and hands on what the user does to it."""

    def __init__(self, shared: Shared) -> None:
        """Builds the column where the page is being built."""
        self._shared = shared
        self._editors = {name: _Editor(shared, name) for name in CHANNELS}
        with ui.element("section").classes("card effects") as self._card:
            ui.label("Effects").classes("title")
            self._effects = ui.element("div").classes("chips")
        self._listed: tuple[Any, ...] | None = None
        shared.news.subscribe(self._heard)
        self._heard("profile")

    def show_position(self, position: float) -> None:
        """Shows where the joint is, rad or m."""
        for editor in self._editors.values():
            editor.curves.show_position(position)

    def _heard(self, what: str) -> None:
        if what != "profile":
            return
        profile = self._shared.session.profile
        for editor in self._editors.values():
            editor.show(profile)
        if profile.effects == self._listed:
            return
        self._listed = profile.effects
        self._card.set_visibility(bool(profile.effects))
        self._effects.clear()
        with self._effects:
            for number, effect in enumerate(profile.effects):
                with ui.element("span").classes("chip"):
                    ui.label(effect.described())
                    remove = ui.button(icon="close", on_click=lambda k=number: self._remove(k))
                    remove.props("flat round size=xs").tooltip("remove this effect")

    def _remove(self, number: int) -> None:
        self._shared.edit(edits.without_effect(self._shared.session.timeline.present, number))


class _Editor:
    """The editor of one channel."""

    def __init__(self, shared: Shared, channel: str) -> None:
        self._shared, self._channel = shared, channel
        self._selected = 0
        self._last = max(len(getattr(shared.session.profile.channels, channel).components) - 1, 0)
        self._listed: tuple[Any, ...] | None = None
        found = shared.session.context
        balance = np.array(found.positions), -np.array(found.gravity_force)
        self._gravity = balance if channel == "conservative" else None
        with ui.element("section").classes(f"card editor {channel}"):
            with ui.element("header"):
                ui.label(charts.TITLES[channel]).classes("title")
                self._chips = ui.element("div").classes("chips")
                if self._gravity is not None and self._gravity[1].any():
                    ui.label("- - balances gravity").classes("aside balance")
            self.curves = Curves(self._view(shared.session.profile), user_errors_shown(self._heard))

    def _view(self, profile: Profile) -> dict[str, Any]:
        opened = self._shared.session.opened
        return charts.editor(profile, opened, self._channel, self._selected, self._gravity)

    def show(self, profile: Profile) -> None:
        """Shows the channel of a profile."""
        own: Channel = getattr(profile.channels, self._channel)
        last = max(len(own.components) - 1, 0)
        self._selected = last if last > self._last else min(self._selected, last)  # a new one
        self._last = last
        self.curves.show(self._view(profile))
        listed = (self._selected, *(part.label for part in own.components))
        if listed == self._listed:
            return
        self._listed = listed
        self._chips.clear()
        with self._chips:
            for number, part in enumerate(own.components):
                chosen = " chosen" if number == self._selected else ""
                chip = ui.element("span").classes(f"chip{chosen}")
                with chip:
                    name = ui.label(part.label or f"component {number + 1}")
                    name.on("click", lambda k=number: self._select(k))
                    remove = ui.button(icon="close", on_click=lambda k=number: self._remove(k))
                    remove.props("flat round size=xs").tooltip("remove this component")

    def _select(self, number: int) -> None:
        self._selected = number
        self.show(self._shared.session.profile)

    def _remove(self, number: int) -> None:
        present = self._shared.session.timeline.present
        self._shared.edit(edits.without_component(present, self._channel, number))

    def _heard(self, event: str, what: dict[str, Any]) -> None:
        """What the user does to the curves."""
        session = self._shared.session
        present = session.timeline.present
        own: Channel = getattr(present.channels, self._channel)
        number = int(what.get("component", self._selected))
        if "point" in what and (
            number >= len(own.components) or what["point"] >= len(own.components[number].x)
        ):
            return  # of a curve that is no longer there
        lo, hi = present.joint.range
        s = (float(what.get("x", lo)) - lo) / (hi - lo)
        y = float(what.get("y", 0.0)) / self.curves.factor
        handle = edits.Handle(self._channel, number, int(what.get("point", 0)))
        if event == "select":
            self._select(number)
        elif event == "remove":
            self._shared.edit(edits.removed(present, handle))
        elif event == "insert" and own.components:
            self._shared.edit(edits.inserted(present, self._channel, number, s, y))
        elif event == "insert":
            self._shared.edit(edits.begun(present, self._channel, s, y))
        else:
            self._selected = number
            session.drag(handle, s, y, done=event == "drop")
            self._shared.edited()
