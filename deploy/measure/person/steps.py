"""The led two minutes: ten poses and motions, who moves in each, and who must not. Pure."""

from __future__ import annotations

from dataclasses import dataclass

STEP_S = 12.0
SETTLE_S = 2.0
"""At each step's beginning: the person reads what to do."""


@dataclass(frozen=True, slots=True)
class PersonStep:
    """One pose or motion, by the names of a profile's segments; those that it lacks do not count."""

    name: str
    text: dict[str, str]
    moves: frozenset[str] = frozenset()
    """These turn much."""
    stands: frozenset[str] = frozenset()
    """These turn little. Of all others nothing is expected."""
    both_alike: bool = False
    """Left and right turn by as much."""

    @property
    def still(self) -> bool:
        """Whether nothing moves."""
        return not self.moves


_ARM = ("upper_arm", "forearm", "hand")


def _side(side: str, *parts: str) -> frozenset[str]:
    return frozenset(f"{side}_{part}" for part in parts)


_BOTH_UPPER = _side("left", "upper_arm") | _side("right", "upper_arm")
_BOTH_LOWER = _side("left", "forearm", "hand") | _side("right", "forearm", "hand")
STEPS = (
    PersonStep("stand", {"en": "Stand upright and still, arms hanging.", "zh": "直立不动,双臂自然下垂。"}),
    PersonStep(
        "right arm",
        {"en": "Raise the straight RIGHT arm ahead and a little sideways, rest, lower it, rest; again.",
         "zh": "右臂伸直,向前略向外抬起,停住,放下,停住;反复。"},
        _side("right", *_ARM), _side("left", *_ARM),
    ),
    PersonStep(
        "left arm",
        {"en": "Raise the straight LEFT arm ahead and a little sideways, rest, lower it, rest; again.",
         "zh": "左臂伸直,向前略向外抬起,停住,放下,停住;反复。"},
        _side("left", *_ARM), _side("right", *_ARM),
    ),
    PersonStep(
        "both arms",
        {"en": "Raise both arms ahead together, rest, lower them, rest; again.",
         "zh": "双臂一起向前抬起,停住,放下,停住;反复。"},
        _BOTH_UPPER | _BOTH_LOWER, frozenset(), both_alike=True,
    ),
    PersonStep(
        "right elbow",
        {"en": "Upper arms at the body: bend and stretch the RIGHT elbow.",
         "zh": "上臂贴身:弯曲和伸直右肘。"},
        _side("right", "forearm", "hand"), _BOTH_UPPER | _side("left", "forearm", "hand"),
    ),
    PersonStep(
        "left elbow",
        {"en": "Upper arms at the body: bend and stretch the LEFT elbow.",
         "zh": "上臂贴身:弯曲和伸直左肘。"},
        _side("left", "forearm", "hand"), _BOTH_UPPER | _side("right", "forearm", "hand"),
    ),
    PersonStep(
        "hands",
        {"en": "Forearms level, at rest: wave both hands up and down.",
         "zh": "前臂水平不动:双手上下摆动。"},
        frozenset({"left_hand", "right_hand"}), _BOTH_UPPER | frozenset({"left_forearm", "right_forearm"}),
        both_alike=True,
    ),
    PersonStep(
        "forearms",
        {"en": "Forearms level: turn both palms up and down.",
         "zh": "前臂水平:双手掌心反复向上和向下翻转。"},
        _BOTH_LOWER, _BOTH_UPPER, both_alike=True,
    ),
    PersonStep(
        "head and back",
        {"en": "Nod, then bend forward and to both sides.",
         "zh": "点头,然后向前和向两侧弯腰。"},
        frozenset({"head"}),
    ),
    PersonStep("stand again", {"en": "Stand as at the beginning.", "zh": "像开始时一样站立。"}),
)  # fmt: skip
"""In their order, `STEP_S` each."""
LOOKED_AT = frozenset().union(*(step.moves for step in STEPS))
"""The segments that the steps ask something of: fingers and others are not."""


def expected(step: PersonStep, segment: str) -> float | None:
    """1 where a segment moves in a step, 0 where it stands, None where nothing is expected."""
    if step.still:
        return 0.0
    if segment in step.moves:
        return 1.0
    return 0.0 if segment in step.stands else None


def step_windows(rate_hz: float, samples: int) -> list[tuple[PersonStep, slice]]:
    """Each step and its samples, the time for reading left out; of a recording that begins with the first."""
    found = []
    for number, step in enumerate(STEPS):
        begin, end = (round(rate_hz * s) for s in (number * STEP_S + SETTLE_S, (number + 1) * STEP_S))
        if end <= samples:
            found.append((step, slice(begin, end)))
    return found
