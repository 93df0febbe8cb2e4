"""Which experiments there are."""

from __future__ import annotations

from deploy.accuracy.papers import telerobot
from deploy.accuracy.papers.figures import Experiment

EXPERIMENTS = (
    Experiment(
        "A",
        "the nurse's arms, take and deliver a bottle (Zuo et al. 2016, Table 1 and η)",
        telerobot.whole_way,
        (
            "Over the fast periods of both arms. Against the truth at the same instant; the paper shifts its "
            "solved angles by one step of 80 ms before it compares.",
        ),
    ),
)
