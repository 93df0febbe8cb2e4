"""The rows whose scene is of one robot, for another one: parts, zone and motions come from its own model."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from common.quaternion import Array
from common.skeleton import Skeleton, load_skeleton
from deploy.harness.faults.contact import CONTACT, LOADED, UNDECLARED_KG, takes_up
from deploy.harness.faults.distance import AFTER_CUT_S, DISTANCE, goes_to, wrong_file
from deploy.harness.faults.fault import BRAKED_S
from deploy.harness.faults.own_moves import OWN_REACH_S, OwnMove, arms_crossed, hand_to_head, into_a_zone
from deploy.harness.faults.scene import REACHING_S, Scene, reach
from deploy.harness.faults.setting import Setting
from deploy.harness.faults.suit import SUIT, leaning_of
from deploy.harness.faults.touched import hand, undeclared_kg
from deploy.harness.faults.virtual import VirtualFault
from slave.model.ends import limb_ends

_PAST_S = 0.15
"""The link is cut so long after the robot would have come to the margin, did it follow without delay."""
_REACHES_ON_S = 0.5
"""Till the reach has ended: what a fast motion takes raises a heavy arm's thresholds, and a load that only
just reaches them is noticed as the arm slows."""
_LEANS = "zero pose of somebody who leans"


def own_rows(profile: str) -> Iterator[VirtualFault | tuple[str, str]]:
    """Rows for the robot of a profile; the name of one that does not apply, with the reason."""
    skeleton = load_skeleton(profile)
    begin = tuple(_before(profile, 1.0).tolist())
    yield from _contact(skeleton, profile, begin)
    yield from _distance(skeleton, profile, begin)
    leans = next(fault for fault in SUIT if fault.name == _LEANS)
    if {"right_upper_arm", "right_forearm"} <= set(skeleton.segment_names):
        yield replace(leans, setting=replace(leans.setting, motion=partial(leaning_of, profile)))
    else:
        yield _LEANS, "no arms"


def _before(profile: str, share: float) -> Array:
    """(J,) what the operator does until the fault, share by share."""
    position: Array = reach(profile).state(REACHING_S * share)[0]
    return position


def _contact(
    skeleton: Skeleton, profile: str, begin: tuple[float, ...]
) -> Iterator[VirtualFault | tuple[str, str]]:
    kg = undeclared_kg(skeleton, begin, UNDECLARED_KG)
    for fault in CONTACT:
        if fault.act is takes_up:
            if kg is None:
                yield fault.name, "no right forearm"
                continue
            late_s = (fault.reacts_s or 0.0) + _REACHES_ON_S
            act = partial(takes_up, kg=kg)
            yield replace(fault, done=LOADED.format(kg=kg), act=act, reacts_s=late_s)
        elif hand(skeleton) is None:
            yield fault.name, "no right hand"
        else:
            yield fault


def _distance(
    skeleton: Skeleton, profile: str, begin: tuple[float, ...]
) -> Iterator[VirtualFault | tuple[str, str]]:
    zone = into_a_zone(skeleton, begin, partial(_before, profile))
    found = {
        "arms crossed": arms_crossed(skeleton, begin),
        "hand to own head": hand_to_head(skeleton, begin),
        "hand into a zone": zone,
        "link cut while a hand comes near a zone": zone,
    }
    for fault in DISTANCE:
        if fault.name not in found:
            yield replace(fault, act=partial(wrong_file, zone=_on_the_robot(skeleton)))
            continue
        move = found[fault.name]
        if isinstance(move, str):
            yield fault.name, move
        elif fault.held_by:
            cut_s = move.meets_s + _PAST_S
            after_s = cut_s + AFTER_CUT_S
            yield replace(
                fault, act=_goes(move, cut_s), setting=_beside(move),
                reacts_s=after_s, stands_s=after_s + BRAKED_S,
            )  # fmt: skip
        else:
            yield replace(fault, act=_goes(move), setting=_beside(move))


def _goes(move: OwnMove, cut_s: float = np.inf) -> Callable[[Scene], None]:
    return goes_to(lambda _: move.position_rad, cut_s, OWN_REACH_S)


def _beside(move: OwnMove) -> Setting:
    return Setting(slave=(f"guard.zones=[{move.zone}]",)) if move.zone else Setting()


def _on_the_robot(skeleton: Skeleton) -> str:
    """A zone where a limb's end is in the zero pose."""
    zero = np.clip(skeleton.zero_rad, skeleton.lower_rad, skeleton.upper_rad)
    center = [round(float(x), 3) for x in limb_ends(skeleton).at(zero)[-1]]
    return f'{{name="bed", shape="box", center_m={center}, size_m=[0.3, 0.3, 0.3], margin_cm=4}}'
