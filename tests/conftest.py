"""What tests share: signals, children that are ended, a host that may spoil a trial, and a count of skips."""

from __future__ import annotations

import asyncio
import os
import signal
from collections.abc import Awaitable, Callable, Iterator
from contextlib import suppress
from pathlib import Path

import psutil
import pytest
from hypothesis import HealthCheck, settings

from common.clock import monotonic_ns
from common.errors import TandemError
from deploy.harness.host import HostWatch, watch_host

from .skips import TOO_MANY_SKIPPED, counted, read_allowed, too_many

# how long an example takes is the machine's affair; and a change is judged by the same examples each time
settings.register_profile(
    "tandem", deadline=None, derandomize="CI" in os.environ, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("tandem")

TRIES = 4
WHOLE = ("", "not bench", "not live and not bench", "live and not bench")
"""What `-m` may be for a run of all tests, or of one of the two halves that the Makefile runs."""

Story = Callable[[HostWatch], Awaitable[None]]
OnThisHost = Callable[[Story], None]
"""The fixture's type."""


@pytest.fixture(scope="session")
def recordings_folder() -> Path:
    """Real recordings; they are not in the repository."""
    folder = os.environ.get("TANDEM_DATA")
    if not folder:
        pytest.skip("TANDEM_DATA does not name the folder of recordings")
    return Path(folder)


@pytest.fixture(scope="session")
def real_person(recordings_folder: Path) -> Path:
    """100 s of a whole person's units at 100 Hz."""
    return recordings_folder / "human_full_body.npz"


@pytest.fixture
def on_this_host() -> OnThisHost:
    """Runs a story of real processes beside a loop that does nothing but tick.

    Where it fails and the host is shown to have stalled meanwhile (deploy/harness/excuse.py), nothing was
    shown, and it is tried again, up to TRIES times in all; else it has failed. A host that spoilt every try
    is told as the reason to skip, and tests/skips.toml says how many such there may be.
    """

    def run(story: Story) -> None:
        for _ in range(TRIES):
            spoilt = asyncio.run(_spoilt(story))
            if not spoilt:
                return
            print(f"tried again: {spoilt}")  # noqa: T201
        pytest.skip(f"the host stalled in each of {TRIES} tries; last: {spoilt}")

    return run


@pytest.fixture
def default_signals() -> Iterator[None]:
    """SIGINT, SIGTERM and SIGHUP as a terminal gives them, for this process and for what it starts.

    Under nohup, in a script's background job and on many CI runners they come ignored or blocked, and
    children inherit that. A test that sends one uses this fixture (tests/test_signals.py looks).
    """
    handlers = {signal.SIGINT: signal.default_int_handler} | dict.fromkeys(
        (signal.SIGTERM, signal.SIGHUP), signal.SIG_DFL
    )
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    blocked = signal.pthread_sigmask(signal.SIG_UNBLOCK, handlers)
    yield
    signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
    for number, handler in before.items():
        signal.signal(number, signal.SIG_DFL if handler is None else handler)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Derive the markers that follow from others, or from what a test asks for."""
    for item in items:
        if any(item.get_closest_marker(name) for name in ("net", "kernel_can")):
            item.add_marker("live")
        if "whole_way" in item.path.parts:
            item.add_marker("long")
        if "recordings_folder" in getattr(item, "fixturenames", ()):
            item.add_marker("recordings")


@pytest.fixture(autouse=True)
def no_child_is_left() -> Iterator[None]:
    """A test that leaves a process running fails itself; the process is killed, so no other test fails."""
    before = _children()
    yield
    left = [_ended_by_force(pid) for pid in _children() - before]
    assert not any(left), f"left running, now killed: {'; '.join(filter(None, left))}"


def _children() -> set[int]:
    """Processes that any thread of this one started and nobody has waited for, by the kernel's own list."""
    found: set[int] = set()
    for file in Path("/proc/self/task").glob("*/children"):
        with suppress(OSError):  # a thread that has just ended
            found |= {int(pid) for pid in file.read_text().split()}
    return found


def _ended_by_force(pid: int) -> str:
    """The command line of a process that still ran and is killed now; empty where it had ended."""
    try:
        process = psutil.Process(pid)
        command = " ".join(process.cmdline())
        # one that serves this process's own multiprocessing lives as long as it
        if process.status() == psutil.STATUS_ZOMBIE or "multiprocessing" in command:
            return ""
        process.kill()
    except psutil.NoSuchProcess:
        return ""
    return command or f"process {pid}"


async def _spoilt(story: Story) -> str:
    """Why the trial failed where the host is to blame, empty where it went well; else raises what it did."""
    async with watch_host() as host:
        began_ns = monotonic_ns()
        try:
            await story(host)
        except (AssertionError, TandemError) as error:
            excuse = await host.excuse(began_ns)
            if not excuse:
                raise
            return f"{excuse}; {str(error) or repr(error)}"
        return ""


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """In CI a whole run fails where more tests skipped than tests/skips.toml allows.

    Also beside tests that failed: .ci/tests runs those once more, which would hide the skips.
    """
    if _skips_wrong(session.config):
        session.exitstatus = TOO_MANY_SKIPPED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Print how many tests of a whole run skipped, by reason, and what of it is too much."""
    if not _whole(config):
        return
    for line in counted(_skipped(config)):
        terminalreporter.write_line(line)
    for line in _skips_wrong(config):
        terminalreporter.write_line(f"tests/skips.toml: {line}", red=True)


def _whole(config: pytest.Config) -> bool:
    """Whether the whole suite is run, or one of its two halves; the benches are always apart."""
    option = config.option
    return (
        config.args_source is pytest.Config.ArgsSource.TESTPATHS
        and option.markexpr in WHOLE
        and not option.keyword
        and not option.collectonly
    )


def _skipped(config: pytest.Config) -> list[str]:
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    reports = reporter.stats.get("skipped", []) if reporter is not None else []
    return [str(report.longrepr[2]).removeprefix("Skipped: ") for report in reports]


def _skips_wrong(config: pytest.Config) -> list[str]:
    if not os.environ.get("CI") or not _whole(config):
        return []
    return too_many(_skipped(config), read_allowed(Path(__file__).with_name("skips.toml")), os.environ)
