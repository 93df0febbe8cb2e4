"""Every verdict that tandem prints, read from the code that prints it, by command."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable
from pathlib import Path

from common.errors import TandemError
from deploy.experiments.bench.targets import BENCH
from deploy.experiments.contact.flight import Flight
from deploy.experiments.contact.flights import LOADS, Flights
from deploy.experiments.contact.hours import judge_flights
from deploy.experiments.contact.view import judge
from deploy.experiments.demo.targets import BY_PROFILE
from deploy.experiments.soak.judge.judge import verdicts_of
from deploy.experiments.trial.report.targets import LIMITS
from deploy.sim.patient.replay import Lap
from tests.deploy.experiments.soak.conftest import FAULT, PROCESSES, STORY, Make, happened

ROOT = Path(__file__).parents[2]
ENDED = (
    *STORY,
    happened(200.0, "recording", {"after": "kill", "readable": True, "lost_s": 0.1, "why_not": ""}),
    happened(210.0, "recording", {"after": "disk full", "readable": True, "lived": True, "said": 1}),
    happened(599.0, "end", {"status": {"master": 0}, "how": "it ran its time", "error": False}),
)
"""A soak in which each criterion has something to judge."""


def printed(make: Make) -> set[tuple[str, str]]:
    """Command and verdict. What stands for a value in a message is `…`; of a soak, PROCESS and FAULT."""
    return {
        *(("demo", target.name) for targets in BY_PROFILE.values() for target in targets),
        *(
            ("demo", words)
            for file, function in (("report", "_problems"), ("robots", "robot_problems"))
            for words in texts(f"deploy/experiments/demo/{file}.py", function, _is_problem)
        ),
        *(("demo", words) for words in texts("deploy/harness/operator.py", "gives_up", _is_return)),
        *(("bench", target.name) for target in BENCH),
        *(("soak", name) for name in soak_names(make)),
        *(("trial", limit.words) for limit in LIMITS),
        *(
            ("trial", words)
            for words in texts("deploy/experiments/trial/cell/judge.py", "_nothing_to_judge", _is_return)
        ),
        *(("faults", words) for words in fault_words()),
        *(("contact", name) for name in contact_names()),
        *(
            ("collisions", words)
            for words in texts("deploy/experiments/collisions/report.py", "wrong", _is_message)
        ),
        *(("accuracy", words) for words in texts("deploy/experiments/accuracy/view.py", "_notes", _is_note)),
        *(
            ("record", _first_words(text))
            for text in texts("deploy/ops/record/record.py", "_check", _is_raised)
        ),
    }


def soak_names(make: Make) -> set[str]:
    """With the process or the fault that a name holds left open."""
    found = {f"{v.group}: {v.name}" for v in verdicts_of(make(events=ENDED))}
    processes = "|".join(PROCESSES)
    return {
        re.sub(rf": ({processes})\b|\bthe (master|slave) missed", _process, name).replace(
            str(FAULT["fault"]), "FAULT"
        )
        for name in found
    }


def _process(found: re.Match[str]) -> str:
    return ": PROCESS" if found[1] else "the PROCESS missed"


def contact_names() -> set[str]:
    """Of the meetings with a patient, and of the hours through the air."""
    lap = Lap(1.0, (), 0.5, "neck_yaw")
    flights = tuple(Flight("bottle", "12 bits", load, (lap,)) for load in LOADS)
    return {verdict.name for verdict in (*judge(()), *judge_flights(Flights({}, flights)))}


def fault_words() -> set[str]:
    """Of a row of the fault matrix: what should not have been."""
    executor, judge = "deploy/harness/faults/virtual.py", "deploy/harness/faults/judge.py"
    return {
        *texts(executor, "_judge", _is_message),
        *texts(executor, "_state_amiss", _is_return),
        *texts(judge, "standing_amiss", _is_return),
        *texts(judge, "asked_beyond", _is_argument),
        *texts(judge, "moved_beyond", _is_argument),
    }


def texts(file: str, function: str, wanted: Callable[[ast.AST], bool]) -> set[str]:
    """The messages within a function that stand where `wanted` says. TandemError where there is none."""
    tree = ast.parse((ROOT / file).read_text("utf-8"))
    bodies = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) and node.name == function]
    found = {
        _template(text)
        for body in bodies
        for node in ast.walk(body)
        if wanted(node)
        for text in _messages(node)
    }
    found = {words for words in found if " " in words}
    if not found:
        raise TandemError(f"{file}: {function} holds no message any more: mend tests/verdicts/printed.py")
    return found


def _messages(node: ast.AST) -> list[ast.expr]:
    if isinstance(node, ast.JoinedStr):
        return [node]
    if isinstance(node, ast.Constant):
        return [node] if isinstance(node.value, str) and " " in node.value else []
    # a test or a loop around a message holds words that are none
    children = (
        [node.value] if isinstance(node, ast.Return) and node.value else list(ast.iter_child_nodes(node))
    )
    if isinstance(node, ast.ListComp):
        children = [node.elt]
    return [text for child in children for text in _messages(child)]


def _template(text: ast.expr) -> str:
    if isinstance(text, ast.JoinedStr):
        parts = [part.value if isinstance(part, ast.Constant) else "…" for part in text.values]
        return "".join(map(str, parts))
    return str(text.value) if isinstance(text, ast.Constant) else ""


def _first_words(text: str) -> str:
    """Of a message that begins with a file's name and goes on with what to do."""
    return text.removeprefix("…: ").partition(": ")[0]


def _is_problem(node: ast.AST) -> bool:
    if isinstance(node, ast.Assign):
        return any(isinstance(t, ast.Name) and t.id == "problems" for t in node.targets)
    if isinstance(node, ast.AugAssign):
        return isinstance(node.target, ast.Name) and node.target.id == "problems"
    return _appends(node, "problems")


def _is_note(node: ast.AST) -> bool:
    return _appends(node, "notes")


def _appends(node: ast.AST, to: str) -> bool:
    return isinstance(node, ast.Call) and ast.unparse(node.func) == f"{to}.append"


def _is_message(node: ast.AST) -> bool:
    return isinstance(node, ast.JoinedStr)


def _is_return(node: ast.AST) -> bool:
    return isinstance(node, ast.Return)


def _is_argument(node: ast.AST) -> bool:
    return isinstance(node, ast.Call) and ast.unparse(node.func) == "_beyond"


def _is_raised(node: ast.AST) -> bool:
    return isinstance(node, ast.Raise)
