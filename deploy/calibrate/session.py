"""What `calibrate imu` and `calibrate mag` have in common: nodes of a recording, one by one, to files."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Generic, Protocol, TypeVar

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, track
from rich.table import Table
from rich.text import Text

from common.config.sensor_calibration import Made
from common.errors import TandemError
from common.quaternion import Array
from deploy.report.output import write_json
from master.calibrate.node_file import Part, write_calibration
from master.calibrate.recording import NodeRecording, load_recordings


class Found(Protocol):
    """What a calibration gives."""

    @property
    def name(self) -> str:
        """The node's."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person should know."""

    def parts(self, day: date, recording: str) -> dict[Part, tuple[Array, Made]]:
        """As `write_calibration` takes them."""


Result = TypeVar("Result", bound=Found)
Calibrate = Callable[[NodeRecording, Callable[[float], None]], Result]


@dataclass(frozen=True, slots=True)
class NodeResults(Generic[Result]):
    """The nodes that could be calibrated, and why others could not."""

    found: Mapping[str, Result]
    refused: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class NodeMethod(Generic[Result]):
    """One way to calibrate single nodes, and how its results are shown."""

    calibrate: Calibrate[Result]
    table: Callable[[Mapping[str, Result]], Table]
    summary: Callable[[Result], dict[str, object]]
    """Figures for the JSON report, beside the parts that the node's file holds."""
    draw: Callable[[Result, Path], None] | None = None
    picture: str = ""
    """A node's picture is `{node}_{picture}.png`."""


def calibrate_to_files(
    method: NodeMethod[Result],
    recording: Path,
    names: list[str],
    folder: Path,
    console: Console,
    *,
    pictures: bool = True,
) -> tuple[NodeResults[Result], dict[str, object]]:
    """Calibrate nodes of a recording and write their files and pictures; the results, and the report."""
    day = date.today()
    results = calibrate_nodes(recording, names, method.calibrate, console)
    write_nodes(results, recording, folder, day)
    if pictures and method.draw is not None:
        for name, found in track(results.found.items(), "pictures", console=console, transient=True):
            method.draw(found, folder / f"{name}_{method.picture}.png")
    return results, report(results, recording, day, method.summary)


def show(method: NodeMethod[Result], results: NodeResults[Result], folder: Path, console: Console) -> None:
    """Print the table, the notes and where the files are; nothing where no node could be calibrated."""
    if not results.found:
        return
    console.print(method.table(results.found))
    node_notes = by_words((name, note) for name, node in results.found.items() for note in node.notes)
    for note, names in node_notes.items():
        console.print(Text(f"{', '.join(names)}: {note}", "yellow"))
    for name in results.found:
        console.print(Text(f"written: {folder / name}.toml", "dim"), soft_wrap=True)


def run_command(
    method: NodeMethod[Result],
    recording: Path,
    names: list[str] | None,
    folder: Path,
    report_file: Path | None,
    *,
    as_json: bool,
) -> None:
    """The whole of `tandem calibrate imu` and `mag`. Raises TandemError for nodes that are refused."""
    make_folder(folder)
    console = Console(stderr=True)
    results, figures = calibrate_to_files(method, recording, names or [], folder, console)
    output_json(figures, report_file, to_stdout=as_json)
    if not as_json:
        show(method, results, folder, Console())
    refuse(results, recording)


def calibrate_nodes(
    path: Path, names: list[str], calibrate: Calibrate[Result], console: Console
) -> NodeResults[Result]:
    """Calibrate the named nodes of a recording, all without names, with a progress bar.

    Raises TandemError when the recording cannot be read or has no such node.
    """
    nodes = load_recordings(path)
    unknown = [name for name in names if name not in nodes]
    if unknown:
        raise TandemError(f"{path}: has no node {', '.join(unknown)}; it has {', '.join(nodes)}")
    found: dict[str, Result] = {}
    refused: dict[str, str] = {}
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        chosen = names or list(nodes)
        task = progress.add_task("", total=len(chosen))
        for n, name in enumerate(chosen):
            progress.update(task, description=name)

            def report_progress(share: float, before: int = n) -> None:
                progress.update(task, completed=before + share)

            try:
                found[name] = calibrate(nodes[name], report_progress)
            except TandemError as error:
                refused[name] = str(error)
            report_progress(1.0)
    return NodeResults(found, refused)


def make_folder(folder: Path) -> None:
    """Make the folder for the results, before the work. Raises TandemError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise TandemError(f"--out {folder}: cannot be made ({error.strerror})") from None


def write_nodes(results: NodeResults[Result], recording: Path, folder: Path, day: date) -> None:
    """Write each node's TOML into the folder; a file that is there keeps its other parts."""
    for name, found in results.found.items():
        write_calibration(folder / f"{name}.toml", found.parts(day, recording.name))


def report(
    results: NodeResults[Result], recording: Path, day: date, gist: Callable[[Result], Mapping[str, object]]
) -> dict[str, object]:
    """The figures for machines: a node's parts as its file has them, and the command's own figures."""
    return {
        "recording": recording.name,
        "date": day.isoformat(),
        "nodes": {
            name: {
                **gist(found),
                "notes": list(found.notes),
                **{
                    part: {"value": values.tolist(), **made.model_dump(mode="json", exclude_none=True)}
                    for part, (values, made) in found.parts(day, recording.name).items()
                },
            }
            for name, found in results.found.items()
        },
        "refused": dict(results.refused),
    }


def output_json(figures: Mapping[str, object], path: Path | None, *, to_stdout: bool) -> None:
    """As JSON to a file, to the standard output, or both."""
    if path is not None:
        write_json(path, figures)
    if to_stdout:
        text = json.dumps(figures, indent=2, ensure_ascii=False)
        Console().print(text, highlight=False, soft_wrap=True, markup=False)


def by_words(node_notes: Iterable[tuple[str, str]]) -> dict[str, list[str]]:
    """Group (node, text) pairs by text, so that a text that holds for the whole suit is printed once."""
    nodes: dict[str, list[str]] = {}
    for name, words in node_notes:
        nodes.setdefault(words, []).append(name)
    return nodes


def refuse(results: NodeResults[Result], recording: Path) -> None:
    """Raises TandemError, a line a reason with its nodes; after what was found has been written."""
    nodes = by_words(results.refused.items())
    if nodes:
        raise TandemError(
            "\n".join(f"{recording}: {', '.join(names)}: {why}" for why, names in nodes.items())
        )
