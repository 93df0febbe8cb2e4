"""Which experiments there are."""

from __future__ import annotations

from deploy.experiments.accuracy.papers import beyond, glove, lower_limb, telerobot
from deploy.experiments.accuracy.papers.figures import Experiment

EXPERIMENTS = (
    Experiment(
        "A",
        "the nurse's arms, take and deliver a bottle (Zuo et al. 2016, Table 1 and η)",
        telerobot.whole_way,
        (
            "Over the fast periods of both arms. Against the truth at the same instant; the paper shifts its "
            "solved angles by one step of 80 ms before it compares.",
            "Each node by itself: η is what the units' own errors leave, three to ten times those of a fresh "
            "calibration, and in one arm of ten they happen to add up. The two below take them off.",
        ),
    ),
    Experiment(
        "A-suit",
        "the same, with the joints' constraints and a zero pose of 2 s",
        telerobot.as_a_suit,
        ("How the units sit is known, as `tandem calibrate align` finds it. constraints = online.",),
    ),
    Experiment(
        "A-raw",
        "the same with units as delivered, calibrated by a session of their own",
        telerobot.own_calibration,
        (
            "The arms' and chest's units: 26 attitudes of 10 s and 3 minutes of tumbling, the magnetometer's "
            "axes turned into the accelerometer's by the dip. How they sit is taken from 2 s of standing in "
            "the zero pose.",
        ),
    ),
    Experiment(
        "B",
        "the data glove: two units, held and moved (Yuan et al. 2022, section 4.2)",
        glove.experiment,
        (
            "Units as delivered, calibrated by a session of their own. The reference is the truth. Each run "
            "begins with 3 s at the zero position, in which the units take their zero. The delay is the "
            "estimate's alone; `tandem demo` measures the whole way's.",
        ),
    ),
    Experiment(
        "C",
        "the knees, sensors 40° askew, 20 s of walking (lower-limb paper, section 4.1)",
        lower_limb.experiment,
        (
            "The page prints no figures. Axes and alignment are found from the same recording, the levers "
            "are the table's; no magnetometer is read. Sensors are fixed to the segments: skin that moves "
            "under them is not simulated.",
        ),
    ),
    Experiment(
        "beyond",
        "elbows and knees while the field at forearms and shanks is turned by 40°",
        beyond.experiment,
        (
            "From 5 s on the field is turned about the vertical at the far node of each joint, its strength "
            "and dip as they were, so that no node alone can tell. RMSE over the whole run.",
        ),
    ),
)
