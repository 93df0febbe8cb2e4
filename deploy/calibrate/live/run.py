"""The guided session at the bus: polls, records, guides; then computes and writes."""

from __future__ import annotations

import asyncio
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.live import Live

from common.errors import TandemError
from common.process.runtime import until_stopped
from common.quaternion import Array
from common.recording import McapRecorder
from deploy.calibrate import capture as shared
from deploy.calibrate.live.guide import Guide, GuideOptions, StepName, View
from deploy.calibrate.live.screen import line, screen
from master.config import MasterConfig
from master.suit.sweep import Sweep

_SHOW_S = 0.2
_LOG_S = 5.0
_FILE: dict[StepName, str] = {
    "attitudes": "tray",
    "tumble": "tray",
    "zero_pose": "worn",
    "move_joints": "worn",
}
"""Which recording a step belongs to: with `wear` there is none, as units are handled one by one."""


@dataclass(slots=True)
class LiveRecordings:
    """What the guided part leaves."""

    tray: Path | None = None
    """Attitudes and tumbling."""
    worn: Path | None = None
    """The zero pose, and the motion after it."""
    zero_pose_s: tuple[float, float] | None = None
    """When the zero pose was held, in the time of `worn`."""
    finished: bool = False
    counters: dict[str, object] = field(default_factory=dict)


class LiveSession:
    """One run from the first step to the last, or to Ctrl-C."""

    def __init__(self, config: MasterConfig, options: GuideOptions, folder: Path, console: Console) -> None:
        self._config = config
        self._folder = folder
        self._console = console
        self._names = shared.names(config)
        self._guide = Guide(
            [config.nodes[name].magnetometer for name in self._names],
            config.skeleton.parents.tolist(),
            config.capture.rate_hz,
            options,
        )
        self._block: list[Array] = []
        self._recorder: McapRecorder | None = None
        self._recorders: list[McapRecorder] = []
        self._ticks = 0
        self._logged_s = -_LOG_S
        self.session = LiveRecordings()

    async def run(self, stop: asyncio.Event) -> None:
        """Guide until all is recorded or `stop` is set. Raises TandemError where it cannot go on."""
        capture = shared.open_capture(self._config, self.on_sweep)
        self.begin()
        try:
            await until_stopped(stop, self._work(capture.run()))
        finally:
            await asyncio.to_thread(self.end)
        self.session.counters["capture"] = capture.summary()

    def begin(self) -> None:
        """Open the first recording."""
        self._switch(self._guide.step)

    def on_sweep(self, sweep: Sweep) -> None:
        """Take one tick of the suit, and record it."""
        self._ticks += 1
        block, recorder = self._block, self._recorder
        block.append(shared.readings(sweep))
        if recorder is not None:
            shared.record(recorder, sweep)

    def take(self) -> View:
        """Give the guide what has come; what the person is to do now."""
        # off the loop: a tick that comes in this very moment may miss the guide, never the recording
        block, self._block = self._block, []
        if block:
            before = self._guide.step
            self._guide.add(np.stack(block))
            if self._guide.step != before:
                self._switch(self._guide.step)
        return self._guide.view()

    def word(self) -> None:
        """The person says so: see `Guide.word`."""
        self._guide.word()

    def end(self) -> None:
        """Close the recordings, and say in `session` how far it came. May take as long as the disk."""
        for recorder in self._recorders:
            recorder.close()
        session = self.session
        session.finished = self._guide.step == "done"
        session.counters["recordings"] = [recorder.summary() for recorder in self._recorders]
        if session.worn is not None and self._guide.step in ("move_joints", "done"):
            session.zero_pose_s = self._guide.zero_pose_s

    async def _work(self, polling: object) -> None:
        assert asyncio.iscoroutine(polling)
        poll = asyncio.ensure_future(polling)
        guide = asyncio.ensure_future(self._lead())
        try:
            await asyncio.wait({poll, guide}, return_when=asyncio.FIRST_COMPLETED)
            for task in (poll, guide):
                if task.done():
                    task.result()
        finally:
            for task in (poll, guide):
                task.cancel()
            await asyncio.gather(poll, guide, return_exceptions=True)

    async def _lead(self) -> None:
        loop = asyncio.get_running_loop()
        interactive = self._console.is_terminal and sys.stdin.isatty()
        if interactive:
            loop.add_reader(sys.stdin.fileno(), self._on_key)
        try:
            with Live(console=self._console, auto_refresh=False, transient=True) as live:
                while self._guide.step != "done":
                    await asyncio.sleep(_SHOW_S)
                    # off the loop: drawing takes longer than a tick
                    showing = asyncio.ensure_future(asyncio.to_thread(self._show, live))
                    try:
                        await asyncio.shield(showing)
                    except asyncio.CancelledError:
                        await showing
                        raise
        finally:
            if interactive:
                loop.remove_reader(sys.stdin.fileno())

    def _show(self, live: Live) -> None:
        before = self._guide.step
        view = self.take()
        now_s = self._ticks / self._config.capture.rate_hz
        if self._console.is_terminal:
            live.update(screen(view, self._names, now_s), refresh=True)
        elif view.step != before or now_s >= self._logged_s + _LOG_S:
            self._logged_s = now_s
            self._log(view, now_s)

    def _log(self, view: View, now_s: float) -> None:
        self._console.print(line(view, self._names, now_s), highlight=False, soft_wrap=True, markup=False)

    def _on_key(self) -> None:
        sys.stdin.readline()
        self._guide.word()

    def _switch(self, step: StepName) -> None:
        """Go on in the recording that the step belongs to."""
        name = _FILE.get(step)
        if self._recorder is not None and self._recorder.path.stem.split("-")[0] == name:
            return
        self._recorder = None
        if name is None:
            return
        self._recorder = shared.open_recorder(self._config, free_name(self._folder, name))
        self._recorders.append(self._recorder)
        if name == "tray":
            self.session.tray = self._recorder.path
        else:
            self.session.worn = self._recorder.path


def free_name(folder: Path, stem: str) -> Path:
    """`stem.mcap` in the folder, or the first of `stem-2.mcap`, … that is not there yet."""
    paths = (folder / f"{stem}{'' if n == 1 else f'-{n}'}.mcap" for n in range(1, 1000))
    path = next((path for path in paths if not path.exists()), None)
    if path is None:
        raise TandemError(f"{folder}: full of recordings; name another folder")
    return path
