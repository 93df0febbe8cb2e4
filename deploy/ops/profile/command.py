"""`tandem profile import|check`: a robot of one's own, from its URDF or MJCF to a profile that runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from common.errors import ConfigError, TandemError

_WIDTH = 120
"""Of the table of joints, which a narrower terminal wraps."""

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="Bring your own robot: make a profile of its URDF or MJCF, and look at what it does.\n\n"
    "First `tandem profile import robot.urdf --out my_robot`, then `tandem profile check my_robot`, "
    "then `tandem demo --profile my_robot`.",
)


@app.command(name="import")
def import_(
    model: Annotated[Path, typer.Argument(help="The robot's URDF or MJCF file.", dir_okay=False)],
    out: Annotated[Path, typer.Option(help="Folder to write the profile and the files of a try-out to.")],
    fix_base: Annotated[
        bool, typer.Option("--fix-base", help="Hold a base that floats where it stands.")
    ] = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace a profile that is in the folder already.")
    ] = False,
) -> None:
    """Make a profile of a robot: its joints, limits and shape, and a guess at what follows which segment.

    Each guess is printed, and marked in the file for you to confirm.

    Example: `tandem profile import robot.urdf --out my_robot`
    """
    from common.skeleton.load import OWN_FILE, load_skeleton
    from deploy.ops.profile.compiled import compiled
    from deploy.ops.profile.guess import guess, shared_hinges
    from deploy.ops.profile.write import write_robot
    from deploy.ops.profile.zero_pose import zero_pose

    if (out / OWN_FILE).exists() and not overwrite:
        raise TandemError(f"{out / OWN_FILE} exists: choose another --out, or --overwrite it")
    read = compiled(model, fix_base)
    guessed = guess(read)
    if not guessed.links:
        raise TandemError(
            f"{model}: no arm found (three turning joints in a row, not named after a leg, head or finger): "
            "write the profile by hand, see docs/extending.md"
        )
    mistakes = shared_hinges(read, guessed)
    if mistakes:
        raise ConfigError(model, mistakes)
    place, off = zero_pose(read.model, guessed)
    guesses = write_robot(read, guessed, place, out)
    skeleton = load_skeleton(str(out))
    console = Console(soft_wrap=True, highlight=False)
    console.print(f"{out / OWN_FILE}: {len(skeleton.joints)} joints follow {len(skeleton.segments)} segments")
    for note in read.notes:
        console.print(f"[yellow]note[/]: {note}")
    for joint, why in guessed.left_out.items():
        console.print(f"[yellow]left out[/]: {joint}: {why}")
    for line in guesses:
        console.print(f"[yellow]guessed[/]: {line}")
    for segment, angle in off.items():
        if angle > 0.2:
            console.print(f"[red]{segment}[/] cannot hang down: {angle * 57.2958:.0f}° off in the zero pose")
    console.print(f"Look at it with `tandem profile check {out}`, then empty `unconfirmed` in {OWN_FILE}.")


@app.command()
def check(
    profile: Annotated[str, typer.Argument(help="A profile's name, its file, or its folder.")],
    picture: Annotated[
        Path | None, typer.Option(help="Draw the robot in each posture into this PNG file.", dir_okay=False)
    ] = None,
) -> None:
    """Show what a robot makes of postures, where its joints bring it, and which push it notices.

    The contact thresholds come from the model: from its masses, its motors, and the steps of its encoders.
    `[contact.joints.NAME] threshold_nm` in the slave's file replaces one.

    Ends with status 1 if a posture within reach is missed, or parts of the robot touch in the zero pose.

    Example: `tandem profile check my_robot --picture my_robot.png`
    """
    from common.skeleton import load_skeleton
    from deploy.ops.profile.check import checked, posture_lines, range_table, troubles
    from deploy.ops.profile.draw import draw

    skeleton = load_skeleton(profile)
    found = checked(skeleton)
    console = Console(soft_wrap=True, highlight=False, width=max(Console().width, _WIDTH))
    console.print(range_table(found))
    for line in posture_lines(found):
        console.print(f"[bold]operator[/], {line}")
    if found.dull:
        console.print(f"[bold]contact[/], {found.dull}")
    for what in skeleton.unconfirmed:
        console.print(f"[yellow]not confirmed[/]: {what}")
    if picture is not None:
        draw(profile, picture)
        console.print(f"picture: {picture}")
    trouble = troubles(found)
    if trouble:
        raise TandemError("; ".join(trouble))
