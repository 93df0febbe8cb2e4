"""`tandem keys authority|make|revoke|show`: the files that [link.tls] and `[link] revoked` name."""

from __future__ import annotations

import json
import re
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from common.errors import LinkError
from common.link.config import NAME
from common.link.roles import Role, common_name, role_of
from deploy.certificates import AUTHORITY, REVOKED, KeysError
from deploy.report.options import AsJson

if TYPE_CHECKING:
    from deploy.certificates.folder import Shown

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="Make the certificates by which hosts prove who they are, and see when they expire.\n\n"
    "First `tandem keys authority keys`, then one `tandem keys make keys ROLE:NAME` a host.",
)
SOON_DAYS = 30
MOST_DAYS = 36_500.0
Folder = Annotated[Path, typer.Argument(help="Folder of the authority's files.", file_okay=False)]


@app.command()
def authority(
    folder: Folder,
    name: Annotated[str, typer.Option(help="Name of the authority, for people.")] = "tandem",
    days: Annotated[
        float, typer.Option(help="Number of days until the certificate expires.", min=1.0, max=MOST_DAYS)
    ] = 3650.0,
) -> None:
    """Make a private certificate authority, and an empty list of revoked certificates.

    Copy ca.pem and the list to every host; keep ca.key offline.

    Example: `tandem keys authority keys --name "Clinic North"`
    """
    # cryptography takes a tenth of a second to load, for which an e-stop must not wait
    from common.link.revoked import HEAD
    from deploy.certificates.folder import write_pair
    from deploy.certificates.make import new_authority

    if not 1 <= len(name) <= 64:
        raise KeysError(f"--name {name!r}: expected 1 to 64 characters")
    made = new_authority(name, datetime.now(UTC), timedelta(days=days))
    certificate, key = write_pair(folder, AUTHORITY, made)
    listed = folder / REVOKED
    if not listed.exists():
        listed.write_text(HEAD, "utf-8")
    console = Console()
    console.print(f"{certificate}, {listed}: copy them to every host", highlight=False)
    console.print(f"{key}: anyone who has it can make certificates for everybody; keep it off the network")


@app.command()
def make(
    folder: Folder,
    who: Annotated[
        str,
        typer.Argument(
            metavar="ROLE:NAME",
            help="Role and name of the certificate's owner: operator:NAME, robot:NAME, "
            "observer:NAME or router:NAME.",
        ),
    ],
    host: Annotated[
        list[str] | None,
        typer.Option(help="Address or host name under which others connect to the owner; repeat for more."),
    ] = None,
    days: Annotated[
        float, typer.Option(help="Number of days until the certificate expires.", min=0.001, max=MOST_DAYS)
    ] = 365.0,
) -> None:
    """Make a certificate and its key, signed by the folder's authority. It never overwrites a file.

    To renew a certificate, move the old files away and make it again; [link.access] stays as it is.

    Example: `tandem keys make keys robot:robot-1 --host 192.168.7.2 --host robot-1.local`
    """
    from deploy.certificates.folder import read_authority, stem, write_pair
    from deploy.certificates.make import new_identity

    role, name = _role_and_name(who)
    listed = folder / REVOKED
    if listed.exists() and common_name(role, name) in _revoked(listed):
        raise KeysError(
            f"{who} is revoked in {listed}, and hosts tell certificates only by name: they would refuse the "
            "new one too. Make it under another name, or take the name from the list on every host first"
        )
    try:
        made = new_identity(
            read_authority(folder), role, name, host or [], datetime.now(UTC), timedelta(days=days)
        )
    except ValueError as error:
        raise KeysError(str(error)) from None
    certificate, key = write_pair(folder, stem(role, name), made)
    console = Console()
    console.print("For the host's file:\n", highlight=False)
    lines = (
        "[link.tls]", f'ca = "{AUTHORITY}.pem"', f'certificate = "{certificate.name}"', f'key = "{key.name}"'
    )  # fmt: skip
    console.print(Text("\n".join(lines)))
    if not host:
        console.print(
            Text("\nWithout --host it can connect to others, but others cannot connect to it.", "yellow")
        )


@app.command()
def browser(
    folder: Folder,
    who: Annotated[str, typer.Argument(metavar="ROLE:NAME", help="Role and name in the certificate.")],
) -> None:
    """Pack a certificate and its key for a person's browser, as NAME.p12. The password is printed once.

    A console whose file names [console] authority takes the person for whom the certificate says.

    Example: `tandem keys browser keys operator:nurse-1`
    """
    import secrets

    from deploy.certificates.folder import stem, write_browser_pair

    role, name = _role_and_name(who)
    password = secrets.token_urlsafe(9)
    path = write_browser_pair(folder, stem(role, name), password)
    Console().print(f"{path}: password {password}; import it in the browser, then delete the file")


@app.command()
def revoke(
    folder: Folder,
    who: Annotated[str, typer.Argument(metavar="ROLE:NAME", help="Role and name in the certificate.")],
) -> None:
    """Add a name to the list of revoked certificates. Copy the list to every host; none need restart.

    It takes effect on the hosts whose file names their copy: [link] revoked = "revoked.txt".

    Example: `tandem keys revoke keys operator:nurse-1`
    """
    from common.link.revoked import write_revoked

    role, name = _role_and_name(who)
    listed = folder / REVOKED
    try:
        added = write_revoked(listed, common_name(role, name), f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC")
    except LinkError as error:
        raise KeysError(str(error)) from None
    except OSError as error:
        raise KeysError(f"{listed} cannot be written: {error.strerror}") from None
    console = Console()
    console.print(
        f"{listed}: {who} {'added' if added else 'is on it already'}. Copy the file to every robot, "
        f'router and master; each reads it within a second if its file has \\[link] revoked = "{REVOKED}"',
        highlight=False,
    )


def _revoked(listed: Path) -> frozenset[str]:
    from common.link.revoked import RevocationFile

    try:
        return RevocationFile(listed).names
    except LinkError as error:
        raise KeysError(str(error)) from None


@app.command()
def show(
    paths: Annotated[
        list[Path], typer.Argument(help="Certificate files, or folders of certificates.", exists=True)
    ],
    as_json: AsJson = False,
) -> None:
    """Show the owner, the addresses and the expiry date of certificates.

    It ends with status 1 if one has expired.

    Example: `tandem keys show keys`
    """
    from deploy.certificates.folder import shown

    now = datetime.now(UTC)
    found = list(shown(paths))
    if as_json:
        print(json.dumps([_tree(each, now) for each in found], indent=2))  # noqa: T201
    else:
        Console().print(_table(found, now))
    if any(each.days_left(now) <= 0 for each in found):
        raise KeysError("expired: move the old files away and make new ones with `tandem keys make`")


def _role_and_name(who: str) -> tuple[Role, str]:
    try:
        role, name = role_of(who)
    except ValueError:
        roles = ", ".join(f"{role}:NAME" for role in Role)
        raise KeysError(f"{who!r}: expected one of {roles}") from None
    if not re.fullmatch(NAME, name):  # else [link.access] could not name it
        raise KeysError(
            f"{who!r}: expected a name of at most 48 letters and digits, after the first '_', '.' and '-' too"
        )
    return role, name


def _tree(each: Shown, now: datetime) -> dict[str, object]:
    return {
        "file": str(each.file),
        "common_name": each.common_name,
        "authority": each.authority,
        "hosts": list(each.hosts),
        "ends": each.ends.isoformat(),
        "days_left": round(each.days_left(now), 3),
    }


def _table(found: list[Shown], now: datetime) -> Table:
    table = Table()
    for column in ("file", "role and name", "hosts", "expires", "days left"):
        table.add_column(column)
    for each in found:
        days = each.days_left(now)
        style = "red" if days <= 0 else "yellow" if days < SOON_DAYS else ""
        who = f"authority {each.common_name}" if each.authority else each.common_name
        cells = (each.file.name, who, ", ".join(each.hosts) or "–", f"{each.ends:%Y-%m-%d %H:%M} UTC")
        left = "expired" if days <= 0 else f"{days:.0f}"
        table.add_row(*(Text(cell) for cell in cells), Text(left, style))
    return table
