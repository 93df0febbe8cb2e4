"""What becomes of the terminal ends no process: seen from outside, in processes of their own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

HEAD = "import sys\nfrom common.log.streams import lossy, lost_output, secure\nsecure()\n"


def run(body: str, **how: object) -> subprocess.CompletedProcess[str]:
    options: dict[str, object] = {"capture_output": True, **how}
    if "stdout" in how:
        options = {"stderr": subprocess.PIPE, **how}
    command = [sys.executable, "-c", HEAD + body]
    done: subprocess.CompletedProcess[str] = subprocess.run(  # type: ignore[call-overload]
        command, text=True, errors="replace", timeout=60, check=False, **options
    )
    return done


@pytest.mark.parametrize("closed", [(0,), (1,), (2,), (0, 1), (0, 1, 2)], ids=str)
def test_closed_descriptors_stay_closed_and_uvloop_ends_in_order(
    closed: tuple[int, ...], tmp_path: Path
) -> None:
    def close() -> None:
        for fd in closed:
            os.close(fd)

    done_file = tmp_path / "done"
    done = run(
        "import asyncio, os\n"
        "from common.process.runtime import run\n"
        "async def main(stop):\n"
        "    print('words', flush=True)\n"
        "    print('words', file=sys.stderr, flush=True)\n"
        "    assert min(os.dup(0), os.dup(1)) > 2\n"
        "    sys.stdin.read(0)\n"
        "run(main)\n"
        f"open({str(done_file)!r}, 'w').write('done')\n",
        preexec_fn=close,
    )
    assert done.returncode == 0, done.stderr
    assert done_file.read_text() == "done"


def test_a_full_disk_and_a_closed_pipe_lose_text_and_nothing_else() -> None:
    words = "for _ in range(10_000): print('words' * 20)\nprint(lost_output(), file=sys.stderr)"
    with Path("/dev/full").open("w") as full:
        done = run(words, stdout=full)
    assert (done.returncode, done.stderr) == (0, "No space left on device\n")
    reading, writing = os.pipe()
    os.close(reading)
    done = run(words, stdout=writing)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, "None\n")  # a reader that has gone wants no more


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp1252", "koi8-r"])
def test_a_figure_comes_in_what_the_terminal_can_show(encoding: str) -> None:
    environment = {**os.environ, "PYTHONIOENCODING": encoding}
    done = run("print('12.5°/s ± 3 µT → 4², naïve Žižek 漢 \\ud800')", env=environment)
    assert done.returncode == 0, done.stderr
    if encoding == "ascii":
        assert done.stdout == "12.5 deg/s +/- 3 uT -> 42, naive Zizek ? ?\n"


def test_every_command_s_table_comes_out_on_an_ascii_terminal() -> None:
    environment = {**os.environ, "PYTHONIOENCODING": "ascii", "COLUMNS": "80"}
    body = (
        "from rich.console import Console\n"
        "from deploy.client.answer import RobotAnswer\n"
        "from deploy.client.heard import Heard\n"
        "from deploy.client.status import robot_status\n"
        "from deploy.client.status_table import status_table\n"
        "one = robot_status(RobotAnswer('r', True, 'turns at 3°/s'), Heard())\n"
        "Console().print(status_table({'r': one}))\n"
    )
    done = run(body, env=environment)
    assert done.returncode == 0, done.stderr
    assert "turns at 3 deg/s" in done.stdout


def test_a_terminal_that_somebody_made_non_blocking_loses_nothing() -> None:
    body = (
        "import os\nos.set_blocking(1, False)\n"
        "for _ in range(5000): print('words' * 20)\n"
        "sys.exit(lost_output())"
    )
    done = run(body)
    assert (done.returncode, done.stdout.count("\n")) == (0, 5000)


def test_a_stream_that_was_replaced_is_let_be(capsys: pytest.CaptureFixture[str]) -> None:
    from common.log.streams import secure

    before = sys.stdout, sys.stderr
    secure()
    assert (sys.stdout, sys.stderr) == before
