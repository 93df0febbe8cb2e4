"""What full-body recordings of others call our segments (the names of the qmt package's example data)."""

from __future__ import annotations

RECORDED_AS = {
    "chest": "upper_back",
    "head": "head",
    "left_upper_arm": "upper_arm_left",
    "left_forearm": "forearm_left",
    "left_hand": "hand_left",
    "right_upper_arm": "upper_arm_right",
    "right_forearm": "forearm_right",
    "right_hand": "hand_right",
    "pelvis": "hip",
    "left_thigh": "upper_leg_left",
    "left_shank": "lower_leg_left",
    "left_foot": "foot_left",
    "right_thigh": "upper_leg_right",
    "right_shank": "lower_leg_right",
    "right_foot": "foot_right",
}
