import os
import signal
import subprocess
import sys
import textwrap

import pytest

from common.process.runtime import EXIT_HUNG

pytestmark = [pytest.mark.live, pytest.mark.usefixtures("default_signals")]

HEAD = """
import asyncio, os, signal, sys, threading, time
from common.process.runtime import run
def told(number=signal.SIGTERM):
    os.kill(os.getpid(), number)
"""


def process(body: str, shutdown_s: float = 0.2) -> subprocess.CompletedProcess[str]:
    """Run `async def main(stop)` in a process of its own."""
    program = HEAD + textwrap.dedent(body) + f"\nrun(main, {shutdown_s})\nprint('over')\n"
    return subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
        env=os.environ,
    )


@pytest.mark.parametrize("number", ["SIGTERM", "SIGINT"])
def test_a_signal_sets_stop_and_the_process_ends_well(number: str) -> None:
    done = process(
        f"""
        async def main(stop):
            asyncio.get_running_loop().call_later(0.01, told, signal.{number})
            await stop.wait()
            await asyncio.sleep(0.01)
            print("cleaned up")
        """
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "cleaned up\nover\n", "")


def test_what_hangs_in_a_task_is_named() -> None:
    done = process(
        """
        async def reading_a_dead_bus():
            await asyncio.sleep(60)

        async def main(stop):
            told()
            await stop.wait()
            await reading_a_dead_bus()
        """
    )
    assert done.returncode == EXIT_HUNG
    assert "not over within 0.2 s" in done.stderr
    assert "main → reading_a_dead_bus → sleep" in done.stderr
    assert "over\n" not in done.stdout


def test_a_loop_that_is_stuck_is_ended_too() -> None:
    done = process(
        """
        def stuck():
            while True:
                time.sleep(0.01)

        async def main(stop):
            threading.Timer(0.05, told).start()
            stuck()
        """
    )
    assert done.returncode == EXIT_HUNG
    assert "thread MainThread in stuck" in done.stderr


def test_a_thread_that_holds_up_the_end_is_named() -> None:
    done = process(
        """
        def stuck_in_a_driver():
            while True:
                time.sleep(0.01)

        async def main(stop):
            asyncio.get_running_loop().run_in_executor(None, stuck_in_a_driver)
        """
    )
    assert done.returncode == EXIT_HUNG
    assert "in stuck_in_a_driver" in done.stderr


def test_a_second_signal_ends_at_once() -> None:
    done = process(
        """
        async def main(stop):
            told()
            await stop.wait()
            told(signal.SIGINT)
            await asyncio.sleep(60)
        """,
        shutdown_s=60,
    )
    assert done.returncode == 128 + signal.SIGINT
    assert "second signal" in done.stderr


def test_an_error_passes_through_and_handlers_are_restored() -> None:
    done = process(
        """
        from common.errors import LinkError

        async def failing(stop):
            raise LinkError("no such port")

        before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
        try:
            run(failing)
        except LinkError as error:
            print(error)
        assert before == (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM))

        async def main(stop):
            print(type(asyncio.get_running_loop()).__module__)
        """
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "no such port\nuvloop\nover\n", "")


def test_a_deadline_that_was_met_does_not_strike_later() -> None:
    done = process(
        """
        async def quick(stop):
            told()
            await stop.wait()

        run(quick, 0.05)
        time.sleep(0.2)

        async def main(stop):
            assert not stop.is_set()
        """
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_a_link_whose_close_hangs_does_not_hold_the_process() -> None:
    done = process(
        """
        from common.link.link_session import LinkSession

        class HangingSession:
            def close(self):
                time.sleep(60)

        async def main(stop):
            session = LinkSession(HangingSession(), asyncio.get_running_loop())
            assert not await session.close(timeout_s=0.05)
        """,
        shutdown_s=10,
    )
    assert (done.returncode, done.stdout) == (0, "over\n")
    assert "did not close within 0.05 s" in done.stderr


def test_a_terminal_that_closes_stops_in_order() -> None:
    done = process(
        """
        async def main(stop):
            for _ in range(3):
                told(signal.SIGHUP)
            told()  # as a session's manager does beside it
            await stop.wait()
            await asyncio.sleep(0.01)
            print("cleaned up")
        """
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "cleaned up\nover\n", "")


@pytest.mark.parametrize("number", ["SIGHUP", "SIGINT"])
def test_a_signal_inherited_as_ignored_stays_so_and_sigterm_stops(number: str) -> None:
    done = process(
        f"""
        signal.signal(signal.{number}, signal.SIG_IGN)  # as nohup, or a script that starts it with &, does

        async def main(stop):
            told(signal.{number})
            await asyncio.sleep(0.02)
            assert not stop.is_set()
            told()
            await stop.wait()
            print("cleaned up")
        """
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "cleaned up\nover\n", "")


def test_an_act_goes_on_though_the_terminal_closes() -> None:
    program = HEAD + textwrap.dedent(
        """
        async def main(stop):
            told(signal.SIGHUP)
            await asyncio.sleep(0.02)
            assert not stop.is_set()

        run(main, hangup_stops=False)
        print(signal.getsignal(signal.SIGHUP) is signal.SIG_DFL)
        """
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=30, check=False
    )
    assert (done.returncode, done.stdout) == (0, "True\n")


def test_what_hangs_is_ended_though_nobody_can_be_told() -> None:
    done = process(
        """
        async def main(stop):
            os.close(2)
            told()
            await asyncio.sleep(60)
        """
    )
    assert done.returncode == EXIT_HUNG
