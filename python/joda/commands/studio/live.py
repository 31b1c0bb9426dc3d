"""What follows from the profile, computed in a thread: the newest profile wins."""

import asyncio
import time
from collections.abc import Callable
from typing import Any

from joda.commands.studio.motions import Outdated, Replayed, Stale, replayed, simulated
from joda.commands.studio.session import StudioSession
from joda.errors import JodaError
from joda.profile import Profile
from joda.scenes.motion import Motion

PATIENCE = 0.25
"""How long (s) what takes longer goes on although a newer profile waits."""

Stage = Callable[[Profile, Stale], Any]


class Live:
    """The release, the hand and the replays of the profile as it is shown.

    Attributes:
        start: where the joint is let go, rad or m.
        found: by stage: `release` and `hand` (Motion), `replay` (Replayed); what is not known is
            not there.
        before: the same of the profile as it was opened.
        failed: by stage, why there is nothing, in a sentence.
    """

    def __init__(self, session: StudioSession, report: Callable[[str], None]) -> None:
        """Args: what is worked on; report: which stage has something new, in the event loop."""
        self.session, self._report = session, report
        lo, hi = session.opened.joint.range
        self.start = (lo + hi) / 2
        self.found: dict[str, Any] = {}
        self.before: dict[str, Any] = {}
        self.failed: dict[str, str] = {}
        self._keys: dict[str, Any] = {}
        self._wanted = 0
        self._stopped = False
        self._task: asyncio.Task[None] | None = None

    @property
    def busy(self) -> bool:
        """Whether something is still being computed."""
        return self._task is not None and not self._task.done()

    def release_at(self, position: float) -> None:
        """Lets it go elsewhere, rad or m."""
        self.start = position
        self.refresh()

    def refresh(self) -> None:
        """Computes all again, for the profile and the runs as they are now."""
        self._wanted += 1
        if not self.busy:
            self._task = asyncio.get_running_loop().create_task(self._follow())

    def stop(self) -> None:
        """Ends at once what can be ended."""
        self._stopped = True

    async def _follow(self) -> None:
        done = -1
        while done != self._wanted and not self._stopped:
            done = self._wanted
            for stage in ("release", "paths", "hand", "replay"):
                if stage in ("hand", "replay") and done != self._wanted:
                    break
                await self._compute(stage, done)
        self._report("rest")

    async def _compute(self, stage: str, number: int) -> None:
        name = "replay" if stage == "paths" else stage
        since = time.monotonic()

        def stale() -> bool:
            late = self._wanted != number and time.monotonic() > since + PATIENCE
            return late or self._stopped

        def stopped() -> bool:
            return self._stopped

        make, key = self._stages()[stage]
        profile = self.session.profile
        try:
            if make is None:
                self.found.pop(name, None)
                self.before.pop(name, None)
                self._keys.pop(name, None)
            else:
                patient = stage in ("release", "paths")
                found = await asyncio.to_thread(make, profile, stopped if patient else stale)
                if stage != "paths" and self._keys.get(name) != key:
                    own = found if profile == self.session.opened else None
                    first = own or await asyncio.to_thread(make, self.session.opened, stopped)
                    self.before[name], self._keys[name] = first, key
                self.found[name] = found
            self.failed.pop(name, None)
        except Outdated:
            return
        except JodaError as error:
            self.found.pop(name, None)
            self.failed[name] = str(error)
        self._report(name)

    def _stages(self) -> dict[str, tuple[Stage | None, Any]]:
        """What makes each stage, and what it depends on besides the profile."""
        session, start, runs = self.session, self.start, self.session.runs

        def release(profile: Profile, stale: Stale) -> Motion:
            return simulated(session.written(profile), session.joint, stale, release=start)

        def hand(profile: Profile, stale: Stale) -> Motion:
            return simulated(session.written(profile), session.joint, stale, hand=True)

        def paths(profile: Profile, stale: Stale) -> Replayed:
            return replayed(
                session.written(profile), session.joint, runs, False, session.passive, stale
            )

        def replay(profile: Profile, stale: Stale) -> Replayed:
            return replayed(
                session.written(profile), session.joint, runs, True, session.passive, stale
            )

        return {
            "release": (release, start),
            "paths": (paths if runs else None, runs),
            "hand": (hand, ()),
            "replay": (replay if runs else None, runs),
        }
