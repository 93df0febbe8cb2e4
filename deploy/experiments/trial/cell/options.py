"""What the commands of `tandem trial` have in common on the command line."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Tasks = Annotated[
    Path | None,
    typer.Option(
        help="TOML file of what each care task needs, instead of the built-in one.",
        exists=True,
        dir_okay=False,
    ),
]
Networks = Annotated[
    str, typer.Option(help="Network profiles or TOML files of your own, separated by commas, or `all`.")
]
Strategies = Annotated[
    str,
    typer.Option(help="Tracking strategies: latest, interpolate, predict, separated by commas, or `all`."),
]
Seconds = Annotated[float, typer.Option(help="Seconds that are judged in each run.", min=3.0, max=3600.0)]
OutageSeconds = Annotated[
    float,
    typer.Option(
        help="Seconds of link outage after the judged time, at least 1; 0: no outage.", min=0.0, max=60.0
    ),
]
Motion = Annotated[
    str | None,
    typer.Option(
        help="Motion of the simulated operator, such as sweep; by default the robot profile's own (bottle). "
        "`capture`: real people, on a virtual clock and over lines of 25 to 300 ms, with no hosts.",
        show_default=False,
    ),
]
Slower = Annotated[
    float | None,
    typer.Option(
        help="With `--motion capture`: how many times slower than recorded; else 1 and 1.5.",
        show_default=False, min=0.5, max=10.0,
    ),
]  # fmt: skip
PeopleFile = Annotated[
    Path | None,
    typer.Option(
        "--people",
        help="With `--motion capture`: recording of people's joint angles (npz); else motion_cmu.npz in the "
        "folder that TANDEM_DATA names.",
        show_default=False,
    ),
]
Seed = Annotated[
    int, typer.Option(help="Random seed for sensor errors, the network and the order of the runs.")
]
Router = Annotated[bool, typer.Option("--router", help="Connect master and slave through a router.")]
MaxAge = Annotated[
    float,
    typer.Option(
        help="Age in seconds at which the guard refuses a command; 0: as much as the network needs.",
        min=0.0,
        max=2.0,
    ),
]
Blinded = Annotated[
    Path | None,
    typer.Option(
        help="Key of `tandem session blind`: its transports are run and shown by codes only, in a balanced "
        "order, until `tandem session unblind`. In place of --transports.",
        exists=True,
        dir_okay=False,
    ),
]
Record = Annotated[
    bool,
    typer.Option(
        "--record/--no-record",
        help="Keep the messages of each run in `recordings/`, from which `tandem trial verify` computes all "
        "figures again: some 30 kB a second, never more than 500 MB of messages a run.",
    ),
]
ReportFolder = Annotated[
    Path, typer.Option(help="Folder for the report and the results of every run.", file_okay=False)
]
Remote = Annotated[
    str | None,
    typer.Option(
        metavar="ENDPOINT",
        help="The robot is on another host, where `tandem trial serve` runs: its endpoint, such as "
        "tcp/ROBOT_HOST:7440. The network is the real one, and `--profiles` only its name in the report.",
    ),
]
LinkFile = Annotated[
    Path | None,
    typer.Option(
        help="With --remote over tls or quic: the master's TOML file whose `[link.tls]` names the keys.",
        exists=True,
        dir_okay=False,
    ),
]
