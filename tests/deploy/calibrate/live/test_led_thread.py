"""A calibration that is ended waits for the thread that shows it, before recordings are closed."""

from __future__ import annotations

import asyncio
import threading

import pytest

from deploy.calibrate.live.led import whole_in_thread


def test_who_is_cancelled_waits_for_the_thread() -> None:
    entered, may_end = threading.Event(), threading.Event()
    ended = []

    def call() -> bool:
        entered.set()
        may_end.wait()
        ended.append(True)
        return True

    async def story() -> None:
        task = asyncio.create_task(whole_in_thread(call))
        await asyncio.to_thread(entered.wait)
        task.cancel()
        try:
            for _ in range(5):
                await asyncio.sleep(0)
            assert not task.done()
        finally:
            may_end.set()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert ended

    asyncio.run(story())
