"""`tandem alarms`: which tones the operator hears, and each of them on this host's sound card."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from common.config.load import load_config
from common.errors import TandemError
from deploy.report.options import Overrides

PAUSE_S = 0.7
"""Between two tones."""


def alarms(
    config: Annotated[
        Path | None, typer.Argument(help="The master's TOML file; its section [alarms] names the card.")
    ] = None,
    set_: Overrides = None,
    play: Annotated[bool, typer.Option("--play", help="Play each tone once.")] = False,
) -> None:
    """List the tones that an operator hears and this host's sound cards; with --play, play each tone.

    A running master silences what sounds for `pause_s` on SIGUSR1:
    `systemctl kill -s USR1 tandem-master@operator`.

    Example: `tandem alarms --play`
    """
    from master.alarms.alarm import MELODIES, Alarm
    from master.alarms.config import AlarmsConfig
    from master.alarms.player import TonePlayer, load_sounddevice
    from master.alarms.tones import burst_s
    from master.config import MasterConfig

    section = AlarmsConfig() if config is None else load_config(config, MasterConfig, set_ or ()).alarms
    player = TonePlayer(section)
    there = player.look()
    if there:
        typer.echo(f"sound cards:\n{load_sounddevice().query_devices()}")
    for alarm in Alarm:
        melody = MELODIES[alarm]
        typer.echo(f"{melody.priority.name.lower():6} {alarm}: {melody.meaning}")
        if play and there:
            player.play(alarm)
            time.sleep(burst_s(alarm) + PAUSE_S)
    player.close()
    if section.off:
        typer.echo(f"{config}: alarms.off = true: the master plays none of them")
    if not there:
        raise TandemError(f"no tone can be heard here: {player.silent_because}")
