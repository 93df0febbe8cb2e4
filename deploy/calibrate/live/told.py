"""What a page is told of a guided calibration: the step, each node, and what became of it. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict

from deploy.calibrate.live.guide import View

PARTS = ("imu", "mag", "align")


def view_told(view: View, nodes: Sequence[str], places: Mapping[str, str]) -> dict[str, object]:
    """`nodes`: their names, in the order of the view. `places`: figures that the page's words name."""
    return {
        "step": view.step,
        "number": view.number,
        "steps": view.steps,
        "places": dict(places),
        "share": round(view.share, 3),
        "zero_pose": None if view.zero_pose is None else asdict(view.zero_pose),
        "nodes": [
            {"name": name, "share": round(node.share, 3), "hint": node.hint, "places": dict(node.places)}
            for name, node in zip(nodes, view.nodes, strict=False)
        ],
    }


def outcome_told(figures: Mapping[str, object]) -> dict[str, object]:
    """Of each node, by part: empty where it was written, else why not; and what was refused as a whole."""
    nodes: dict[str, dict[str, str]] = {}
    whole: list[str] = []
    for part in PARTS:
        found = figures.get(part)
        if not isinstance(found, Mapping):
            continue
        for name in found.get("nodes", {}):
            nodes.setdefault(name, {})[part] = ""
        for name, why in found.get("refused", {}).items():
            if name:
                nodes.setdefault(name, {})[part] = why
            else:
                whole.append(f"{part}: {why}")
    return {"nodes": nodes, "whole": whole}


def to_name(
    nodes: Mapping[str, Mapping[str, str]], named: Mapping[str, object], files: Mapping[str, object]
) -> list[str]:
    """Nodes that were written but whose file the master's configuration does not name (`named`, by node)."""
    written = [name for name, parts in nodes.items() if "" in parts.values()]
    return sorted(name for name in written if named.get(name) != files[name])
