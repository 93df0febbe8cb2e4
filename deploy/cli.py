"""`tandem`: composes the commands of all rooms."""

from __future__ import annotations

from collections.abc import Callable

import typer

from deploy.calibrate.commands import app as calibrate_app
from deploy.calibrate.live.command import led, live
from deploy.console.command import console
from deploy.experiments.accuracy.commands import app as accuracy_app
from deploy.experiments.bench.command import app as bench_app
from deploy.experiments.bench.fleet.command import fleet
from deploy.experiments.collisions.command import collisions
from deploy.experiments.contact.command import contact
from deploy.experiments.demo.command import demo
from deploy.experiments.faults.command import faults
from deploy.experiments.prove.command import prove_motion
from deploy.experiments.soak.command import soak
from deploy.experiments.trial.command import app as trial_app
from deploy.log_options import Debug, Quiet, add_log_options, start_chosen_log
from deploy.ops.alarms import alarms
from deploy.ops.attitude.command import attitude
from deploy.ops.audit import audit
from deploy.ops.call import call
from deploy.ops.control.commands import COMMANDS as OPERATORS_ACTS
from deploy.ops.control.printer import acted
from deploy.ops.convert.export_command import export_joints
from deploy.ops.convert.import_command import import_recording
from deploy.ops.doctor.command import doctor
from deploy.ops.inputs import inputs
from deploy.ops.inspect.command import inspect
from deploy.ops.keys.commands import app as keys_app
from deploy.ops.lsl.command import lsl
from deploy.ops.metrics.command import metrics
from deploy.ops.network.command import app as network_app
from deploy.ops.profile.command import app as profile_app
from deploy.ops.record.command import record
from deploy.ops.replay.command import replay
from deploy.ops.robots import robots
from deploy.ops.ros.command import ros
from deploy.ops.router.command import router
from deploy.ops.servos import servos
from deploy.ops.session.commands import app as session_app
from deploy.ops.sides import master, slave
from deploy.ops.stops import stops
from deploy.ops.suit.command import check
from deploy.ops.video import video
from deploy.ops.voice.command import voice
from deploy.report.panels import arrange
from deploy.run_app import run_app
from deploy.sim.drives.process import drives
from deploy.sim.suit.command import app as suit_app

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    help="Control a humanoid upper body over a network with worn motion sensors, and measure its latency."
    "\n\nThe master reads the sensors that an operator wears and sends joint angles; "
    "the slave checks them and drives the robot.\n\nStart with `tandem demo`: it needs no hardware.",
)
bench_app.command("fleet")(fleet)
calibrate_app.command("live")(live)
calibrate_app.command("led", hidden=True)(led)
suit_app.command("check")(check)
for _name, _group in {
    "calibrate": calibrate_app, "accuracy": accuracy_app, "keys": keys_app,
    "network": network_app, "profile": profile_app, "trial": trial_app, "suit": suit_app,
    "session": session_app, "bench": bench_app,
}.items():  # fmt: skip
    app.add_typer(_group, name=_name)
_COMMANDS: tuple[Callable[..., None], ...] = (
    master, slave, console, drives, router, demo, soak, faults, collisions, contact, audit,
    robots, *OPERATORS_ACTS, call, attitude, video, voice, ros, doctor, servos, stops, inputs, alarms,
    record, inspect, replay, metrics, lsl,
)  # fmt: skip
for _command in _COMMANDS:
    app.command()(_command)
app.command("prove")(prove_motion)
app.command("import")(import_recording)
app.command("export")(export_joints)


@app.callback()
def _options(
    debug: Debug = False,
    quiet: Quiet = False,
) -> None:
    start_chosen_log(debug=debug, quiet=quiet)


add_log_options(app)
arrange(app)


def main() -> None:
    """Entry point."""
    run_app(app, acted)


if __name__ == "__main__":
    main()
