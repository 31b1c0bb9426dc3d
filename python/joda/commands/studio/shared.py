"""What all pages of one studio share: the desk, what follows from it, and the news of both."""

import functools
import inspect
from collections.abc import Callable
from typing import Any

from nicegui import Event, app, ui

from joda.commands.studio.live import Live
from joda.commands.studio.session import StudioSession
from joda.commands.studio.work import Stopped, Work
from joda.errors import JodaError
from joda.profile import Profile


class Shared:
    """One studio.

    Attributes:
        desk: the profile, the runs, and where they are saved.
        live: what the profile does.
        work: what is computed for longer.
        news: what has changed: `profile`, `runs`, `release`, `hand`, `replay`, `rest`, `diagnosis`
            or `work`.
        diagnosis: as `joda diagnose --json` wrote it; None if there is none.
        diagnosed: the profile that it is of.
        outcome: sentences on what was added, or was not.
        doing: share done (None: not known) and what is being done.
    """

    def __init__(self, session: StudioSession) -> None:
        """Args: what is worked on."""
        self.session = session
        self.news: Event[[str]] = Event()
        self.live = Live(session, self.news.emit)
        self.work = Work()
        self.diagnosis: dict[str, Any] | None = None
        self.diagnosed: Profile | None = None
        self.outcome: list[str] = []
        self.doing: tuple[float | None, str] = (None, "")

    def edited(self) -> None:
        """The profile is another one."""
        self.live.refresh()
        self.news.emit("profile")

    def edit(self, profile: Profile) -> None:
        """Makes this the profile."""
        self.session.edit(profile)
        self.edited()

    def step(self, how: str) -> None:
        """`undo` or `redo`."""
        (self.session.undo if how == "undo" else self.session.redo)()
        self.edited()

    def measured(self) -> None:
        """The runs are others."""
        self.diagnosis, self.outcome = None, []
        self.live.refresh()
        for what in ("runs", "diagnosis"):
            self.news.emit(what)

    async def diagnose(self) -> None:
        """Diagnoses the profile by the runs; raises JodaError."""
        session, profile = self.session, self.session.timeline.present
        runs, path = session.runs, session.scratch("diagnosis.json")
        self.diagnosis, self.outcome = None, []
        found = await self._working(
            lambda: self.work.diagnose(
                session.written(profile),
                session.joint,
                runs,
                path,
                self._progressed,
                session.passive,
            )
        )
        if found is not None and runs == session.runs:
            self.diagnosis, self.diagnosed = found, profile
        self.news.emit("diagnosis")

    async def add(self, effect: str) -> None:
        """Adds an effect that the diagnosis names, as `joda add` does; raises JodaError."""
        session, profile = self.session, self.session.timeline.present
        output, diagnosis = session.scratch("added.xml"), session.scratch("diagnosis.json")
        added = await self._working(
            lambda: self.work.add(
                session.written(profile),
                session.joint,
                session.runs,
                diagnosis,
                effect,
                output,
                self._progressed,
                session.passive,
            )
        )
        if added is None:
            return
        self.outcome = added["sentences"]
        if added["added"]:
            if session.timeline.present != profile:
                self.outcome.append("What was edited meanwhile is not in it; undo brings it back.")
            self.diagnosis = None
            self.edit(Profile.read(added["composed"]))
        self.news.emit("diagnosis")

    async def _working(self, begin: Callable[[], Any]) -> Any:
        """What comes of it; None if the user stopped it."""
        task = begin()
        self.doing = (None, "beginning")
        self.news.emit("work")
        try:
            return await task
        except Stopped:
            return None
        finally:
            self.doing = (None, "")
            self.news.emit("work")

    def _progressed(self, share: float | None, what: str) -> None:
        self.doing = (share, what)
        self.news.emit("work")


def user_errors_shown(handler: Callable[..., Any]) -> Callable[..., Any]:
    """A handler of the page: what the user cannot have is one sentence on it."""
    if inspect.iscoroutinefunction(handler):

        @functools.wraps(handler)
        async def waiting(*args: Any, **kwargs: Any) -> Any:
            try:
                return await handler(*args, **kwargs)
            except JodaError as error:
                say(str(error))

        return waiting

    @functools.wraps(handler)
    def at_once(*args: Any, **kwargs: Any) -> Any:
        try:
            return handler(*args, **kwargs)
        except JodaError as error:
            say(str(error))

    return at_once


def say(sentence: str, kind: str = "negative") -> None:
    """Shows a sentence for a while, in the place of the one before.

    Args:
        sentence: what is said.
        kind: negative, positive, warning or info.
    """
    shown = app.storage.client
    if "said" in shown and not shown["said"].is_deleted:
        shown["said"].dismiss()
    shown["said"] = ui.notification(
        sentence,
        type=kind,  # type: ignore[arg-type]
        position="top",
        timeout=12 if kind == "negative" else 5,
        classes="said",
        actions=[{"icon": "close", "color": "white", "round": True, "dense": True}],
    )
