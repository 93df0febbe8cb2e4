"""A robot's process without a robot: publishes state and video, and tells what commands it has heard."""

from __future__ import annotations

import asyncio
import json
import logging
import sys
from collections import Counter
from pathlib import Path

from common.config.load import load_config
from common.config.section import Section
from common.errors import ConfigMistake
from common.link import open_session
from common.link.audit import Audit
from common.link.config import LinkConfig
from common.metrics.tree import to_tree
from common.process.runtime import run
from common.wire.sender import operator_of
from common.wire.topics import COMMAND, CONTROL, STATE, STOP, VIDEO


class RobotFile(Section):
    robot: str
    link: LinkConfig

    def mistakes(self) -> list[ConfigMistake]:
        return self.link.mistakes()


async def robot(stop: asyncio.Event) -> None:
    config = load_config(Path(sys.argv[1]), RobotFile)
    audit = Audit(config.link)
    heard: Counter[str] = Counter()
    async with open_session(config.link) as session:
        audit.attach(session)
        link = session.link(config.robot)
        state, video = link.publish(STATE), link.publish(VIDEO)
        link.subscribe_keys(
            COMMAND, lambda key, payload, _: heard.update([f"{payload.decode()} as {operator_of(key)}"])
        )
        link.answer(CONTROL, lambda payload, _: payload)
        link.answer(STOP, lambda payload, _: payload)
        link.declare_alive("slave")
        logging.getLogger("robot").info("here")
        while not stop.is_set():
            state(b"state")
            video(b"picture")
            sys.stdout.write(json.dumps({"heard": heard, "access": to_tree(audit.metrics())}) + "\n")
            sys.stdout.flush()
            await asyncio.sleep(0.02)


if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO)
    run(robot)
