"""Real, tiny processes in place of `tandem ROLE FILE`; each says by a connection that it has come so far."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import sys
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import pytest

from common.errors import TandemError
from common.metrics.parts import Ticks
from deploy.harness import child as child_module
from deploy.harness.child import Child
from slave.last_known import state_file

CALL = """
import json, signal, socket, sys, time
def here():
    link = socket.create_connection(("127.0.0.1", int(sys.argv[1])))
    link.sendall(b"here")
    return link
"""
STAY = "link = here(); link.recv(1)\n"


@asynccontextmanager
async def started(folder: Path, program: str) -> AsyncIterator[Child]:
    """A child that runs `program` and has called `here()`; it is gone afterwards, whatever happens."""
    called = asyncio.Event()
    connections: list[asyncio.StreamWriter] = []

    async def on_call(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        connections.append(writer)
        await reader.readexactly(4)
        called.set()

    server = await asyncio.start_server(on_call, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    child = Child("master", folder, (sys.executable, "-c", CALL + program, str(port)))
    try:
        await child.start(Path("some.toml"), ['robot="r"'])
        await called.wait()
        yield child
    finally:
        await child.kill()
        for connection in connections:
            connection.close()
        server.close()


def run(folder: Path, program: str, test: Callable[[Child], Awaitable[None]]) -> None:
    async def story() -> None:
        async with asyncio.timeout(30), started(folder, program) as child:
            await test(child)

    asyncio.run(story())


async def ended(child: Child) -> None:
    assert child._process is not None
    await child._process.wait()


def test_it_gets_role_file_metrics_and_overrides(tmp_path: Path) -> None:
    async def test(child: Child) -> None:
        await ended(child)
        metrics = ["--metrics", str(tmp_path / "master.metrics.json")]
        assert json.loads(child.metrics_file.read_text("utf-8")) == {
            "argv": ["master", "some.toml", *metrics, "--set", f"@{tmp_path / 'master.changes'}"]
        }
        assert (tmp_path / "master.changes").read_text("utf-8") == 'robot="r"\n'
        assert await child.stop() == 0

    run(tmp_path, "here(); open(sys.argv[5], 'w').write(json.dumps({'argv': sys.argv[2:]}))", test)


@pytest.mark.usefixtures("default_signals")
def test_sigterm_ends_one_that_listens(tmp_path: Path) -> None:
    async def test(child: Child) -> None:
        child.check()
        assert await child.stop() == 0
        assert "sorted out" in child.log_text()
        assert await child.stop() == 0

    program = "signal.signal(signal.SIGTERM, lambda *_: (print('sorted out'), sys.exit(0)))\n" + STAY
    run(tmp_path, program, test)


@pytest.mark.usefixtures("default_signals")
def test_one_that_ignores_sigterm_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(child_module, "STOP_S", 0.05)

    async def test(child: Child) -> None:
        assert await child.stop() == -signal.SIGKILL
        with pytest.raises(TandemError, match="the master ended with status -9: its log is empty"):
            child.check()

    run(tmp_path, "signal.signal(signal.SIGTERM, signal.SIG_IGN)\n" + STAY, test)


def test_one_that_exits_leaves_its_last_lines(tmp_path: Path) -> None:
    async def test(child: Child) -> None:
        await ended(child)
        with pytest.raises(
            TandemError, match=r"the master ended with status 3: line 2 \| line 3 \| no such bus"
        ):
            child.check()
        assert child.metrics(Ticks) is None
        child.measure()

    run(
        tmp_path,
        "here(); print(*('line %d' % n for n in range(4)), sep='\\n'); print('no such bus'); sys.exit(3)",
        test,
    )


def test_cpu_and_memory_are_those_of_the_measured_period(tmp_path: Path) -> None:
    async def test(child: Child) -> None:
        assert child.cpu_percent == 0.0
        child.measure(first=True)
        child.measure()
        assert 0.0 <= child.cpu_percent < 1000.0
        assert child.rss_mb > 1.0

    run(tmp_path, STAY, test)


def test_one_that_was_killed_is_started_again_and_counts_its_lives(tmp_path: Path) -> None:
    async def test(child: Child) -> None:
        first = child.usage
        assert first is not None
        assert first.fds > 3
        assert first.threads >= 1
        await child.kill()
        assert not child.running
        assert child.usage is None
        await child.start(Path("some.toml"), [], through=("env", "-i"))
        assert child.running
        assert child.lifetime == 2

    run(tmp_path, STAY, test)


def test_one_that_ends_while_it_is_measured_is_no_error(tmp_path: Path) -> None:
    async def test(child: Child) -> None:
        assert child._process is not None
        os.kill(child._process.pid, signal.SIGKILL)
        with suppress(ChildProcessError):  # whoever reaps it first: it is gone, and the loop not told yet
            os.waitpid(child._process.pid, 0)  # noqa: ASYNC222
        child.measure()

    run(tmp_path, STAY, test)


def test_one_that_was_never_started_is_at_peace(tmp_path: Path) -> None:
    child = Child("suit", tmp_path)
    child.check()
    child.measure()
    assert asyncio.run(child.stop()) is None
    assert child.metrics(Ticks) is None


SAY_WHERE = """
import os, pathlib
told = {name: os.environ.get(name) for name in ("STATE_DIRECTORY", "XDG_STATE_HOME", "HOME")}
pathlib.Path(sys.argv[2], "told.json").write_text(json.dumps(told))
here()
"""


def test_a_robot_of_a_run_remembers_its_angles_in_the_run_and_not_where_real_robots_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that was left in its zero pose made the next run wait for a question that nobody asked."""
    monkeypatch.setenv("STATE_DIRECTORY", "/var/lib/tandem")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))

    async def story() -> None:
        async with started(tmp_path, SAY_WHERE.replace("sys.argv[2]", repr(str(tmp_path)))):
            pass

    asyncio.run(story())
    told = json.loads((tmp_path / "told.json").read_text())
    assert told["HOME"] == str(tmp_path / "home")
    environment = {name: value for name, value in told.items() if value is not None}
    assert state_file("robot-1", environment).is_relative_to(tmp_path / "state")
