"""`tandem voice`."""

from __future__ import annotations

import asyncio
import secrets
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.live import Live
from rich.text import Text

from common.clock import monotonic_ns
from common.config.load import check_config, load_config
from common.errors import CodecError, TandemError
from common.link import Link, open_session
from common.link.config import LinkConfig
from common.link.voice_config import VoiceConfig
from common.process.runtime import run as run_until_stopped
from common.skeleton import Skeleton
from common.wire.codec import decode
from common.wire.messages import RobotState
from common.wire.sender import operator_of
from common.wire.topics import IN_ORDER, OPERATOR_VOICE, STATE, VOICE
from deploy.client.destination import ROUTER_S, Destination, destination
from deploy.client.own_door import own_doors
from deploy.ops.voice.card import sound_card
from deploy.ops.voice.echo import EchoCanceller
from deploy.ops.voice.end import VoiceEnd
from deploy.ops.voice.opus import OpusDecoder, OpusEncoder, Samples
from deploy.report.options import Overrides

LOOK_S = 0.2
OFF = "expected [voice] enabled = true: it is off, so that nobody is heard without having been asked"


def voice(
    master: Annotated[
        Path | None,
        typer.Option(help="The TOML file of the master on this host: the operator.", dir_okay=False),
    ] = None,
    slave: Annotated[
        Path | None,
        typer.Option(help="The TOML file of the slave on this host: at the robot.", dir_okay=False),
    ] = None,
    robot: Annotated[str | None, typer.Option(help="With --master: which robot.")] = None,
    seconds: Annotated[
        float, typer.Option(help="Stop after this many seconds; 0: stop with Ctrl-C.", min=0.0)
    ] = 0.0,
    overrides: Overrides = None,
) -> None:
    """Talk with the person at the robot: once on the operator's host, once on the robot's.

    Only the operator who holds the robot's lease is heard there, and only while the lease is held is anything
    sent. Enter mutes the microphone and opens it again. Nothing is recorded.

    Example: `tandem voice --master /etc/tandem/master.toml --robot robot-1`
    """
    place = _place(master, slave, robot, tuple(overrides or ()))
    if not place.config.enabled:
        raise TandemError(f"{place.file}: {OFF}")

    async def talk(stop: asyncio.Event) -> None:
        async with open_session(place.where.link, router_within_s=ROUTER_S) as session:
            link = session.link(place.where.robots[0])
            conversation = Conversation(place, link)
            with sound_card(place.config, conversation.turn, conversation.on_delay):
                await _show(conversation, stop, seconds)

    run_until_stopped(talk)


@dataclass(frozen=True, slots=True)
class TalkingPlace:
    """Where this end is."""

    file: Path
    config: VoiceConfig
    where: Destination
    operator: str
    """Empty at the robot."""
    skeleton: Skeleton


def _place(
    master: Path | None, slave: Path | None, robot: str | None, overrides: tuple[str, ...]
) -> TalkingPlace:
    if (master is None) == (slave is None):
        raise TandemError("on which side? Name the file of this host by --master or by --slave")
    if slave is not None:
        from slave.config import SlaveConfig  # loads MuJoCo

        file = load_config(slave, SlaveConfig, overrides)
        where = _with_door(slave, own_doors(slave, file.link, file.robot), file.link, file.voice)
        return TalkingPlace(slave, file.voice, where, "", file.skeleton)
    from master.config import MasterConfig

    assert master is not None
    own = load_config(master, MasterConfig, overrides)
    where = destination(None, None if robot is None else [robot], master=master, overrides=overrides)
    asked = {**where.link.model_dump(), "connect": [*where.link.connect, *own.voice.connect]}
    where = replace(where, link=check_config(master, asked, LinkConfig))
    if len(where.robots) != 1:
        raise TandemError(
            f"with whom? Name one robot by --robot: {', '.join(where.robots) or 'none is named'}"
        )
    return TalkingPlace(master, own.voice, where, where.operator, own.skeleton)


def _with_door(file: Path, where: Destination, own: LinkConfig, voice: VoiceConfig) -> Destination:
    """The robot's end listens for the operator's, by the slave's own rules: peers pass nothing on."""
    if not voice.listen:
        return where
    rules = own.model_dump(include={"access", "revoked"})
    asked = {**where.link.model_dump(), **rules, "listen": voice.listen}
    return replace(where, link=check_config(file, asked, LinkConfig))


class Conversation:
    """An end with its link, its echo canceller and its lock: the sound card calls in a thread of its own."""

    def __init__(self, place: TalkingPlace, link: Link) -> None:
        """Raises ModuleNotFoundError where the extra `voice` is not installed."""
        self._lock = threading.Lock()
        self.end = VoiceEnd(
            place.operator,
            secrets.randbits(63) | 1,
            (OpusEncoder(), OpusDecoder()),
            muted=place.config.starts == "muted",
        )
        self._echo = EchoCanceller() if place.config.echo_cancelling else None
        self._joints = len(place.skeleton.joints)
        mine, other = VOICE, OPERATOR_VOICE
        if place.operator:
            mine, other = OPERATOR_VOICE.of(place.operator), VOICE
        self._put: Callable[[bytes], None] = link.publish(mine)
        link.subscribe(STATE, self._on_state)
        link.subscribe_keys(other, self._on_voice, in_order=IN_ORDER)

    def turn(self, heard: Samples) -> Samples:
        """20 ms of the microphone in, 20 ms for the speaker out."""
        now_ns = monotonic_ns()
        with self._lock:
            played = self.end.play(now_ns)
            if self._echo is not None:
                self._echo.played(played)
                heard = self._echo.clean(heard)
            payload = self.end.capture(heard, now_ns)
        if payload is not None:
            self._put(payload)
        return played

    def on_delay(self, delay_ms: int) -> None:
        """What the sound card says of itself."""
        if self._echo is not None:
            self._echo.delay_ms = delay_ms

    def on_line(self) -> bool:
        """Enter was pressed: mute, or open the microphone. False where the terminal has gone: it is muted."""
        try:
            pressed = bool(sys.stdin.readline())
        except OSError:
            pressed = False
        with self._lock:
            self.end.muted = not self.end.muted if pressed else True
        return pressed

    def words(self) -> str:
        """One line for the person here."""
        with self._lock:
            shown, counted = self.end.shown(monotonic_ns()), self.end.jitter.counters
            depth_ms = 20 * self.end.jitter.waiting
        if not shown.partner:
            return "nobody holds the robot's lease: nothing is sent, nothing is heard"
        here = "YOU ARE MUTED" if shown.muted else "you are heard"
        counts = f"{self.end.concealed} concealed, {counted.late} late, {counted.stale} stale"
        other = f"the other end {shown.other}" if shown.other != "muted" else "the other end is MUTED"
        return f"{here} (Enter changes it); {other}; {depth_ms} ms wait, {counts}"

    def _on_state(self, payload: bytes, arrived_ns: int) -> None:
        state = decode(payload, RobotState, self._joints)
        with self._lock:
            self.end.on_holder(state.operator, arrived_ns)

    def _on_voice(self, key: str, payload: bytes, arrived_ns: int) -> None:
        with self._lock, suppress(CodecError):
            self.end.on_payload(payload, operator_of(key) or "", arrived_ns)


async def _show(conversation: Conversation, stop: asyncio.Event, seconds: float) -> None:
    loop = asyncio.get_running_loop()
    end_s = loop.time() + seconds if seconds else None
    reads = sys.stdin.isatty()

    def on_line() -> None:
        if not conversation.on_line():
            loop.remove_reader(sys.stdin.fileno())

    if reads:
        loop.add_reader(sys.stdin.fileno(), on_line)
    try:
        with Live(console=Console(), refresh_per_second=5) as live:
            while not stop.is_set() and (end_s is None or loop.time() < end_s):
                live.update(Text(conversation.words()))
                with suppress(TimeoutError):
                    await asyncio.wait_for(stop.wait(), LOOK_S)
            live.update(Text(conversation.words()))
    finally:
        if reads:
            loop.remove_reader(sys.stdin.fileno())
