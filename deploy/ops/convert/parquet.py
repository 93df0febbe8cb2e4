"""A recording as one tidy Parquet table: a row is one joint at one instant, units are in the names."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from common.errors import RecordingError
from common.recording import RecordingStream
from common.skeleton import Skeleton
from deploy.recorded.held import HeldFrame, HeldFrames
from deploy.report.output import writing

ROWS_TOGETHER = 3000
"""Instants of a row group: a minute at 50 Hz, so that an hour needs no more memory."""


def write_parquet(path: Path, source: Path, skeleton: Skeleton, fps: float) -> str:
    """Write it; returns what is in it, in words. Raises RecordingError where there are no states.

    Raises ModuleNotFoundError without the extra `export`.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    if path.exists():
        raise RecordingError(f"{path}: is there already; name another file, or move it away")
    schema = pa.schema(
        [
            ("time_s", pa.float64()),
            ("wall_time", pa.timestamp("ns", tz="UTC")),
            ("guard", pa.dictionary(pa.int32(), pa.string())),
            ("joint", pa.dictionary(pa.int32(), pa.string())),
            *((name, pa.float64()) for name in ("encoder_rad", "setpoint_rad", "operator_rad", "effort_nm")),
        ],
        metadata={
            "tandem": f"profile {skeleton.name}; newest that had arrived, {fps:g} Hz; from {source.name}"
        },
    )
    frames, waiting, count = HeldFrames(skeleton, fps), list[HeldFrame](), 0
    with writing(path), pq.ParquetWriter(path, schema, compression="zstd") as out:
        for frame in frames.of(RecordingStream(source)):
            waiting.append(frame)
            count += 1
            if len(waiting) >= ROWS_TOGETHER:
                out.write_table(pa.table(_columns(waiting, skeleton.joint_names), schema=schema))
                waiting.clear()
        if waiting:
            out.write_table(pa.table(_columns(waiting, skeleton.joint_names), schema=schema))
    if not count:
        path.unlink()
        raise RecordingError(f"{source}: holds no states of the profile {skeleton.name}; see --profile")
    left_out = f"; {frames.unreadable} messages could not be read, left out" if frames.unreadable else ""
    return f"{count} instants of {len(skeleton.joints)} joints{left_out}"


def _columns(frames: Sequence[HeldFrame], joints: Sequence[str]) -> dict[str, object]:
    """A column's values, instant by instant, joint by joint. NaN becomes null."""
    import pyarrow as pa

    def each(values: Sequence[object]) -> list[object]:
        return [value for value in values for _ in joints]

    def angles(name: str) -> object:
        return pa.array(np.concatenate([getattr(frame, name) for frame in frames]), from_pandas=True)

    return {
        "time_s": each([frame.time_s for frame in frames]),
        "wall_time": pa.array(
            np.repeat([frame.wall_ns for frame in frames], len(joints)).astype("datetime64[ns]")
        ),
        "guard": pa.array(each([frame.guard or None for frame in frames]), pa.string()).dictionary_encode(),
        "joint": pa.array([name for _ in frames for name in joints]).dictionary_encode(),
        **{name: angles(name) for name in ("encoder_rad", "setpoint_rad", "operator_rad", "effort_nm")},
    }
