"""`tandem inputs`: the pedals, buttons and keyboards of this host, and what each tells while one presses."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from common.clock import Clock, monotonic_ns
from common.errors import TandemError
from common.inputs.device import InputError, Opener, OpenInput, key_name, open_input
from common.inputs.key_state import DOWN, UP, KeyState
from common.inputs.listing import ROOT, ListedDevice, list_devices
from deploy.report.options import AsJson
from deploy.report.tables import UNKNOWN, plain_table

SHORT = (
    "press and release came at once: it cannot be held. Program the pedal to hold its key (PCsensor: a key, "
    "not a string), or use another"
)
DENIED = "this user may not read it: usermod -a -G input USER"


def inputs(
    as_json: AsJson = False,
    seconds: Annotated[
        float | None, typer.Option(help="End after so long; otherwise with Ctrl-C.", min=0.0)
    ] = None,
) -> None:
    """List the input devices of this host; then press the pedal, and see what to write into the file.

    Stop the master before: it grabs its pedal, and no other program receives the keys.

    Example: `tandem inputs`
    """
    devices = list_devices()
    if as_json:
        typer.echo(json.dumps([as_tree(device) for device in devices], indent=2, ensure_ascii=False))
        return
    if not devices:
        raise TandemError("the kernel has no input device: plug the pedal in; a container needs /dev/input")
    Console().print(as_table(devices))
    typer.echo("Press the pedal. Ctrl-C ends.")
    with suppress(KeyboardInterrupt):
        asyncio.run(watch(devices, seconds, typer.echo))


def as_tree(device: ListedDevice, root: Path = ROOT) -> dict[str, object]:
    """A device as plain values; `down` is null where it cannot be read."""
    down: list[str] | None = None
    with suppress(InputError, OSError):
        opened = open_input(device.path, frozenset(), False)
        down = [key_name(code) for code in sorted(opened.down())]
        opened.close()
    return {
        "path": device.path,
        "lasting": lasting(device.path, root),
        "name": device.name,
        "place": device.place,
        "keys": len(device.keys),
        "readable": device.readable,
        "repeats": device.repeats,
        "down": down,
    }


def lasting(path: str, root: Path = ROOT) -> list[str]:
    """Names of a device that stay the same after the next start."""
    links = sorted([*(root / "dev/input/by-id").glob("*"), *(root / "dev/input/by-path").glob("*")])
    device = (root / path.lstrip("/")).resolve()
    return [f"/{link.relative_to(root)}" for link in links if link.resolve() == device]


def as_table(devices: list[ListedDevice]) -> Table:
    """One row a device that has keys."""
    table = plain_table("device", "name", "where", "keys", "may be read")
    for device in devices:
        if device.keys:
            may = "yes" if device.readable else DENIED
            table.add_row(device.path, device.name, device.place or UNKNOWN, str(len(device.keys)), may)
    return table


async def watch(
    devices: list[ListedDevice],
    seconds: float | None,
    say: Callable[[str], None],
    opener: Opener = open_input,
    clock: Clock = monotonic_ns,
) -> None:
    """Say each key that goes down or up, until cancelled or the time is over."""
    loop, opened = asyncio.get_running_loop(), list[OpenInput]()
    for device in devices:
        if not device.keys:
            continue
        try:
            one = opener(device.path, frozenset(), False)
        except InputError as error:
            say(str(error))
            continue
        opened.append(one)
        told = _Told(device.name, say, clock)
        for code in sorted(one.down()):
            say(f"{device.name}: {key_name(code)} is down already: a deadman must be seen released first")
        loop.add_reader(one.fileno(), _read, one, told, loop)
    if not opened:
        raise TandemError(f"no input device can be read: {DENIED}")
    try:
        await asyncio.wait_for(asyncio.Event().wait(), seconds)
    except TimeoutError:
        return
    finally:
        for one in opened:
            loop.remove_reader(one.fileno())
            with suppress(OSError):
                one.close()


class _Told:
    """The events of one device in words."""

    def __init__(self, name: str, say: Callable[[str], None], clock: Clock) -> None:
        self.name, self.say, self._clock = name, say, clock
        self._states: dict[int, KeyState] = {}

    def event(self, code: int, value: int) -> None:
        """A key went down, up, or is repeated."""
        state = self._states.setdefault(code, KeyState(key_name(code)))
        state.event(value, self._clock())
        if value == DOWN:
            self.say(f'down  device = "{self.name}", key = "{state.name}"')
        elif value == UP:
            self.say(f"up    {self.name}: {state.name}")
            if state.short_presses:
                self.say(f"      {self.name}: {state.name}: {SHORT}")


def _read(opened: OpenInput, told: _Told, loop: asyncio.AbstractEventLoop) -> None:
    try:
        events, _ = opened.read()
    except OSError as error:
        loop.remove_reader(opened.fileno())
        told.say(f"{told.name}: {opened.path} has gone ({error.strerror})")
        return
    for code, value in events:
        told.event(code, value)
