"""Recorders beside a rig: one at the master's tap and one at the first robot's, each a process of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from deploy.harness.child import Child
from deploy.harness.rig import RECORD, Rig

STARTS_S = 30.0


async def start_recorders(rig: Rig, taps: Mapping[str, Path], folder: Path) -> Sequence[Path]:
    """Record what each process hands to its tap, by the process's name; the files `folder`/NAME.mcap.

    They end before the processes that they record. Raises TandemError where one does not begin.
    """
    files = []
    for name, tap in taps.items():
        child = Child(RECORD, rig.folder, name=f"{RECORD}-{name}")
        rig.children[child.name] = child
        files.append(folder / f"{name}.mcap")
        await child.run(["--tap", str(tap), "--out", str(files[-1])])
    for name, file in zip(taps, files, strict=True):
        # a recording gets its name once its head can be read
        await rig.until(file.exists, STARTS_S, f"recording of the {name}", rig.check)
    return files
