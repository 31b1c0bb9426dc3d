"""Diagnoses and additions in a process of their own: the page stays alive, and they can be stopped.

The child runs the functions behind `joda diagnose` and `joda add`. It reads one request as JSON and
writes a line of JSON for each step, and one for what came of it.
"""

import asyncio
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import joda
from joda.errors import JodaError

Report = Callable[[float | None, str], None]
"""Told what share is done (None: not known), and what is being done."""


class Stopped(Exception):
    """The user has stopped it."""


class Work:
    """One thing at a time."""

    def __init__(self) -> None:
        """Nothing is being done."""
        self._process: asyncio.subprocess.Process | None = None
        self._stopped = False
        self.busy = False
        """Whether something is being done."""

    async def diagnose(
        self,
        scene: Path,
        joint: str,
        runs: tuple[Path, ...],
        output: Path,
        report: Report,
        passive: bool = False,
    ) -> dict[str, Any]:
        """As `joda diagnose --json`; returns what it wrote, see `_ask` for what is raised."""
        await self._ask(_request("diagnose", scene, joint, runs, output, passive), report)
        return dict(json.loads(output.read_text("utf-8")))

    async def add(
        self,
        scene: Path,
        joint: str,
        runs: tuple[Path, ...],
        diagnosis: Path,
        effect: str,
        output: Path,
        report: Report,
        passive: bool = False,
    ) -> dict[str, Any]:
        """As `joda add`: its JSON, and its sentences; see `_ask` for what is raised."""
        request = _request("add", scene, joint, runs, output, passive)
        return await self._ask(request | {"diagnosis": str(diagnosis), "effect": effect}, report)

    def stop(self) -> None:
        """Ends what is being done."""
        self._stopped = True
        if self._process is not None and self._process.returncode is None:
            self._process.terminate()

    async def _ask(self, request: dict[str, Any], report: Report) -> dict[str, Any]:
        """What the child answers.

        Raises:
            JodaError: what the command raises, or something is being done already, or the child
                failed otherwise, which it tells on stderr.
            Stopped: it was stopped.
        """
        if self.busy:
            raise JodaError("something is being computed already; wait for it or stop it.")
        self._stopped, self.busy = False, True
        try:
            return await self._answered(request, report)
        finally:
            self.busy = False

    async def _answered(self, request: dict[str, Any], report: Report) -> dict[str, Any]:
        """What a child of its own answers."""
        pipe = asyncio.subprocess.PIPE
        command = (sys.executable, "-m", "joda.commands.studio.work")
        # In a session of its own: Ctrl-C is for the studio, which stops it. And without OpenGL,
        # for which MuJoCo starts yet another process, which complains when this one is stopped.
        process = await asyncio.create_subprocess_exec(
            *command,
            stdin=pipe,
            stdout=pipe,
            start_new_session=True,
            env=os.environ | {"MUJOCO_GL": "disable"},
        )
        self._process = process
        try:
            if self._stopped:
                process.terminate()
                raise Stopped
            assert process.stdin and process.stdout
            process.stdin.write(json.dumps(request).encode() + b"\n")
            await process.stdin.drain()
            async for line in process.stdout:
                said = json.loads(line)
                if "error" in said:
                    raise JodaError(said["error"])
                if "answer" in said:
                    return dict(said["answer"])
                report(said["share"], said["what"])
            if self._stopped:
                raise Stopped
            raise JodaError(f"{request['do']} failed; the terminal says why.")
        finally:
            self._process = None
            if process.returncode is None and not self._stopped:
                process.kill()
            await process.wait()


def _request(
    do: str, scene: Path, joint: str, runs: tuple[Path, ...], output: Path, passive: bool
) -> dict[str, Any]:
    """What a child is asked, as JSON."""
    files = {"scene": str(scene), "runs": list(map(str, runs)), "output": str(output)}
    return {"do": do, "joint": joint, "passive": passive, **files}


def _do(request: dict[str, Any], report: Report) -> dict[str, Any]:
    """What is asked for; raises JodaError."""
    scene, joint, runs, output = (request[key] for key in ("scene", "joint", "runs", "output"))
    passive = request["passive"]
    if request["do"] == "diagnose":
        joda.diagnose(
            scene, joint, runs, json=output, passive=passive, force=True,
            progress=lambda done, total, what: report(done / max(total, 1), what),
        )  # fmt: skip
        return {}
    added = joda.add(
        scene, joint, request["diagnosis"], runs, output, effect=request["effect"],
        passive=passive, force=True, progress=lambda what: report(None, what),
    )  # fmt: skip
    from joda.commands.add import sentences

    return added.as_json() | {"sentences": sentences(added)}


def main() -> None:
    """The child."""
    # MuJoCo prints its warnings to stdout; they go where the errors go.
    with os.fdopen(os.dup(1), "w", encoding="utf-8") as stdout:
        os.dup2(2, 1)

        def say(**what: Any) -> None:
            stdout.write(json.dumps(what) + "\n")
            stdout.flush()

        try:
            request = json.loads(sys.stdin.readline())
            say(answer=_do(request, lambda share, what: say(share=share, what=what)))
        except JodaError as error:
            say(error=str(error))


if __name__ == "__main__":
    main()
