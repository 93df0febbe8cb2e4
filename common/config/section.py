"""What every part of a configuration is made of: a strict model, and paths beside their file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo, create_model

from common.errors import ConfigMistake


class Section(BaseModel):
    """Base of every part of a configuration: frozen, strict, unknown keys are mistakes."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    def mistakes(self) -> list[ConfigMistake]:
        """Contradictions between keys. Called once all keys are well formed."""
        return []


def make_section(name: str, keys: Mapping[str, tuple[object, object]]) -> type[Section]:
    """A section with one key per entry of a table: the type and the default of each key."""
    create: Callable[..., type[Section]] = create_model  # its signature does not take computed key names
    return create(name, __base__=Section, **keys)


def one_of(name: str, known: Iterable[str]) -> str:
    """The name, if it is a known one. For validators of keys that name an entry of a table."""
    names = [repr(other) for other in known]
    if repr(name) not in names:
        raise ValueError(f"expected {', '.join(names[:-1])} or {names[-1]}")
    return name


def _beside_the_file(path: Path, info: ValidationInfo) -> Path:
    if "\0" in str(path):
        raise ValueError("expected a path without the character NUL: no file has such a name")
    folder: Path = (info.context or {}).get("folder", Path())
    return folder / path


RelativePath = Annotated[Path, Field(strict=False), AfterValidator(_beside_the_file)]
"""A path that is relative to the configuration file that names it."""
