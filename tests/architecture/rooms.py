"""The order of the rooms: which room may import which, and which files must stay pure."""

from collections.abc import Sequence
from fnmatch import fnmatch

from tests.architecture.imports import SourceTree

ORDER: Sequence[Sequence[str]] = [
    ["deploy"],
    ["deploy/experiments", "deploy/ops"],
    ["deploy/calibrate", "deploy/harness", "deploy/console"],
    ["deploy/client"],
    ["deploy/sim"],
    ["deploy/measure", "deploy/recorded", "deploy/viewer", "deploy/study"],
    ["deploy/report", "deploy/certificates", "deploy/examples", "deploy/ros"],
    ["master", "slave"],
    ["master/calibrate", "master/comfort", "master/alarms", "master/journal"],
    ["master/joint_angles"],
    ["master/orientation"],
    ["master/deadman"],
    ["master/capture"],
    ["master/suit"],
    ["slave/camera", "slave/stop_inputs"],
    ["slave/contact"],
    ["slave/servos", "slave/track"],
    ["slave/limit"],
    ["slave/guard", "slave/attitude"],
    ["slave/encoders", "slave/model"],
    ["common/link", "common/tap"],
    ["common/latency", "common/reach"],
    ["common/clock_sync", "common/recording", "common/picture_code"],
    ["common/wire", "common/process", "common/can", "common/skeleton", "common/inputs"],
    ["common/config", "common/metrics", "common/log"],
    ["common"],
]  # fmt: skip
"""Rooms from the top down. A file imports its own room and the rooms below; `common` is its top files alone.
Rooms on one line do not import each other."""

IMPURE = [
    "common/clock.py", "common/clock_sync/services.py",
    "common/can/*", "common/inputs/device.py", "common/inputs/reader.py",
    "common/link/*", "common/tap/*", "common/log/handler.py", "common/log/streams.py",
    "common/process/*", "common/recording/recorder.py",
    "master/__main__.py", "master/app.py", "master/deadman/switches.py",
    "master/deadman/hold_socket.py", "master/fleet.py", "master/robot.py",
    "master/alarms/player.py", "master/journal/tap.py",
    "slave/__main__.py", "slave/app.py", "slave/attitude/port.py", "slave/camera/*", "slave/servos/*",
    "slave/stop_inputs/gpio.py",
]  # fmt: skip
"""The adapters. Nothing else in common, master and slave may touch a bus, link, clock or event loop."""
RIM = {
    "asyncio", "zenoh", "can", "time", "socket", "uvloop", "serial", "canopen", "dynamixel_sdk", "evdev",
    "gpiod", "sounddevice",
}  # fmt: skip


def room_of(path: str) -> str:
    """The innermost room of `ORDER` that holds the file at `path`."""
    rooms = [room for level in ORDER for room in level if path.startswith(room + "/")]
    return max(rooms, key=len)


def against_the_order(tree: SourceTree) -> list[str]:
    """Every import that goes up, sideways, or into the tests."""
    level = {room: i for i, rooms in enumerate(ORDER) for room in rooms}
    wrong = []
    for each in tree.imports:
        path = tree.where(each.source)
        place = f"{path}:{each.line} imports {each.target}"
        if each.target.partition(".")[0] == "tests":
            wrong.append(place)
        elif each.target in tree.paths:
            source, target = room_of(path), room_of(tree.where(each.target))
            others = {source.partition("/")[0], target.partition("/")[0]} == {"master", "slave"}
            sideways = level[source] == level[target]
            if source != target and (level[source] > level[target] or sideways or others):
                wrong.append(place)
    return wrong


def between_siblings(tree: SourceTree) -> list[str]:
    """Every import from one experiment to another, and from one of ops to another."""
    wrong = []
    for each in tree.imports:
        if each.target not in tree.paths:
            continue
        for room in ("deploy.experiments.", "deploy.ops."):
            if each.source.startswith(room) and each.target.startswith(room):
                source, target = (
                    name.removeprefix(room).split(".")[0] for name in (each.source, each.target)
                )
                if source != target:
                    wrong.append(f"{tree.where(each.source)}:{each.line} imports {each.target}")
    return wrong


def impure(tree: SourceTree) -> list[str]:
    """Every import of a bus, a link, a clock or an event loop outside the adapters."""
    return [
        f"{path}:{each.line} imports {each.target}"
        for each in tree.imports
        if (path := tree.where(each.source)).startswith(("common/", "master/", "slave/"))
        and each.target.partition(".")[0] in RIM
        and not any(fnmatch(path, pattern) for pattern in IMPURE)
    ]
