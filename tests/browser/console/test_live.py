"""The page with a real suit, master, slave and console: Esc stops the robot, judged by its encoders."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from common.clock import monotonic_ns, to_ns, to_s
from deploy.harness.console import ConsoleChild
from deploy.harness.host import HostWatch
from deploy.harness.rig import OPERATOR, ROBOT, Rig, open_rig
from deploy.harness.start import start_all
from tests.browser.console.browser import ARGUMENTS, CHROMIUM

if TYPE_CHECKING:
    from tests.conftest import OnThisHost

playwright_api = pytest.importorskip("playwright.async_api", reason="the extra `browser` is not installed")
pytestmark = [
    pytest.mark.live,
    pytest.mark.timeout(400),
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium here: apt install chromium"),
]
STILL_RAD = 0.0031
"""Two counts of an encoder."""
MOVES_RAD = 0.05
STANDS_S = 0.5
WAIT_MS = 60_000


async def until(page: Any, holds: str, timeout_s: float = 40.0) -> None:
    """Wait until an expression is true in the page, whose policy forbids it to evaluate one by itself."""
    end_ns = monotonic_ns() + to_ns(timeout_s)
    while not await page.evaluate(holds):
        assert monotonic_ns() < end_ns, f"not within {timeout_s:g} s: {holds}; {await page.title()}"
        await page.wait_for_timeout(20)


async def until_state(page: Any, wanted: str, timeout_s: float = 40.0) -> None:
    await until(page, f"document.body.dataset.state === '{wanted}'", timeout_s)


async def engage(page: Any, deadman: str = "") -> None:
    """By the keyboard, as a person does: again where the robot refused or held.

    `deadman`: a key that is pressed anew before each try, and stays down.
    """
    for _ in range(5):
        if deadman:
            await page.keyboard.up(deadman)
            await page.keyboard.down(deadman)
        await page.keyboard.down("F2")
        await page.wait_for_timeout(1300)
        await page.keyboard.up("F2")
        try:
            return await until_state(page, "follows", 8.0)
        except AssertionError:
            continue
    raise AssertionError(f"it does not follow: {await page.inner_text('#why')}")


def moved_rad(rig: Rig) -> float:
    """How far any encoder moved within the last half second."""
    states = rig.observer.states[-25:]
    return float(np.ptp([state.position_rad for state in states], axis=0).max()) if states else 0.0


def check_standstill(rig: Rig) -> None:
    """From half a second after the robot said that it is stopped, no encoder moves."""
    states = rig.observer.states
    stopped = next(i for i, state in enumerate(states) if state.guard == "estop")
    began_ns = states[stopped].encoder_ns
    after = [s.position_rad for s in states[stopped:] if to_s(s.encoder_ns - began_ns) > STANDS_S]
    assert len(after) > 10
    assert np.ptp(np.array(after), axis=0).max() <= STILL_RAD


async def check_table(page: Any, rig: Rig) -> None:
    """The joint table shows the encoders; the robot stands."""
    await page.click("#show-joints")
    await page.wait_for_timeout(1000)
    cells = "[...document.querySelectorAll('#joints tr[data-joint] td:nth-child(2)')]"
    shown = await page.evaluate(f"{cells}.map((cell) => Number(cell.textContent))")
    assert rig.observer.state is not None
    np.testing.assert_allclose(shown, np.degrees(rig.observer.state.position_rad), atol=0.2)


def test_a_person_engages_sees_it_move_and_stops_it_by_esc(on_this_host: OnThisHost, tmp_path: Path) -> None:
    async def story(host: HostWatch) -> None:
        overrides = {"master": [f'tap.socket="{tmp_path / "master.sock"}"']}
        async with open_rig(overrides=overrides) as rig, playwright_api.async_playwright() as playwright:
            await start_all(rig)
            console = ConsoleChild(rig)
            await console.start()
            browser = await playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
            page = await browser.new_page(viewport={"width": 1366, "height": 768}, locale="en-GB")
            said: list[str] = []
            page.on("pageerror", lambda error: said.append(str(error)))
            await page.goto(console.operator_address)
            await until_state(page, "holds")
            await until(page, f"document.getElementById('badges').textContent.includes('{OPERATOR}')")
            await page.wait_for_selector("#scene canvas")
            await engage(page)
            look = "document.querySelector('#scene canvas').toDataURL()"
            first = await page.evaluate(look)
            await until(page, f"{look} !== {first!r}")
            rig.observer.recording = True
            await rig.until(lambda: moved_rad(rig) > MOVES_RAD, 60.0, "motion")
            await page.keyboard.press("Escape")
            await until_state(page, "stopped")
            await until(page, "document.querySelectorAll('#lights li.on').length === 3")
            await page.wait_for_timeout(1500)
            check_standstill(rig)
            await check_table(page, rig)
            await restart_master(page, rig)
            assert said == []
            await browser.close()

    on_this_host(story)


async def restart_master(page: Any, rig: Rig) -> None:
    """The page says that the master is silent, goes on showing the robot, and recovers."""
    await rig.children["master"].stop()
    await page.wait_for_selector("#badges [data-tone=no_master]", timeout=WAIT_MS)
    assert await page.evaluate("document.body.dataset.state") == "stopped"
    await rig.start("master")
    await page.wait_for_selector("#badges [data-tone=no_master]", state="detached", timeout=WAIT_MS)
    assert await page.evaluate("document.body.dataset.state") == "stopped"
    assert ROBOT in await page.title()


def test_the_deadman_is_a_key_and_the_stop_needs_no_master(on_this_host: OnThisHost) -> None:
    async def story(host: HostWatch) -> None:
        folder = Path(tempfile.mkdtemp(prefix="tandem-"))  # a socket's path has at most 107 bytes
        held = f'operator.deadman={{source="console",socket="{folder / "deadman.sock"}"}}'
        given = {"master": [f'tap.socket="{folder / "master.sock"}"', held]}
        async with open_rig(overrides=given) as rig, playwright_api.async_playwright() as playwright:
            console = ConsoleChild(rig)
            browser = await playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
            context = await browser.new_context(viewport={"width": 1366, "height": 768}, locale="en-GB")
            page = await context.new_page()

            async def start(name: str) -> None:
                await rig.start(name)
                if name == "master":
                    await console.start()
                    await page.goto(console.operator_address)
                    await page.wait_for_selector("#hold", timeout=WAIT_MS)
                    await page.keyboard.down("F9")

            await start_all(rig, start=start)
            await engage(page, "F9")
            await page.keyboard.up("F9")
            await rig.until(lambda: rig.observer.guard == "hold", 5.0, "hold")
            await until_state(page, "holds")
            assert "deadman" in await page.inner_text("#why")
            # opened before: while a page opens, the held one may be too late with its beats
            other = await context.new_page()
            await other.goto(console.address)
            await until_state(other, "holds")
            await page.bring_to_front()
            await engage(page, "F9")
            await until_state(other, "follows")
            await page.close()
            await rig.until(lambda: rig.observer.guard == "hold", 5.0, "hold after the page was lost")
            await rig.children["master"].kill()
            await other.wait_for_selector("#badges [data-tone=no_master]", timeout=WAIT_MS)
            await other.keyboard.press("Escape")
            await rig.until(lambda: rig.observer.guard == "estop", 5.0, "e-stop")
            await until_state(other, "stopped")
            await browser.close()

    on_this_host(story)
