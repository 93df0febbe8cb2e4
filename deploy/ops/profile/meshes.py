"""The mesh files that a robot's model names: found, read, and gathered into one folder."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

from common.errors import ConfigMistake

FORMATS = (".stl", ".obj", ".msh")
"""What MuJoCo reads."""


def take_meshes(path: Path, robot: ET.Element) -> tuple[dict[str, bytes], list[ConfigMistake], list[str]]:
    """Files by the names that the URDF has for them from now on, mistakes, and what a person should know.

    A path is relative to the URDF's folder, or `package://NAME/REST`: then the folders above are searched.
    """
    assets: dict[str, bytes] = {}
    taken: dict[Path, str] = {}
    wrong: list[ConfigMistake] = []
    left_out = _without_pictures(robot)
    for mesh in robot.iter("mesh"):
        name = mesh.get("filename", "")
        found = _find(path.parent, name)
        if found is None:
            expected = f"a file beside {path.name} or in the package's folder above it: copy the meshes there"
            wrong.append(ConfigMistake("mesh.filename", name, expected))
        elif found.suffix.lower() not in FORMATS:
            wrong.append(ConfigMistake("mesh.filename", name, "a mesh as STL or OBJ: convert it"))
        else:
            own = taken.setdefault(found, _unused(found.name, assets))
            assets[own] = found.read_bytes()
            mesh.set("filename", own)
    notes = [f"{left_out} shapes to look at are in formats that MuJoCo does not read: left out"] * bool(
        left_out
    )
    return assets, wrong, notes


def _without_pictures(robot: ET.Element) -> int:
    """Take away visual shapes of other formats; how many."""
    count = 0
    for link in robot.iter("link"):
        for visual in link.findall("visual"):
            mesh = visual.find("geometry/mesh")
            if mesh is not None and not mesh.get("filename", "").lower().endswith(FORMATS):
                link.remove(visual)
                count += 1
    return count


def _find(folder: Path, name: str) -> Path | None:
    places = [folder / name.removeprefix("file://")]
    if name.startswith("package://"):
        inside = name.removeprefix("package://")
        rest = inside.partition("/")[2]
        up = [folder, *folder.resolve().parents]
        places = [place / part for place in up for part in (inside, rest)]
    return next((place.resolve() for place in places if place.is_file()), None)


def _unused(name: str, assets: dict[str, bytes]) -> str:
    stem, dot, suffix = name.rpartition(".")
    number = 1
    while name in assets:
        number += 1
        name = f"{stem}_{number}{dot}{suffix}"
    return name
