"""Leads one session: records, shows the step, takes marks by key or from another terminal, until its end."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from pathlib import Path

from common.errors import TandemError
from deploy.ops.session.keys import END, EVENT, NEXT, single_keys
from deploy.ops.session.recorders import SessionRecorders
from deploy.study.marks import MarkKind
from deploy.study.session import Session
from deploy.study.under_way import say_over, say_under_way

LOOK_S = 0.2


async def lead(
    session: Session, taps: Sequence[Path], stop: asyncio.Event, show: Callable[[str], None], language: str
) -> None:
    """Until the end is marked, `stop` is set, or a recorder ends. Raises TandemError for the last."""
    recorders = SessionRecorders(session.path, taps)
    await recorders.start()
    say_under_way(session)
    failed = ""
    try:
        with single_keys(lambda key: _take(session, key)) as keys:
            if keys:
                show("space: next step   m: mark an event   q: end")
            failed = await _until_over(session, recorders, stop, show, language)
    finally:
        _end(session, failed or "stopped", show)
        say_over(session)
        said = await recorders.stop()
        for name, words in said.items():
            show(f"{name}: {words}")
    if failed:
        raise TandemError(
            f"{session.path}: the recorder of {failed} ended: {said[failed]}; the session is kept"
        )


def _end(session: Session, why: str, show: Callable[[str], None]) -> None:
    """Mark the end; where the disk takes no mark, say so, as recorders are still to be ended."""
    try:
        if not session.ended:
            session.mark(MarkKind.END, why)
    except (OSError, TandemError) as error:
        show(f"{session.path}: its end is not marked: {error}")


async def _until_over(
    session: Session,
    recorders: SessionRecorders,
    stop: asyncio.Event,
    show: Callable[[str], None],
    language: str,
) -> str:
    """The name of the recorder that ended by itself; empty where the session ended in order."""
    ended = asyncio.create_task(recorders.ended())
    stopped = asyncio.create_task(stop.wait())
    shown = 0
    try:
        while not (session.ended or stopped.done() or ended.done()):
            marks = session.marks()
            for mark in marks[shown:]:
                show(_words(session, mark.kind, mark.text, language))
            shown = len(marks)
            await asyncio.wait({ended, stopped}, timeout=LOOK_S, return_when=asyncio.FIRST_COMPLETED)
        return ended.result() if ended.done() and not session.ended and not stopped.done() else ""
    finally:
        for task in (ended, stopped):
            task.cancel()


def _take(session: Session, key: str) -> None:
    if session.ended:
        return
    if key in NEXT:
        session.next_step()
    elif key in EVENT:
        session.mark(MarkKind.EVENT, "key")
    elif key in END:
        session.mark(MarkKind.END, "key")


def _words(session: Session, kind: MarkKind, text: str, language: str) -> str:
    if kind is not MarkKind.STEP:
        return f"{kind}: {text}"
    step = next((step for step in session.steps if step.name == text), None)
    if step is None:
        return f"step {text}"
    told = step.text.get(language) or next(iter(step.text.values()), "")
    seconds = "" if step.seconds is None else f" ({step.seconds:g} s)"
    return f"step {text}{seconds}: {told}"
