"""One verdict: passed up to its limit, failed above it, not judged without a value; and a table of them."""

import io

from rich.console import Console

from deploy.measure.target import ReportTarget, judge_targets
from deploy.measure.verdict import Outcome, Verdict, at_most, counts, unproven, verdict_table


def text(verdicts: list[Verdict]) -> str:
    out = io.StringIO()
    Console(file=out, width=80).print(verdict_table("limits", verdicts))
    return out.getvalue()


def test_at_its_limit_it_passes_above_it_fails_and_none_is_not_judged() -> None:
    judged = [at_most("lag", value, 1.5) for value in (1.5, 1.5001, None)]
    assert [v.outcome for v in judged] == [Outcome.PASSED, Outcome.FAILED, Outcome.NOT_JUDGED]
    assert [v.passed for v in judged] == [True, False, None]
    assert counts(judged) == "1 passed, 1 failed, 1 not judged"


def test_too_little_evidence_takes_a_pass_and_never_a_failure() -> None:
    passed, failed = (unproven(at_most("lag", value, 1.0, why="x"), "few", None) for value in (1.0, 2.0))
    assert (passed.outcome, passed.measured, passed.why) == (Outcome.NOT_JUDGED, None, "few; x")
    assert (failed.outcome, failed.measured) == (Outcome.FAILED, 2.0)


def test_verdicts_are_passed_failed_and_not_judged() -> None:
    lines = text([at_most("lag", 2.0, 1.0, "ms"), at_most("η", 1.0, 1.0)]).splitlines()
    ends = {line.split()[0]: line.split()[-1] for line in lines if line.strip()}
    assert (ends["lag"], ends["η"]) == ("failed", "passed")
    unknown = [at_most("lag", None, 1.0, why="no clock"), at_most("η", None, 1.0)]
    shown = text(unknown)
    assert "not judged: lag (no clock)" in shown
    assert "not judged: η (nothing was measured)" in shown


def test_a_side_without_a_figure_is_not_judged_by_the_other() -> None:
    target = ReportTarget("elbow", ("table_1", "*_elbow", "error_deg"), 1.0)
    left, right = {"error_deg": 0.2}, {"error_deg": 0.4}

    def value(table: dict[str, object]) -> float | None:
        (verdict,) = judge_targets({"table_1": table}, [target])
        return verdict.measured

    assert value({"left_elbow": left, "right_elbow": right}) == 0.4
    assert value({"left_elbow": left, "right_elbow": None}) is None
    assert value({"left_elbow": left, "right_elbow": {}}) is None
    # a robot with one arm only
    assert value({"right_elbow": right}) == 0.4
    assert value({}) is None
