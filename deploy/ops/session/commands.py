"""`tandem session …`."""

from __future__ import annotations

import asyncio
import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from common.errors import TandemError
from common.process.runtime import run as run_until_stopped
from deploy.report.options import AsJson
from deploy.report.output import in_a_folder

app = typer.Typer(
    no_args_is_help=True,
    help="Record a session of a study, seal it, and show what was changed since.\n\n"
    "Example: `tandem session start --protocol cup.toml --subject k7pd --tap /run/tandem/operator.sock`",
)
Folder = Annotated[Path, typer.Argument(help="Folder of a session.", exists=True, file_okay=False)]
Root = Annotated[Path, typer.Option(help="Folder of the whole study.", file_okay=False)]
Subject = Annotated[str, typer.Option(help="The subject's code, never a name.")]
Table = Annotated[
    Path, typer.Option(help="The table of names and codes; it must lie outside of the study.", dir_okay=False)
]


@app.command()
def start(
    protocol: Annotated[Path, typer.Option(help="The protocol's TOML file.", dir_okay=False)],
    subject: Subject,
    root: Root = Path(),
    session: Annotated[
        str | None, typer.Option(help="The session's code; by default the next number.")
    ] = None,
    tap: Annotated[
        list[Path] | None, typer.Option(help="Record at this `[tap] socket`; repeat for both sides.")
    ] = None,
    consent: Annotated[str, typer.Option(help="Number of the signed consent form.")] = "",
    scope: Annotated[
        list[str] | None,
        typer.Option(
            help="What was consented to: motion, video, sharing; repeat. No pictures without video."
        ),
    ] = None,
    language: Annotated[str, typer.Option(help="Of the steps' texts: en, zh.")] = "en",
) -> None:
    """Begin a session: make its folder, record, and lead through the protocol's steps until the end.

    At a terminal: space begins the next step, m marks an event, q ends. Elsewhere: `tandem session mark`.

    Example: `tandem session start --protocol cup.toml --subject k7pd --tap /run/tandem/operator.sock`
    """
    from deploy.ops.session.run import lead
    from deploy.study.session import begin

    begun = begin(root, protocol, subject, session, consent, tuple(scope or ("motion",)))
    console = Console()
    recorded = "begun" if tap else "begun; nothing is recorded without --tap"
    console.print(f"{begun.path}: {recorded}", highlight=False, markup=False)

    async def work(stop: asyncio.Event) -> None:
        await lead(
            begun, tap or (), stop, lambda text: console.print(text, highlight=False, markup=False), language
        )

    run_until_stopped(work)


@app.command()
def mark(
    folder: Folder,
    text: Annotated[str, typer.Argument(help="One word or a few; no names.")] = "event",
    step: Annotated[bool, typer.Option("--step", help="Begin the protocol's next step.")] = False,
    end: Annotated[bool, typer.Option("--end", help="End the session.")] = False,
) -> None:
    """Mark an event, the next step or the end of a session that is under way.

    Example: `tandem session mark study/sub-k7pd/ses-01 "cup dropped"`
    """
    from deploy.study.marks import MarkKind
    from deploy.study.session import Session

    session = Session(folder)
    if step:
        begun = session.next_step()
        if begun is None:
            raise TandemError(f"{folder}: all steps have begun; --end ends the session")
        typer.echo(f"step {begun}")
        return
    session.mark(MarkKind.END if end else MarkKind.EVENT, text)


@app.command("answers")
def all_answers(
    root: Root = Path(),
    out: Annotated[
        Path | None, typer.Option(help="New CSV file; else they are printed.", callback=in_a_folder)
    ] = None,
) -> None:
    """Show every answer to a questionnaire in a study, with scores, as a table.

    Example: `tandem session answers --root study --out answers.csv`
    """
    from deploy.study.answers import answers_in, as_table

    table = as_table(answers_in(root))
    if out is None:
        typer.echo(table, nl=False)
        return
    try:
        with out.open("x", encoding="utf-8") as stream:
            stream.write(table)
    except OSError as error:
        raise TandemError(f"{out}: cannot be written ({error.strerror or error})") from None


@app.command("seal")
def seal_folder(
    folder: Folder,
    people: Annotated[
        Path | None,
        typer.Option(
            help="Table of names: refuse to seal while one of them stands in a file.", dir_okay=False
        ),
    ] = None,
    key: Annotated[
        Path | None, typer.Option(help="Sign it with this host's key of `tandem keys`.", dir_okay=False)
    ] = None,
) -> None:
    """Seal a session's files: a chain of SHA-256, of which any changed byte can be named later.

    Keep the head that is printed somewhere else too: whoever can write the folder could seal it anew.

    Example: `tandem session seal study/sub-k7pd/ses-01`
    """
    from deploy.study.pseudonyms import Pseudonyms, names_in, too_short
    from deploy.study.seal import seal
    from deploy.study.session import SESSION, Session, expects_signature

    if (folder / SESSION).exists() and not Session(folder).ended:
        raise TandemError(
            f"{folder}: the session has not ended, and what is recorded after the seal would break it: "
            f"`tandem session mark {folder} --end`"
        )
    if key is None and expects_signature(folder):
        raise TandemError(f"{folder}: its protocol says signed = true: name this host's key by --key")
    if people is not None:
        names = list(Pseudonyms(people, folder).names().values())
        found = names_in(folder, names)
        if found:
            raise TandemError("a name stands in " + "; in ".join(found) + ": use codes as operators' names")
        if short := too_short(names):
            typer.echo(f"{short} names of {people} are too short to be searched for", err=True)
    typer.echo(f"{folder}: sealed; head {seal(folder, key=key)}")


@app.command("verify")
def verify_folder(
    folder: Folder,
    head: Annotated[str | None, typer.Option(help="The head as it was noted when it was sealed.")] = None,
    signed: Annotated[
        bool,
        typer.Option("--signed", help="A seal without a signature fails; so where its protocol says so."),
    ] = False,
    signer: Annotated[
        str | None, typer.Option(help="Who must have signed, such as operator:nurse-1.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Check a sealed session; ends with status 1 and names the file and the bytes that were changed.

    Example: `tandem session verify study/sub-k7pd/ses-01`
    """
    from deploy.study.seal import signer as signer_in
    from deploy.study.seal import verify
    from deploy.study.session import expects_signature

    written, broken = verify(folder, head, signed or expects_signature(folder), signer)
    if as_json:
        typer.echo(json.dumps({"head": written, "broken": [asdict(one) for one in broken]}, indent=2))
    else:
        for one in broken:
            typer.echo(f"{one.name}: {one.words}")
    if broken:
        raise TandemError(f"{folder}: {len(broken)} things are not as they were sealed")
    if not as_json:
        by = signer_in(folder)
        words = f"signed with a certificate of the name {by}" if by else "unsigned"
        typer.echo(f"{folder}: as it was sealed, {words}; head {written}")


@app.command()
def blind(
    conditions: Annotated[Path, typer.Argument(help="TOML file with a [[condition]] per transport.")],
    key: Annotated[
        Path, typer.Option(help="New file for the key, outside of the study (mode 0600).", dir_okay=False)
    ],
) -> None:
    """Draw codes for transports, so that operator and experimenter do not know which one runs.

    For somebody who takes no part. The printed lines are for the protocol; the key is not to be looked into
    before the study is sealed. A condition is `transport = "quic"` and `connect = ["quic/ROBOT_HOST:7447"]`.

    Example: `tandem session blind conditions.toml --key ~/keys/cup.key`
    """
    from deploy.study.blinding import draw_key, write_key

    drawn = draw_key(conditions)
    write_key(drawn, key)
    typer.echo(f'blinded = true\nconditions = {json.dumps(drawn.codes)}\ncommitment = "{drawn.commitment}"')


@app.command()
def unblind(
    folder: Annotated[
        Path, typer.Argument(help="Folder of a session or of a trial.", exists=True, file_okay=False)
    ],
    key: Annotated[Path, typer.Option(help="The key of `tandem session blind`.", dir_okay=False)],
    unsealed: Annotated[
        bool, typer.Option("--unsealed", help="Also where the folder has not been sealed.")
    ] = False,
) -> None:
    """Show which code stood for which transport, once the folder is sealed.

    It is refused where a sealed file was changed, or where the key is not the one that was committed to.

    Example: `tandem session unblind study/sub-k7pd/ses-01 --key ~/keys/cup.key`
    """
    from deploy.study.blinding import check_key, read_key
    from deploy.study.commitment import committed_in
    from deploy.study.seal import SEAL, verify

    read, (codes, commitment) = read_key(key, folder), committed_in(folder)
    check_key(read, key, codes, commitment)
    if (folder / SEAL).exists():
        for broken in verify(folder)[1]:
            raise TandemError(f"{folder}: {broken.name} is not as it was sealed: {broken.words}")
    elif not unsealed:
        raise TandemError(f"{folder}: it is not sealed yet: `tandem session seal {folder}`, or --unsealed")
    for code in read.codes:
        condition = read.conditions[code]
        typer.echo("  ".join([code, condition.transport, *condition.connect]))


@app.command()
def person(
    name: Annotated[str, typer.Argument(help="The person's name, as on the consent form.")],
    table: Table,
    root: Root = Path(),
) -> None:
    """Give a person a code, in a table apart from the study that only its owner reads.

    Example: `tandem session person "Li Mei" --table ~/keys/people.csv --root study`
    """
    from deploy.study.pseudonyms import Pseudonyms

    typer.echo(Pseudonyms(table, root).add(name))


@app.command("export")
def export_all(
    subject: Subject,
    out: Annotated[Path, typer.Option(help="New zip file.", dir_okay=False, callback=in_a_folder)],
    root: Root = Path(),
) -> None:
    """Write everything of one subject into a zip file outside of the study's folder, for that person.

    Example: `tandem session export --subject k7pd --out k7pd.zip --root study`
    """
    from deploy.study.subject import export_subject

    typer.echo(f"{out}: {export_subject(root, subject, out)} files")


@app.command("delete")
def delete_all(
    subject: Subject,
    root: Root = Path(),
    yes: Annotated[bool, typer.Option("--yes", help="Do it; without it nothing is deleted.")] = False,
) -> None:
    """Delete everything of one subject in the study's folder, and keep a receipt without its content.

    Example: `tandem session delete --subject k7pd --root study --yes`
    """
    from deploy.study.subject import delete_subject

    if not yes:
        raise TandemError(f"this deletes all files of sub-{subject} in {root}: repeat with --yes")
    gone = delete_subject(root, subject)
    typer.echo(
        f"{gone.files} files of {gone.subject} deleted; not copies elsewhere, nor the row of the table"
    )
