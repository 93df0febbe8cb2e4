"""The report of a soak: JSON for machines, one self-contained page for people, the picture beside it."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

from deploy.experiments.soak.files.options import in_words
from deploy.experiments.soak.judge.judge import JudgedSoak
from deploy.experiments.soak.report.plots import draw
from deploy.measure.verdict import Outcome, Verdict, counts, with_unit
from deploy.report.output import write_json, writing

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; max-width: 75rem; margin: 2rem auto; color: #222 }
table { border-collapse: collapse; margin: 1rem 0 }
td, th { padding: .25rem .7rem; text-align: left; vertical-align: top }
tr { border-bottom: 1px solid #ddd }
td.n { text-align: right; white-space: nowrap } td.pass, td.fail, td.not { white-space: nowrap }
.note { color: #666; font-size: 13px }
.pass { color: #18794e } .fail { color: #c0392b; font-weight: bold } .not { color: #9a6700 }
img { max-width: 100% }
"""
_CLASS = {Outcome.PASSED: "pass", Outcome.FAILED: "fail", Outcome.NOT_JUDGED: "not"}


def write_report(judged: JudgedSoak, folder: Path) -> None:
    """Write `report.json`, `soak.png` and `report.html`. Raises TandemError where the disk refuses."""
    write_json(folder / "report.json", judged.tree())
    picture = draw(judged.seen)
    page = _page(judged, picture)
    for path, content in ((folder / "soak.png", picture), (folder / "report.html", page.encode())):
        with writing(path):
            path.write_bytes(content)


def _page(judged: JudgedSoak, picture: bytes) -> str:
    tree = judged.tree()
    title = f"tandem soak, {in_words(tree['lasted_s'])}: {tree['verdict']}"
    image = base64.b64encode(picture).decode()
    return "\n".join([
        "<!doctype html>", '<html lang="en"><meta charset="utf-8">', f"<title>{escape(title)}</title>",
        f"<style>{STYLE}</style>", f"<h1>{escape(title)}</h1>", f"<p>{escape(_words(judged, tree))}</p>",
        _verdicts(judged.verdicts), f'<img alt="The soak over time" src="data:image/png;base64,{image}">',
        "<p class=note>Vertical lines are faults; grey is the time until the robot follows again.</p>",
        "<h2>Faults</h2>", _faults(tree["faults"]), "</html>",
    ])  # fmt: skip


def _words(judged: JudgedSoak, tree: dict[str, Any]) -> str:
    options = tree["options"]
    where = f"over {options.get('transport')}"
    if options.get("profile"):
        where += f" through the network {options['profile']}"
    left_out = "; ".join(f"{name}: {why}" for name, why in options.get("left_out", {}).items())
    words = f"{where}, seed {options.get('seed')}; {tree['ended']}. Criteria: {counts(judged.verdicts)}."
    return words + (f" Faults left out: {left_out}." if left_out else "")


def _verdicts(verdicts: Sequence[Verdict]) -> str:
    rows = ["<tr><th>criterion<th>figure<th>at most<th><th></tr>"]
    for v in verdicts:
        rows.append(
            f"<tr><td><span class=note>{escape(v.group)}</span> {escape(v.name)}"
            f"<td class=n>{escape(with_unit(v.measured, v.unit))}"
            f"<td class=n>{escape(with_unit(v.limit, v.unit))}"
            f'<td class="{_CLASS[v.outcome]}">{v.outcome}<td class=note>{escape(v.why)}</tr>'
        )
    return f"<table>{''.join(rows)}</table>"


_COLUMNS = {
    "fault": "fault",
    "held_s": "holds after, s",
    "stands_s": "stands after, s",
    "flow_s": "commands flow again, s",
    "ready_s": "ready to engage, s",
    "track_s": "engaged → follows, s",
    "engaged": "engaged",
    "done": "follows again",
}


def _faults(faults: Sequence[dict[str, Any]]) -> str:
    head = "".join(f"<th>{escape(words)}" for words in _COLUMNS.values())
    rows = [f"<tr>{head}</tr>"]
    for fault in faults:
        cells = "".join(f"<td class=n>{escape(_cell(fault.get(key)))}" for key in _COLUMNS)
        rows.append(f"<tr>{cells}</tr>")
    return f"<table>{''.join(rows)}</table>"


def _cell(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None:
        return "–"
    return f"{value:.2f}" if isinstance(value, float) else str(value) or "it left off by itself"
