"""TOML files into checked models; a mistake names file, key, value and what was expected."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from pydantic import ValidationError

from common.config.section import Section
from common.errors import NOT_SET, ConfigError, ConfigMistake

Model = TypeVar("Model", bound=Section)

RENAMED = {
    "stance_s": "zero_pose_s",
    "stance_heading_deg": "zero_pose_heading_deg",
    "stance_turn_deg_s": "zero_pose_turn_deg_s",
    "stance_lean_deg": "zero_pose_lean_deg",
    "stance_sd_deg": "zero_pose_sd_deg",
    "mounting": "alignment",
}
"""Keys that had another name, old to new: an old one is refused, and the new one named."""


FROM_FILE = "@"
"""Before the name of a file of changes."""
CHOOSE = ("source", "shape")
"""The keys by which a section is one of several kinds."""
REST = "others"
"""Where a list of tables is read as its first one, the key of those after it. No file has this key."""


def load_config(path: Path, model: type[Model], overrides: Sequence[str] = ()) -> Model:
    """Read and check a TOML file before anything is opened.

    `overrides` are `section.key=value` with the value in TOML, and win over the file; `@FILE` stands for
    the lines of a file, one change each, so that a list of processes does not show them.
    Raises ConfigError, one line a mistake.
    """
    try:
        table = tomllib.loads(path.read_text("utf-8"))
    except OSError as error:
        raise _mistake(path, "file", str(path), f"a readable file ({error.strerror})") from None
    except UnicodeDecodeError as error:
        raise _mistake(path, "file", path.name, f"UTF-8 text ({error.reason})") from None
    except tomllib.TOMLDecodeError as error:
        raise _mistake(path, "file", path.name, f"valid TOML ({error})") from None
    for change in _changes(overrides):
        override(table, change)
    return check_config(path, table, model)


def _changes(overrides: Sequence[str]) -> Iterator[str]:
    """The changes, with those of files in place of the files' names. Raises ConfigError."""
    for text in overrides:
        if not text.startswith(FROM_FILE):
            yield text
            continue
        named = Path(text.removeprefix(FROM_FILE))
        try:
            yield from (line for line in named.read_text("utf-8").splitlines() if line.strip())
        except (OSError, UnicodeDecodeError):
            expected = f"section.key=value, or {FROM_FILE}FILE: a readable text of one change a line"
            raise _mistake("--set", "--set", text, expected) from None


def check_config(path: Path, table: Mapping[str, object], model: type[Model]) -> Model:
    """The checked model of a table that was read from `path`."""
    try:
        checked = model.model_validate(table, context={"folder": path.parent})
    except ValidationError as error:
        mistakes = [
            ConfigMistake(
                ".".join(map(str, _place(table, e["loc"], e["type"], e["msg"]))) or "file",
                _value(e["type"], e["input"], e["msg"]),
                _expected(e["type"], e["msg"], e["loc"]),
            )
            for e in error.errors()
        ]
        raise ConfigError(path, mistakes) from None
    contradictions = checked.mistakes()
    if contradictions:
        raise ConfigError(path, contradictions)
    return checked


def override(table: dict[str, object], text: str) -> None:
    """Replace one key of a table by `section.key=value`. Raises ConfigError."""
    key, equals, value = text.partition("=")
    if not equals:
        raise _mistake("--set", "--set", text, "section.key=value")
    try:
        parsed = tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        raise _mistake(
            "--set", key, value, "a TOML value; texts need quotes, as in 'robot=\"robot-2\"'"
        ) from None
    *sections, last = key.strip().split(".")
    place: object = table
    for section in sections:
        if isinstance(place, list) and section.isdigit() and int(section) < len(place):
            place = place[int(section)]
        elif isinstance(place, dict):
            place = place.setdefault(section, {})
        else:
            raise _mistake("--set", key, value, f"{section} to be in the file")
    if not isinstance(place, dict):
        raise _mistake("--set", key, value, "a key of a table")
    place[last] = parsed


def _place(table: object, loc: Sequence[int | str], kind: str, message: str) -> list[int | str]:
    """The keys to a mistake as the file has them: less the names of choices by `CHOOSE`, and less `REST`."""
    place: list[int | str] = []
    first = 0
    for part in loc:
        if isinstance(table, list) and isinstance(part, str):  # read as its first table, the rest under a key
            if part == REST:
                first = 1
                continue
            place.append(0)
            table = table[0]
        elif isinstance(part, int):
            part, first = part + first, 0
        if isinstance(table, Mapping) and part not in table and part in map(table.get, CHOOSE):
            continue
        place.append(part)
        if isinstance(table, Mapping):
            table = table.get(part)
        elif isinstance(table, list) and isinstance(part, int) and part < len(table):
            table = table[part]
    return [*place, _chooser(message)] if kind.startswith("union_tag") else place


def _chooser(message: str) -> str:
    """The key that pydantic names in its message about a choice."""
    return next((key for key in CHOOSE if f"'{key}'" in message), CHOOSE[0])


def _value(kind: str, given: object, message: str) -> object:
    if kind == "union_tag_invalid" and isinstance(given, Mapping):
        return given.get(_chooser(message))
    return NOT_SET if kind in ("missing", "union_tag_not_found") else given


def _mistake(path: Path | str, key: str, value: object, expected: str) -> ConfigError:
    return ConfigError(path, [ConfigMistake(key, value, expected)])


def _expected(kind: str, message: str, place: tuple[int | str, ...]) -> str:
    if kind == "extra_forbidden":
        new = RENAMED.get(str(place[-1]))
        return f"the key {new}, its new name" if new else "no such key (is it misspelt?)"
    if kind == "path_type":
        return "a path, in quotes"
    if kind == "union_tag_invalid":
        return message.rpartition("expected tags: ")[2]
    if kind in ("missing", "union_tag_not_found"):
        return "this key to be set"
    for lead in ("Input should be ", "Value error, expected ", "Value error, "):
        message = message.removeprefix(lead)
    return message
