"""Writes reports to the path that a person chose; if that fails, one clear line says why."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import typer

from common.errors import TandemError
from common.metrics.tree import Metrics, WriteMetrics, to_tree


def in_a_folder(path: Path | None) -> Path | None:
    """An option's callback: before the work that is to be written there, not after."""
    if path is not None and not path.absolute().parent.is_dir():
        raise typer.BadParameter(f"there is no folder {path.parent}")
    return path


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Raise TandemError if the path cannot be written."""
    try:
        yield
    except OSError as error:
        raise TandemError(f"{path}: cannot be written ({error.strerror or error})") from None


def write_json(path: Path, tree: object) -> None:
    """A report for machines. Raises TandemError."""
    text = json.dumps(tree, indent=2, ensure_ascii=False) + "\n"
    with writing(path):
        path.write_text(text, "utf-8")


def metrics_writer(path: Path | None) -> WriteMetrics:
    """Writes what a process counted to the file, if there is one, when the process stops."""

    def write(metrics: Metrics) -> None:
        if path is not None:
            write_json(path, to_tree(metrics))

    return write
