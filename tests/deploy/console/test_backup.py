"""A stop outlives the console: another process goes on with what nobody is done with."""

from __future__ import annotations

import asyncio
import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from aiohttp.test_utils import unused_port

from common.link import open_link
from common.link.config import LinkConfig
from common.wire.stop import StopAnswer, pack_stop_answer, read_stop
from common.wire.topics import STOP
from deploy.console.backup import StopBackup
from deploy.console.backup_process import stops_left

LINK = LinkConfig(connect=["tcp/127.0.0.1:1"])
NOT_STARTED = ("/no/such/program",)
CONSOLE = """
import sys, time
from common.link.config import LinkConfig
from deploy.console.backup import StopBackup
backup = StopBackup(LinkConfig(connect=[sys.argv[1]]), "nurse-1")
assert backup.start() and backup.keep("robot-1") and backup.keep("robot-2")
backup.done("robot-2")
print("202", flush=True)
time.sleep(600)
"""
"""What a console does before it answers; then it stands."""


def lines(*messages: object, cut: str = "") -> io.StringIO:
    return io.StringIO("".join(json.dumps(message) + "\n" for message in messages) + cut)


def test_what_is_left_is_what_nobody_is_done_with() -> None:
    where = {"link": {}, "operator": "nurse-1"}
    told = lines({"where": where}, {"stop": "a"}, {"stop": "b"}, {"done": "a"}, {"stop": "a"}, {"done": "b"})
    assert stops_left(told) == (where, ["a"])


def test_a_line_that_was_cut_off_is_no_stop() -> None:
    assert stops_left(lines({"stop": "a"}, {"done": "a"}, cut='{"stop": "b')) == ({}, [])


def test_without_a_process_a_stop_is_not_kept() -> None:
    backup = StopBackup(LINK, "nurse-1", NOT_STARTED)
    assert not backup.start()
    assert not backup.keep("robot-1")
    backup.done("robot-1")
    backup.close()


def test_one_that_died_is_begun_anew_with_all_that_is_open(tmp_path: Path) -> None:
    kept = tmp_path / "lines"
    code = f"import sys; print('ready', flush=True); open({str(kept)!r}, 'w').write(sys.stdin.read())"
    backup = StopBackup(LINK, "nurse-1", (sys.executable, "-c", code))
    assert backup.start()
    until_up(backup)
    assert backup.keep("robot-1")
    assert backup._process is not None
    backup._process.kill()
    backup._process.wait()
    assert backup.keep("robot-2")
    until_up(backup)
    process = backup._process.pid
    backup.close()
    for _ in range(1000):
        if kept.exists() and kept.read_text():
            break
        time.sleep(0.01)
    while _lives(process):
        time.sleep(0.01)
    assert stops_left(io.StringIO(kept.read_text()))[1] == ["robot-1", "robot-2"]


def until_up(backup: StopBackup) -> None:
    """Until it has said that it runs."""
    for _ in range(1000):
        assert not backup._never_up(backup._began_ns)
        if backup._up:
            return
        time.sleep(0.01)
    raise AssertionError("it has not said that it runs")


def ended(backup: StopBackup) -> None:
    assert backup._process is not None
    backup._process.wait()


def test_one_that_ends_before_it_runs_is_no_backup_and_is_said_once(caplog: pytest.LogCaptureFixture) -> None:
    backup = StopBackup(LINK, "nurse-1", (sys.executable, "-c", "raise SystemExit('no such module')"))
    assert backup.start(), "nobody can know yet"
    ended(backup)
    began_ns = backup._began_ns
    for second in range(20):
        backup.look(began_ns + second * 10**9)
    assert backup._began_ns == began_ns, "not begun again all the time"
    assert [each.message for each in caplog.records if "it does not start" in each.message] != []
    assert len(caplog.records) == 1
    assert not backup.keep("robot-1"), "the page must not say that the stop is kept"
    ended(backup)
    backup.close()


def test_one_that_never_says_that_it_runs_is_no_backup_after_ten_seconds() -> None:
    backup = StopBackup(LINK, "nurse-1", (sys.executable, "-c", "import sys; sys.stdin.read()"))
    assert backup.start()
    assert backup.keep("robot-1")
    backup._began_ns -= 10_000_000_001
    assert not backup.keep("robot-1")
    backup.done("robot-1")
    backup.close()


def test_one_that_died_later_is_begun_anew_without_a_stop(caplog: pytest.LogCaptureFixture) -> None:
    code = "import sys; print('ready', flush=True); sys.stdin.read()"
    backup = StopBackup(LINK, "nurse-1", (sys.executable, "-c", code))
    assert backup.start()
    until_up(backup)
    backup.look(backup._began_ns)
    assert caplog.records == []
    assert backup._process is not None
    before = backup._process
    before.kill()
    before.wait()
    backup.look(backup._began_ns)
    assert [each.message for each in caplog.records if "it has ended" in each.message] != []
    assert backup._process is not before
    until_up(backup)
    assert backup.keep("robot-1")
    backup.done("robot-1")
    backup.close()


def test_the_real_process_says_that_it_runs() -> None:
    backup = StopBackup(LINK, "nurse-1")
    assert backup.start()
    until_up(backup)
    backup.close()


def _lives(pid: int) -> bool:
    """Whether a child of this process, which waits for none, still runs."""
    return os.waitpid(pid, os.WNOHANG) == (0, 0)


@pytest.mark.timeout(60)
def test_a_console_that_is_killed_after_it_answered_stops_the_robot_all_the_same() -> None:
    async def story() -> list[str]:
        at, asked, stopped = f"tcp/127.0.0.1:{unused_port()}", [], asyncio.Event()
        loop = asyncio.get_running_loop()
        async with open_link(LinkConfig(listen=[at]), "robot-1") as robot:

            def answer(payload: bytes, _: int) -> bytes:
                asked.append(read_stop(payload))
                loop.call_soon_threadsafe(stopped.set)
                return pack_stop_answer(StopAnswer(True, "estop", "stopped", 5))

            robot.answer(STOP, answer)
            console = await asyncio.create_subprocess_exec(
                sys.executable, "-c", CONSOLE, at, stdout=subprocess.PIPE
            )
            assert console.stdout is not None
            assert await console.stdout.readline() == b"202\n"
            os.kill(console.pid, signal.SIGKILL)
            await console.wait()
            assert not asked, "the console itself never asked"
            async with asyncio.timeout(40.0):
                await stopped.wait()
        return [name or "" for name in asked]

    assert set(asyncio.run(story())) == {"nurse-1"}
