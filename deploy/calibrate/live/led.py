"""The process behind the console's page of calibration: led as `tandem calibrate live`, at a master's tap.

It reads lines of JSON at its standard input: first a `LedOrder`, then what the person does, {"do": "word"}.
It writes lines: {"view": …} five times a second, {"computing": true}, and last {"outcome": …} or
{"error": "words"}. When its input ends, so does the session; what was recorded stays.
"""

from __future__ import annotations

import asyncio
import io
import json
import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import cast

from rich.console import Console

from common.config.load import load_config
from common.errors import TandemError
from common.process.runtime import until_stopped
from deploy.calibrate import capture as shared
from deploy.calibrate.live.compute import Choice, compute
from deploy.calibrate.live.guide import GuideOptions, What
from deploy.calibrate.live.run import LiveSession
from deploy.calibrate.live.tapped import TappedSuit, hear_suit
from deploy.calibrate.live.told import outcome_told, to_name, view_told
from deploy.calibrate.session import make_folder
from master.calibrate.magnetometer_axes import hemisphere_named
from master.config import MasterConfig

SHOW_S = 0.2
NICE = 10
"""The master and the console on this host come first."""
Tell = Callable[[Mapping[str, object]], None]


@dataclass(frozen=True, slots=True)
class LedOrder:
    """What the console asks for."""

    master: str
    """The master's file."""
    tap: str
    out: str
    """Folder for the nodes' files."""
    what: tuple[What, ...]
    overrides: tuple[str, ...] = ()
    """Of the master's file."""
    gravity_m_s2: float = 9.80665
    hemisphere: str = "north"
    countdown_s: float = 5.0
    still_s: float = 3.0
    attitudes: int = 20
    tumble_s: float = 30.0
    move_joints_s: float = 20.0

    @classmethod
    def read(cls, line: str) -> LedOrder:
        """Of the first line."""
        said = json.loads(line)
        said["what"], said["overrides"] = tuple(said["what"]), tuple(said.get("overrides", ()))
        return cls(**said)

    @property
    def line(self) -> str:
        """As `read` takes it."""
        return json.dumps(asdict(self))


class LedSession:
    """One calibration: sweeps and a person's words go in, what to show comes out."""

    def __init__(self, order: LedOrder, config: MasterConfig, tell: Tell) -> None:
        self._order = order
        self._config = config
        self._tell = tell
        self._folder = Path(order.out)
        self._console = Console(file=io.StringIO(), width=100)
        options = GuideOptions(
            order.what,
            order.still_s,
            order.attitudes,
            tumble_s=order.tumble_s,
            move_joints_s=order.move_joints_s,
            by_word=True,
            countdown_s=order.countdown_s,
        )
        self._places = {
            "attitudes": str(options.attitudes),
            "still": f"{options.still_s:g}",
            "seconds": f"{options.zero_pose_s:g}",
        }
        self._live = LiveSession(config, options, self._folder, self._console)
        self.suit = TappedSuit(shared.open_source(config), self._live.on_sweep)

    def begin(self) -> None:
        """Open the first recording."""
        self._live.begin()

    def word(self) -> None:
        """The person presses the button that stands for Enter."""
        self._live.word()

    def show(self) -> bool:
        """Tell what to do now; whether all steps are done."""
        view = self._live.take()
        self._tell({"view": view_told(view, shared.names(self._config), self._places)})
        return view.step == "done"

    def end(self) -> None:
        """Close the recordings."""
        self._live.end()

    def compute(self) -> None:
        """Write the nodes' files, and tell what became of each."""
        order, config = self._order, self._config
        self._tell({"computing": True})
        hemisphere = hemisphere_named(order.hemisphere)
        choice = Choice(order.what, order.gravity_m_s2, order.still_s, hemisphere, pictures=False)
        figures, _ = compute(config, self._live.session, choice, self._folder, self._console)
        told = outcome_told(figures)
        named = {name: _resolved(node.calibration) for name, node in config.nodes.items()}
        files = {name: _resolved(self._folder / f"{name}.toml") for name in config.nodes}
        nodes = cast("Mapping[str, Mapping[str, str]]", told["nodes"])
        told |= {"folder": str(self._folder), "to_name": to_name(nodes, named, files)}
        self._tell({"outcome": told})


def _resolved(path: Path | None) -> Path | None:
    return None if path is None else path.resolve()


def _tell(message: Mapping[str, object]) -> None:
    sys.stdout.write(json.dumps(message, ensure_ascii=False) + "\n")
    sys.stdout.flush()


async def whole_in_thread(call: Callable[[], bool]) -> bool:
    """What `call` returns, from a thread.

    A cancelled caller still waits for its end: it may open a recording that nobody would then close.
    """
    running = asyncio.ensure_future(asyncio.to_thread(call))
    try:
        return await asyncio.shield(running)
    except asyncio.CancelledError:
        await running
        raise


async def _lead(order: LedOrder, words: asyncio.StreamReader) -> None:
    config = load_config(Path(order.master), MasterConfig, order.overrides)
    make_folder(Path(order.out))
    session = LedSession(order, config, _tell)
    stop = asyncio.Event()
    done = False

    async def hear_person() -> None:
        while line := await words.readline():
            if json.loads(line).get("do") == "word":
                session.word()
        stop.set()

    async def show() -> None:
        nonlocal done
        while not done:
            await asyncio.sleep(SHOW_S)
            done = await whole_in_thread(session.show)
        stop.set()

    async def work() -> None:
        try:
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(hear_suit(Path(order.tap), session.suit))
                tasks.create_task(hear_person())
                tasks.create_task(show())
        except* TandemError as group:
            raise group.exceptions[0] from None

    session.begin()
    try:
        await until_stopped(stop, work())
    finally:
        await asyncio.to_thread(session.end)
    if done:
        await asyncio.to_thread(session.compute)


async def _main() -> int:
    loop = asyncio.get_running_loop()
    words = asyncio.StreamReader()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(words), sys.stdin)
    try:
        await _lead(LedOrder.read((await words.readline()).decode()), words)
    except TandemError as error:
        _tell({"error": str(error)})
        return 1
    return 0


def main() -> int:
    """Lead one calibration; the process's status."""
    os.nice(NICE)
    return asyncio.run(_main())
