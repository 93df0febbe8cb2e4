"""What systemd hears: over real datagram sockets, never blocking, and only while the guarded loop turns."""

from __future__ import annotations

import faulthandler
import os
import signal
import socket
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.process.notify import PINGS_A_PERIOD, Notifier, open_notifier

S = 1_000_000_000
WATCHDOG_NS = 2 * S


def told(watchdog_ns: int = WATCHDOG_NS) -> tuple[Notifier, list[str]]:
    messages: list[str] = []

    def send(message: bytes) -> bool:
        messages.append(message.decode())
        return True

    return Notifier(send, watchdog_ns), messages


@pytest.fixture(params=["path", "abstract"])
def manager(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[socket.socket, str]]:
    """The manager's end, and what it calls its socket."""
    name = str(tmp_path / "notify") if request.param == "path" else f"@tandem-test-{os.getpid()}"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as wire:
        wire.bind(name.replace("@", "\0", 1) if name.startswith("@") else name)
        wire.settimeout(60.0)
        yield wire, name


def test_over_a_real_socket_of_either_kind(manager: tuple[socket.socket, str]) -> None:
    wire, name = manager
    environment = {"NOTIFY_SOCKET": name, "HOME": "/"}
    notifier = open_notifier(environment)
    notifier.beat(0)
    notifier.status("hold: not engaged")
    notifier.stopping()
    assert [wire.recv(4096) for _ in range(3)] == [
        b"READY=1\nWATCHDOG=1",
        b"STATUS=hold: not engaged",
        b"STOPPING=1",
    ]
    assert environment == {"HOME": "/"}  # a child must not speak in this process's name


def test_the_first_beat_is_readiness_and_pings_come_at_a_quarter() -> None:
    notifier, messages = told()
    for tick in range(0, 2 * WATCHDOG_NS, 5_000_000):
        notifier.beat(tick)
    assert messages == ["READY=1\nWATCHDOG=1", *["WATCHDOG=1"] * (2 * PINGS_A_PERIOD - 1)]


def test_a_loop_that_does_not_turn_does_not_ping() -> None:
    notifier, messages = told()
    notifier.beat(0)
    notifier.status("still here")  # from elsewhere in the process: no sign that the loop lives
    assert "WATCHDOG=1" not in messages


def test_nobody_watches_so_nothing_is_pinged() -> None:
    notifier, messages = told(watchdog_ns=0)
    for now_ns in range(0, 100 * S, S):
        notifier.beat(now_ns)
    assert messages == ["READY=1\nWATCHDOG=1"]


def test_readiness_that_could_not_be_told_is_told_again() -> None:
    answers = iter([False, True, True])
    messages: list[bytes] = []

    def send(message: bytes) -> bool:
        messages.append(message)
        return next(answers)

    notifier = Notifier(send)
    for now_ns in range(0, S, 5_000_000):
        notifier.beat(now_ns)
    assert messages == [b"READY=1\nWATCHDOG=1"] * 2
    assert notifier.unsent == 1


def test_a_manager_that_does_not_read_never_blocks_the_loop(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as wire:
        wire.bind(str(tmp_path / "notify"))
        notifier = open_notifier({"NOTIFY_SOCKET": str(tmp_path / "notify")})
        for i in range(10_000):  # far more than any queue between them holds
            notifier.status(f"number {i}")
        assert notifier.unsent > 0


def test_a_manager_that_is_gone_is_counted_and_found_again(tmp_path: Path) -> None:
    path = tmp_path / "notify"
    notifier = open_notifier({"NOTIFY_SOCKET": str(path)})
    notifier.status("nobody hears it")
    assert notifier.unsent == 1
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as wire:
        wire.bind(str(path))
        wire.settimeout(60.0)
        notifier.status("nobody hears it")
        assert wire.recv(4096) == b"STATUS=nobody hears it"


def test_without_a_manager_nothing_happens() -> None:
    notifier = open_notifier({})
    notifier.beat(0)
    notifier.status("hold")
    notifier.stopping()
    assert notifier.unsent == 0


def test_an_address_that_is_none_is_told_and_ignored(caplog: pytest.LogCaptureFixture) -> None:
    notifier = open_notifier({"NOTIFY_SOCKET": "vsock:2:1234"})
    notifier.beat(0)
    assert "expected a path or an abstract socket" in caplog.text
    assert notifier.unsent == 0


@pytest.mark.parametrize(
    ("pid", "pings"),
    [(None, True), (str(os.getpid()), True), (str(os.getpid() + 1), False)],
    ids=["not said", "this one", "another"],
)
def test_a_watchdog_that_is_set_for_another_process_is_not_ours(
    pid: str | None, pings: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    enabled: list[object] = []
    monkeypatch.setattr(faulthandler, "enable", lambda file: enabled.append(file))
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as wire:
        wire.bind(str(tmp_path / "notify"))
        wire.setblocking(False)
        environment = {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "1000000"}
        environment |= {"WATCHDOG_PID": pid} if pid else {}
        notifier = open_notifier(environment)
        notifier.beat(0)
        notifier.beat(S)
        wire.recv(4096)
        if pings:
            assert wire.recv(4096) == b"WATCHDOG=1"
        else:
            with pytest.raises(BlockingIOError):
                wire.recv(4096)
    assert bool(enabled) is pings  # a hung loop leaves its stack, where a watchdog will end it


@given(st.text())
def test_no_text_can_smuggle_a_message_of_its_own(text: str) -> None:
    notifier, messages = told()
    notifier.status(f"held by {text}\nMAINPID=1")
    [message] = messages
    assert message.startswith("STATUS=held by")
    assert len(message.splitlines()) == 1
    assert len(message) <= len("STATUS=") + 256


def test_the_same_status_is_said_once() -> None:
    notifier, messages = told()
    for text in ("hold", "hold", "track", "hold"):
        notifier.status(text)
    assert messages == ["STATUS=hold", "STATUS=track", "STATUS=hold"]


def test_a_process_that_waits_has_its_start_time_out_extended() -> None:
    notifier, messages = told()
    for _ in range(2):
        notifier.waits("waits for a router at tls/a:1\nREADY=1")
    words = "STATUS=waits for a router at tls/a:1 READY=1\nEXTEND_TIMEOUT_USEC=30000000"
    assert messages == [words, words]
    notifier.beat(0)
    assert messages[-1] == "READY=1\nWATCHDOG=1", "to wait is not to be ready"


def test_after_stopping_the_loop_is_not_watched_any_more() -> None:
    notifier, messages = told()
    notifier.beat(0)
    notifier.stopping()
    notifier.beat(100 * S)
    assert messages[1:] == ["STOPPING=1"]


def test_a_loop_that_hangs_falls_silent_and_its_stack_is_in_the_log(tmp_path: Path) -> None:
    """The test is the service manager: it hears the loop hang, and ends it as a watchdog does."""
    program = textwrap.dedent("""
        import asyncio, threading
        from common.clock import monotonic_ns
        from common.process.notify import open_notifier
        from common.process.pacing import TickGrid
        from common.process.runtime import run
        from common.process.ticker import ticks

        def a_servo_that_never_answers(notifier):
            notifier.status("hangs")  # from within: who hears it finds this on the stack
            threading.Event().wait()

        async def main(stop):
            notifier = open_notifier()
            turns = 0
            async for _ in ticks(TickGrid(monotonic_ns(), 5_000_000)):
                turns += 1
                if turns > 40:
                    a_servo_that_never_answers(notifier)
                notifier.beat(monotonic_ns())

        run(main)
    """)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as wire:
        wire.bind(str(tmp_path / "notify"))
        wire.settimeout(60.0)
        environment = {
            **os.environ,
            "NOTIFY_SOCKET": str(tmp_path / "notify"),
            "WATCHDOG_USEC": "40000",
        }
        with subprocess.Popen(
            [sys.executable, "-c", program], env=environment, stderr=subprocess.PIPE, text=True
        ) as child:
            try:
                heard = [wire.recv(4096)]
                while heard[-1] != b"STATUS=hangs":
                    heard.append(wire.recv(4096))
                child.send_signal(signal.SIGABRT)
                _, errors = child.communicate(timeout=60)
            finally:
                child.kill()
            assert child.returncode == -signal.SIGABRT
        assert heard[0] == b"READY=1\nWATCHDOG=1"
        assert b"WATCHDOG=1" in heard
        wire.setblocking(False)
        with pytest.raises(BlockingIOError):  # not a word after it hung
            wire.recv(4096)
    assert "a_servo_that_never_answers" in errors
