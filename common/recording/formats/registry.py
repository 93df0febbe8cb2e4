"""The table of all formats that tandem reads, and the way from files to nodes on an even grid."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from common.errors import RecordingError
from common.recording.formats.bags import is_bag, read_bag
from common.recording.formats.csv_file import read_csv
from common.recording.formats.even import even_node
from common.recording.formats.mat import read_mat
from common.recording.formats.opensim import read_sto, read_trc
from common.recording.formats.own import read_npz, read_suit_mcap
from common.recording.formats.samples import ReadFile, ReadOptions, UnitSamples
from common.recording.formats.text_table import read_text
from common.recording.formats.ximu3 import is_ximu3, read_ximu3
from common.recording.formats.xsens import is_xsens_txt, read_mvnx, read_xsens_txt
from common.recording.node import NodeRecording
from common.recording.sweeps import is_suit_recording


@dataclass(frozen=True, slots=True)
class Format:
    """One kind of file: how it is recognised and read."""

    name: str
    """For a person."""
    endings: str
    """Endings of its name, or `folder`."""
    recognises: Callable[[Path], bool]
    read: Callable[[Path, ReadOptions], ReadFile]


def _ends(*endings: str) -> Callable[[Path], bool]:
    return lambda path: path.suffix.lower() in endings


def _xsens_txt(path: Path) -> bool:
    return path.suffix.lower() in (".txt", ".csv") and is_xsens_txt(read_text(path)[:8192])


def _mcap_of_ros(path: Path) -> bool:
    return path.suffix.lower() == ".mcap" and not is_suit_recording(path)


FORMATS = (
    Format("x-IMU3", "folder", is_ximu3, read_ximu3),
    Format("ROS bag", ".bag, .db3, .mcap, folder", lambda p: is_bag(p) or _mcap_of_ros(p), read_bag),
    Format("tandem's recording of a suit", ".mcap", _ends(".mcap"), read_suit_mcap),
    Format("numpy arrays", ".npz", _ends(".npz"), read_npz),
    Format("Xsens MT Manager", ".txt", _xsens_txt, read_xsens_txt),
    Format("Xsens MVNX", ".mvnx", _ends(".mvnx"), read_mvnx),
    Format("OpenSim table", ".sto", _ends(".sto"), read_sto),
    Format("OpenSim markers", ".trc", _ends(".trc"), read_trc),
    Format("MATLAB", ".mat", _ends(".mat"), read_mat),
    Format("table of numbers", ".csv, .tsv, .txt", _ends(".csv", ".tsv", ".txt"), read_csv),
)
"""In the order in which they are asked: the first that recognises a file reads it."""


@dataclass(frozen=True, slots=True)
class ReadNodes:
    """Nodes by name, and what a person should know about the way they were read."""

    nodes: dict[str, NodeRecording]
    notes: tuple[str, ...]


def format_of(path: Path) -> Format:
    """The format that reads a file. Raises RecordingError, naming all there are."""
    if not path.exists():
        if not any(ending in one.endings for one in FORMATS if (ending := path.suffix.lower())):
            raise _unknown(path)
        raise RecordingError(f"{path}: there is no such file")
    found = next((one for one in FORMATS if one.recognises(path)), None)
    if found is None:
        raise _unknown(path)
    return found


def _unknown(path: Path) -> RecordingError:
    known = "; ".join(f"{one.endings} ({one.name})" for one in FORMATS)
    kind = f"a {path.suffix} file" if path.suffix else "a folder or file of this name"
    return RecordingError(f"{path}: cannot read {kind}; expected {known}")


def read_nodes(
    paths: Sequence[Path], options: ReadOptions | None = None, names: Mapping[str, str] | None = None
) -> ReadNodes:
    """The nodes of one or more files. Files that hold different quantities of one node are joined.

    `names` gives nodes other names. Raises RecordingError.
    """
    options, names = options or ReadOptions(), dict(names or {})
    units: dict[str, tuple[Path, UnitSamples]] = {}
    notes: list[str] = []
    unknown = set(names)
    for path in paths:
        read = format_of(path).read(path, options)
        notes.extend(read.notes)
        for unit in read.units:
            unknown.discard(unit.name)
            name = names.get(unit.name, unit.name)
            _check_name(path, name)
            units[name] = path, _joined(path, replace(unit, name=name), units.get(name))
    if unknown:
        wrong = ", ".join(sorted(unknown))
        raise RecordingError(f"--name {wrong}: there is no such node; there are {', '.join(units)}")
    nodes = {name: even_node(path, unit) for name, (path, unit) in units.items()}
    notes.extend(note for node in nodes.values() for note in node.notes)
    return ReadNodes(nodes, tuple(dict.fromkeys(notes)))


def _joined(path: Path, unit: UnitSamples, known: tuple[Path, UnitSamples] | None) -> UnitSamples:
    if known is None:
        return unit
    twice = set(unit.series) & set(known[1].series)
    if twice:
        raise RecordingError(
            f"{path}: {unit.name}: its {', '.join(sorted(twice))} is in {known[0]} too; give one of the two "
            "nodes another name (--name OLD=NEW)"
        )
    assumed = known[1].assumed | unit.assumed
    return replace(known[1], series={**known[1].series, **unit.series}, assumed=assumed)


def _check_name(path: Path, name: str) -> None:
    if not name or name != Path(name).name or name.startswith("."):
        raise RecordingError(f"{path}: {name!r:.40} cannot be a node's name: a file is to be called so")
