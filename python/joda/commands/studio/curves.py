"""An editor of curves: a picture with control points that can be dragged, drawn by curves.js."""

from collections.abc import Callable
from typing import Any

from nicegui.element import Element
from nicegui.events import GenericEventArguments


class Curves(Element, component="curves.js", default_classes="curves"):
    """The editor of one channel, see `joda.commands.studio.charts.editor` for what it shows."""

    def __init__(self, view: dict[str, Any], report: Callable[[str, dict[str, Any]], None]) -> None:
        """Shows a view.

        Args:
            view: what is drawn.
            report: told what the user does, and where: `drag` and `drop` (component, point, x, y),
                `insert` (x, y), `remove` (component, point), `select` (component).
        """
        super().__init__()
        self._props["view"] = view

        def heard(event: str) -> Callable[[GenericEventArguments], None]:
            return lambda arguments: report(event, arguments.args)

        for event in ("drag", "drop", "insert", "remove", "select"):
            self.on(event, heard(event))

    @property
    def factor(self) -> float:
        """What values were multiplied by, for the prefix of their unit."""
        return float(self._props["view"]["factor"])

    def show(self, view: dict[str, Any]) -> None:
        """Shows another view."""
        if view != self._props["view"]:
            self._props["view"] = view
            self.update()

    def show_position(self, x: float) -> None:
        """Draws a line where the joint is, rad or m."""
        self.run_method("mark", x)
