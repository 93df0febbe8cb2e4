"""Screenshots of the page in its states, to look at: `python -m tests.browser.console.shots FOLDER`."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import simplejpeg
from playwright.sync_api import sync_playwright

from common.errors import RobotError
from common.metrics.tree import to_tree
from common.skeleton import load_skeleton
from slave.camera.drawn import DrawnCamera
from slave.camera.lens import eye
from tests.browser.console.browser import ARGUMENTS, CHROMIUM
from tests.browser.console.fake import FakeConsole


def _room(fake: FakeConsole) -> bytes | None:
    """What the simulated robot sees, arms ahead; None where this machine cannot draw."""
    try:
        camera = DrawnCamera("nursing", "head", 640, 480)
        posture = np.array(_bowed(fake, 0.0))
        return bytes(simplejpeg.encode_jpeg(np.ascontiguousarray(camera.draw(posture)), quality=85))
    except RobotError:
        return None


def _bowed(fake: FakeConsole, at_s: float) -> list[float]:
    """Its posture at a time, the head bowed to its hands."""
    names = [joint["name"] for joint in fake.shape["joints"]]
    return [0.35 if n == "neck_pitch" else angle for n, angle in zip(names, fake.posture(at_s), strict=True)]


def _foretell(fake: FakeConsole) -> None:
    """The robot is seen as it was, and is somewhere else by now."""
    lens, will = eye(load_skeleton("nursing"), "head", 640, 480), _bowed(fake, 0.5)
    assert lens is not None
    fake.facts = {"lenses": {"head": to_tree(lens)}}
    foretold = {"position": will, "tube": [0.02] * len(will), "ahead_ms": 150.0}
    fake.view = {"encoder": _bowed(fake, 0.0), "ahead": foretold}


def _say(what: object) -> None:
    sys.stderr.write(f"{what}\n")


def main(folder: Path, only: str = "") -> None:
    folder.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        for name, size, language in (("small", (1366, 768), "en"), ("large", (1920, 1080), "zh-CN")):
            if only and only != name:
                continue
            fake = FakeConsole()
            fake.picture = _room(fake)
            page = browser.new_page(viewport={"width": size[0], "height": size[1]}, locale=language)
            page.on("console", _say)
            page.on("pageerror", _say)
            page.goto(fake.address)
            page.wait_for_selector("#scene canvas")
            page.wait_for_timeout(1500)
            page.screenshot(path=folder / f"{name}-follows.png")
            _foretell(fake)
            page.wait_for_timeout(1500)
            page.screenshot(path=folder / f"{name}-foretold.png")
            fake.facts, fake.view = {}, {}
            page.keyboard.press("Escape")
            page.wait_for_timeout(700)
            page.screenshot(path=folder / f"{name}-stopped.png")
            fake.guard, fake.stop, fake.reason = "hold", None, "lease lost: commands are silent for 0.2 s"
            fake.pictures = False
            page.click("#show-zones")
            page.click("#show-joints")
            page.wait_for_timeout(1200)
            page.screenshot(path=folder / f"{name}-holds-stale.png")
            fake.silent = True
            page.wait_for_timeout(1200)
            page.screenshot(path=folder / f"{name}-no-contact.png")
            fake.silent, fake.pictures = False, True
            page.goto(f"{fake.address}/engineer")
            page.wait_for_timeout(2500)
            page.screenshot(path=folder / f"{name}-engineer.png")
            page.close()
            fake.close()
        browser.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:])
