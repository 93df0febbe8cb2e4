import subprocess

import pytest

from deploy.experiments.bench.loop import burn
from deploy.experiments.bench.pipeline import codec, ticks
from deploy.experiments.bench.worker import BenchError, beside, command_of, in_worker


def test_a_worker_returns_what_its_function_does() -> None:
    figures = in_worker(codec, 0.01)
    assert set(figures) == {"min", "median", "p99", "max", "count"}


def test_a_worker_that_fails_says_why_in_one_line() -> None:
    with pytest.raises(BenchError, match=r"ticks: TypeError: .*count") as caught:
        in_worker(ticks, 0.01)
    assert "\n" not in str(caught.value)


def test_a_worker_beside_ends_with_its_block(monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[subprocess.Popen[str]] = []
    popen = subprocess.Popen

    def start(*args: object, **options: object) -> subprocess.Popen[str]:
        started.append(popen(*args, **options))  # type: ignore[call-overload]
        return started[-1]

    monkeypatch.setattr(subprocess, "Popen", start)
    with beside(burn):
        assert started[0].poll() is None
    assert started[0].poll() is not None


def test_a_worker_ends_when_its_parent_does() -> None:
    # the pipe that a worker watches ends as it would if the parent were killed
    ended = subprocess.run(command_of(burn, {}), stdin=subprocess.DEVNULL, timeout=30, check=False)
    assert ended.returncode == 1
