"""Xsens: the text tables that MT Manager exports, and MVNX of MVN Analyze.

MT Manager: lines that begin with //, then tab-separated columns: PacketCounter, SampleTimeFine, Acc_X … m/s²,
Gyr_X … rad/s, Mag_X … in arbitrary units, Quat_q0 … or the rotation matrix Mat[row][column]. Stamps are
SampleTimeFine (10 kHz, 32 bits) where there is one, else PacketCounter (16 bits) at the update rate.
MVNX: XML, a `frame` a sample with one element a quantity, all sensors one after the other.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from common.errors import RecordingError
from common.quaternion import Array, conjugate, multiply, rotate, to_rotation_vector
from common.recording.formats.csv_file import of_table
from common.recording.formats.samples import (
    ACC,
    GYR,
    MAG,
    QUAT,
    ReadFile,
    ReadOptions,
    SensorSeries,
    UnitSamples,
)
from common.recording.formats.text_table import TextTable, parse_table, read_text
from common.recording.formats.units import G_M_S2

_FINE_HZ, _FINE_WRAP, _COUNTER_WRAP = 10_000.0, 2.0**32, 2.0**16
_RATE = re.compile(r"Update Rate:\s*([\d.]+)\s*Hz", re.IGNORECASE)


def is_xsens_txt(text: str) -> bool:
    """Whether a text is an export of MT Manager."""
    return "PacketCounter" in text and any(name in text for name in ("Acc_X", "Mat[1][1]", "Quat_q0"))


def read_xsens_txt(path: Path, options: ReadOptions) -> ReadFile:
    """One unit's export. Raises RecordingError."""
    text = read_text(path)
    table = parse_table(str(path), text)
    names = list(table.names)
    rate = _RATE.search(text[:4096])
    rate_hz = options.rate_hz or (float(rate.group(1)) if rate else None)
    stamps, time_s = _stamps(table, rate_hz)
    bare = TextTable(table.prelude, table.names, table.values, table.notes)
    # whatever else looks like a time (UTC_Second, …) is not asked
    read = of_table(path, bare, ReadOptions(options.columns, options.units, rate_hz or 1.0), path.stem)
    series = dict(read.units[0].series)
    notes = [note for note in read.notes if "its name tells no unit" not in note]
    notes.append(f"{path}: units are those of MT Manager: m/s², rad/s, the field in arbitrary units")
    if QUAT not in series and all(f"Mat[{i}][{j}]" in names for i in (1, 2, 3) for j in (1, 2, 3)):
        matrix = np.stack([table.column(f"Mat[{i}][{j}]") for i in (1, 2, 3) for j in (1, 2, 3)], axis=-1)
        series[QUAT] = SensorSeries(_from_matrices(matrix.reshape(-1, 3, 3)))
    if time_s is None and rate_hz is None:
        raise RecordingError(f"{path}: tells no update rate and no SampleTimeFine; give --rate HZ")
    stamped = {q: SensorSeries(s.values, time_s, stamps) for q, s in series.items()}
    return ReadFile((UnitSamples(path.stem, stamped, rate_hz),), tuple(notes))


def _stamps(table: TextTable, rate_hz: float | None) -> tuple[str, Array | None]:
    for name, wrap, hz in (
        ("SampleTimeFine", _FINE_WRAP, _FINE_HZ),
        ("PacketCounter", _COUNTER_WRAP, rate_hz),
    ):
        if name in table.names and hz is not None:
            ticks = table.column(name)
            # SampleTimeFine is left empty by some exports
            if np.isfinite(ticks).mean() > 0.5 and np.ptp(ticks[np.isfinite(ticks)]) > 0.0:
                return name, unwrapped(ticks, wrap) / hz
    return "time", None


def unwrapped(ticks: Array, wrap: float) -> Array:
    """Counts (T,) that begin anew at `wrap`, as if they went on."""
    step = np.diff(ticks, prepend=ticks[:1])
    out: Array = ticks - ticks[0] + wrap * np.cumsum(step < -0.5 * wrap)
    return out


def _from_matrices(r: Array) -> Array:
    """Quaternions (T, 4) of rotation matrices (T, 3, 3), by the eigenvector of the largest eigenvalue."""
    k = np.empty((len(r), 4, 4))
    trace = np.trace(r, axis1=1, axis2=2)
    k[:, 0, 0] = trace
    for i in range(3):
        for j in range(3):
            k[:, i + 1, j + 1] = r[:, i, j] + r[:, j, i] - (trace if i == j else 0.0)
    for i, (a, b) in enumerate(((2, 1), (0, 2), (1, 0))):
        k[:, 0, i + 1] = k[:, i + 1, 0] = r[:, a, b] - r[:, b, a]
    there = np.isfinite(k).all(axis=(1, 2))
    out = np.full((len(r), 4), np.nan)
    out[there] = np.linalg.eigh(k[there])[1][:, :, -1]
    out *= np.where(out[:, :1] < 0.0, -1.0, 1.0)
    return out


def read_mvnx(path: Path, options: ReadOptions) -> ReadFile:
    """Every sensor of an MVNX file. Raises RecordingError."""
    labels, frames, rate_hz = _frames(path)
    if not labels or len(frames) < 2:
        raise RecordingError(
            f"{path}: has {len(frames)} frames of {len(labels)} sensors; export it with sensor data"
        )
    rate_hz = options.rate_hz or rate_hz
    times = [frame.get("time") for frame in frames]
    time_s = None if None in times else np.array([float(t[0]) for t in times if t]) / 1000.0
    if time_s is None and rate_hz is None:
        raise RecordingError(f"{path}: tells neither frameRate nor times; give --rate HZ")
    notes: list[str] = []
    units = []
    for i, label in enumerate(labels):
        quantities = _of_sensor(path, frames, (i, len(labels)), rate_hz, time_s)
        derived = quantities.pop("derived", None)
        if derived is not None and not notes:
            notes.append(
                f"{path}: has no sensorAcceleration and sensorAngularVelocity: the accelerometers' readings "
                "are computed from sensorFreeAcceleration and sensorOrientation, the gyroscopes' from the "
                "turns of sensorOrientation; they are smoother than a sensor's"
            )
        series = {q: SensorSeries(values, time_s, "time") for q, values in quantities.items()}
        units.append(UnitSamples(_snake(label), series, rate_hz))
    notes.append(f"{path}: orientations are in the file's own world frame (Xsens: z up)")
    return ReadFile(tuple(units), tuple(notes))


Frame = dict[str, list[float]]


def _frames(path: Path) -> tuple[list[str], list[Frame], float | None]:
    labels: list[str] = []
    frames: list[Frame] = []
    rate_hz = None
    try:
        for _, element in ElementTree.iterparse(path):
            tag = element.tag.rpartition("}")[2]
            if tag == "sensor" and element.get("label"):
                labels.append(str(element.get("label")))
            elif tag == "subject" and element.get("frameRate"):
                rate_hz = float(str(element.get("frameRate")))
            elif tag == "frame":
                if element.get("type", "normal") == "normal":
                    frames.append(_frame(element))
                element.clear()
    except (ElementTree.ParseError, ValueError) as error:
        if len(frames) < 2:
            raise RecordingError(f"{path}: is not a readable MVNX file ({error})") from None
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror or error})") from None
    return labels, frames, rate_hz


def _frame(element: ElementTree.Element) -> Frame:
    out = {
        child.tag.rpartition("}")[2]: [float(word) for word in child.text.split()]
        for child in element
        if child.text and child.tag.rpartition("}")[2].startswith("sensor")
    }
    if element.get("time"):
        out["time"] = [float(str(element.get("time")))]
    return out


def _of_sensor(
    path: Path,
    frames: Sequence[Frame],
    place: tuple[int, int],
    rate_hz: float | None,
    time_s: Array | None,
) -> dict[str, Array]:
    i, count = place

    def column(name: str, width: int) -> Array | None:
        if name not in frames[0]:
            return None
        rows = [frame.get(name, []) for frame in frames]
        if any(len(row) not in (0, width * count) for row in rows):
            raise RecordingError(f"{path}: {name} does not hold {width} numbers for each of {count} sensors")
        nothing = [np.nan] * width
        return np.array([row[width * i : width * (i + 1)] or nothing for row in rows])

    out: dict[str, Array] = {}
    q = column("sensorOrientation", 4)
    acc, gyr = column("sensorAcceleration", 3), column("sensorAngularVelocity", 3)
    free = column("sensorFreeAcceleration", 3)
    if (acc is None or gyr is None) and q is not None and free is not None:
        times = np.arange(len(frames)) / (rate_hz or 1.0) if time_s is None else time_s
        if acc is None:
            acc = rotate(conjugate(q), free + np.array([0.0, 0.0, G_M_S2]))
        if gyr is None:
            gyr = _rates(q, times)
        out["derived"] = np.zeros(1)
    for name, values in ((ACC, acc), (GYR, gyr), (MAG, column("sensorMagneticField", 3)), (QUAT, q)):
        if values is not None:
            out[name] = values
    return out


def _rates(q: Array, time_s: Array) -> Array:
    """Rates (T, 3), sensor frame, of orientations (T, 4): central differences, one-sided at both ends."""
    after = np.minimum(np.arange(len(q)) + 1, len(q) - 1)
    before = np.maximum(np.arange(len(q)) - 1, 0)
    turn = multiply(conjugate(q[before]), q[after])
    turn = turn * np.where(turn[:, :1] < 0.0, -1.0, 1.0)
    out: Array = to_rotation_vector(turn) / np.maximum(time_s[after] - time_s[before], 1e-9)[:, None]
    return out


_BODY = {"upperarm": "upper_arm", "lowerarm": "forearm", "upperleg": "upper_leg", "lowerleg": "lower_leg"}
_WHOLE = {
    "pelvis": "hip",
    "t8": "upper_back",
    "t12": "lower_back",
    "sternum": "upper_back",
    "l5": "lower_back",
}


def _snake(label: str) -> str:
    """Xsens's name of a place on the body as tandem's recordings call it: RightUpperArm ▸ upper_arm_right."""
    low = label.lower().replace(" ", "")
    for side in ("left", "right"):
        if low.startswith(side):
            part = low.removeprefix(side)
            return f"{_BODY.get(part, part)}_{side}"
    return _WHOLE.get(low, re.sub(r"\W+", "_", low))
