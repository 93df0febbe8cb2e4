"""Which session of a study is under way on this host: a file in the study's folder names it."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from common.errors import TandemError
from deploy.study.session import Session

UNDER_WAY = "under-way"
"""The file. It holds the session's folder, relative to the study's."""


def say_under_way(session: Session) -> None:
    """From now on it is the one. Its folder lies two below the study's. Raises OSError."""
    root = session.path.parent.parent
    beside = root / f".{UNDER_WAY}.new"
    beside.write_text(session.path.relative_to(root).as_posix() + "\n", "utf-8")
    beside.replace(root / UNDER_WAY)


def say_over(session: Session) -> None:
    """It is no longer; another that began meanwhile stays."""
    root = session.path.parent.parent
    with suppress(OSError):
        if (root / UNDER_WAY).read_text("utf-8").strip() == session.path.relative_to(root).as_posix():
            (root / UNDER_WAY).unlink()


def session_under_way(root: Path) -> Session | None:
    """The session; None where there is none, or it has ended.

    Raises TandemError where one is named that cannot be read: what its subject has consented to is not known.
    """
    try:
        named = (root / UNDER_WAY).read_text("utf-8").strip()
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise TandemError(f"{root / UNDER_WAY}: cannot be read ({error})") from None
    path = (root / named).resolve()
    if not path.is_relative_to(root.resolve()) or not path.exists():
        return None
    session = Session(path)
    return None if session.ended else session
