"""The hazards that the fault table stands against, as a risk file wants them: hazard, control, test, figure.

Ids are given by hand and never again: an entry that goes leaves its number free.
"""

from __future__ import annotations

from dataclasses import dataclass

_MATRIX = "tests/fault_matrix/test_matrix.py"
VIRTUAL_TEST = _MATRIX + "::test_the_robot_does_what_the_table_says[{}]"
PROCESS_TEST = "tests/fault_matrix/test_processes.py::test_the_robot_stands_whatever_program_dies[{}]"
"""The test that tries a row and measures it, by the row's name."""
_LACKING = "tests/slave/guard/test_mutants.py::test_a_guard_that_lacks_it_is_noticed[{}]"
"""The test that takes a part of the guard away and sees the robot do wrong, by the part's name."""
_OF_THE_GUARD = {
    "deadman": "gate deadman",
    "clutch": "(track, clutch released)",
    "slow alignment": "AlignProgress.done",
    "commands on the own key only": "gate operator",
    "revoked names refused": "gate revoked",
    "resting joints held": "RestingJoints.rest",
    "commands for this robot only": "gate robot",
    "one operator at a time": "gate lease",
    "finite numbers only": "gate valid",
    "no command twice or out of order": "gate sequence",
    "trusted clocks only": "gate clock",
    "no old command": "gate age",
    "no command from the future": "gate future",
    "hold without commands": "watch command",
    "hold without a lease": "watch lease",
    "hold without a suit": "watch valid",
    "hold without encoders": "watch encoder",
    "hold at a drive's fault": "watch drive",
    "hold at a tilt": "watch base",
    "hold with a namesake": "watch namesake",
    "hold without fresh pictures": "watch video",
    "position limits": "rule position",
    "velocity limits": "rule velocity",
    "acceleration limits": "rule acceleration",
    "stop of uncommanded motion": "UncommandedMotion.judge",
    "drive and encoder compared": "EncoderAgreement.judge",
    "encoder and setpoint compared": "EncoderPlausibility.judge",
    "doubted joints held": "Guard._believed",
    "reset by key only": "hmac.compare_digest",
    "fresh requests only": "Challenges.refusal",
    "e-stop by input": "Body.estop",
    "no reset while pressed": "Guard.still_pressed",
    "e-stop in boot": "(boot, e-stop)",
    "e-stop in hold": "(hold, e-stop)",
    "e-stop in align": "(align, e-stop)",
    "e-stop in track": "(track, e-stop)",
}
"""Controls that are parts of the guard: what each does, and its name in the test."""
CONTROLS: dict[str, str] = {
    **{control: _LACKING.format(part) for control, part in _OF_THE_GUARD.items()},
    "messages checked on arrival": "tests/fuzz/test_codec_fuzz.py",
    "node plausibility": "tests/master/suit/test_plausibility.py",
    "times that follow the link": "tests/slave/guard/test_times.py",
    "missing effort told": "tests/slave/servos/canopen/test_effort.py"
    "::test_a_drive_that_stops_telling_is_known_after_three_misses",
    "distance kept": "tests/slave/limit/test_damper.py",
    "zones checked at the start": "tests/slave/guard/test_zones.py",
    "press seen anew": "tests/common/inputs/test_held.py",
    "silent button released": "tests/master/deadman/test_can_button.py",
    "contact noticed": "tests/slave/contact/test_watch.py",
    "lost node": "tests/master/suit/test_poll_presence.py",
    "two suits on one bus": "tests/master/suit/test_clash.py",
    "lean of the zero pose": _MATRIX + "::test_a_row_of_the_estimate_fails_without_its_setting",
    "bias at rest": _MATRIX + "::test_a_row_of_the_estimate_fails_without_its_setting",
    "disturbed magnetometer": _MATRIX + "::test_a_row_of_the_estimate_fails_without_its_setting",
    "median of three frames": "tests/slave/attitude/test_vote.py",
    "second master": "tests/slave/servos/canopen/test_second_master.py",
    "drives' own watch of the heartbeat": "tests/slave/servos/canopen/test_drives.py"
    "::test_a_dead_slave_leaves_drives_that_stop_by_themselves_and_hold",
    "stop input: opening at once": "tests/slave/stop_inputs/test_rule.py"
    "::test_opening_counts_in_the_very_tick_and_says_where",
    "stop input: closing must last": "tests/slave/stop_inputs/test_rule.py"
    "::test_closing_counts_after_it_has_lasted_and_not_a_tick_sooner",
    "stop input: silence": "tests/slave/stop_inputs/test_rule.py"
    "::test_a_source_that_falls_silent_stops_at_its_bound",
    "stop input: unknown is open": "tests/slave/stop_inputs/test_rule.py"
    "::test_a_source_that_cannot_be_read_stops_and_says_why",
}
"""The test of each control by itself, by the control's name: it fails once the control is taken away."""

HAZARDS: dict[str, str] = {
    "H1": "Nobody commands the robot any more, and it moves on: it strikes or squeezes whoever is beside it.",
    "H2": "An order that is not its operator's, or not of now, moves the robot.",
    "H3": "The robot moves faster, farther or more suddenly than it may.",
    "H4": "What the sensors say of the operator is wrong, and the robot moves as nobody did.",
    "H5": "A joint moves by itself, or is not where its encoder says.",
    "H6": "The robot's base tips over, onto somebody.",
    "H7": "Somebody stops the robot, and it does not stop, or moves again before a person there allows it.",
    "H8": "A harmless disturbance stops the robot or makes it jerk, in the middle of a treatment.",
    "H9": "The robot presses on somebody, and nobody notices.",
    "H10": "The robot meets itself, the bed or the patient's head.",
}
"""What may happen to a person, by id."""


@dataclass(frozen=True, slots=True)
class RiskEntry:
    """A row of the fault table in the risk file."""

    id: str
    hazard: str
    """Its id in HAZARDS."""
    controls: tuple[str, ...]
    """Names in CONTROLS."""


_DEAF = ("hold without commands", "hold without a lease")
_NODE = ("node plausibility", "doubted joints held")
_LIMITS = ("position limits", "velocity limits", "acceleration limits")
_BUTTON = ("stop input: opening at once", "e-stop by input", "no reset while pressed")

RISKS: dict[str, RiskEntry] = {
    "link cut": RiskEntry("F01", "H1", _DEAF),
    "link delayed 1 s, then released": RiskEntry("F02", "H1", _DEAF),
    "link slow": RiskEntry("F03", "H1", ("no old command", "hold without commands")),
    "packets reordered": RiskEntry("F04", "H2", ("no command twice or out of order",)),
    "packets duplicated": RiskEntry("F05", "H2", ("no command twice or out of order",)),
    "yesterday's recording replayed": RiskEntry(
        "F06", "H2", ("one operator at a time", "no old command", "fresh requests only")
    ),
    "this session's recording replayed": RiskEntry(
        "F07", "H2", ("no command twice or out of order", "no old command")
    ),
    "second operator": RiskEntry("F08", "H2", ("one operator at a time",)),
    "wrong robot": RiskEntry("F09", "H2", ("commands for this robot only",)),
    "another robot of the same name": RiskEntry("F10", "H2", ("hold with a namesake",)),
    "values that are not numbers": RiskEntry(
        "F11", "H3", ("messages checked on arrival", "finite numbers only")
    ),
    "huge values": RiskEntry("F12", "H3", ("messages checked on arrival",)),
    "negative zeros": RiskEntry("F13", "H8", ("messages checked on arrival",)),
    "largest values that a message can carry": RiskEntry("F14", "H3", _LIMITS),
    "valid but impossible jump": RiskEntry("F15", "H3", _LIMITS),
    "a jump with every command": RiskEntry("F16", "H3", _LIMITS),
    "sensor node lost": RiskEntry("F17", "H4", ("lost node", "doubted joints held")),
    "sensor node frozen": RiskEntry("F18", "H4", _NODE),
    "sensor node reads zero": RiskEntry("F19", "H4", _NODE),
    "sensor axis stuck": RiskEntry("F20", "H4", _NODE),
    "sensor axis saturated": RiskEntry("F21", "H4", _NODE),
    "zero pose of somebody who leans": RiskEntry("F22", "H4", ("lean of the zero pose",)),
    "gyro with a gross bias": RiskEntry("F23", "H4", ("bias at rest",)),
    "iron at a magnetometer while it is worn": RiskEntry("F24", "H4", ("disturbed magnetometer",)),
    "second suit on the bus": RiskEntry("F25", "H4", ("two suits on one bus", "hold without a suit")),
    "CAN bus of the suit off": RiskEntry("F26", "H1", ("hold without a suit",)),
    "CAN bus of the drives off": RiskEntry(
        "F27", "H5", ("hold without encoders", "drives' own watch of the heartbeat")
    ),
    "drive fault": RiskEntry("F28", "H5", ("hold at a drive's fault",)),
    "encoder silent": RiskEntry("F29", "H5", ("hold without encoders",)),
    "encoder stuck": RiskEntry("F30", "H5", ("encoder and setpoint compared",)),
    "drive moves by itself": RiskEntry("F31", "H5", ("stop of uncommanded motion",)),
    "drive and output encoder differ": RiskEntry(
        "F32", "H5", ("drive and encoder compared", "hold at a drive's fault")
    ),
    "base tilted": RiskEntry("F33", "H6", ("hold at a tilt",)),
    "base falls": RiskEntry("F34", "H6", ("hold at a tilt",)),
    "attitude frames spoiled": RiskEntry("F35", "H8", ("median of three frames",)),
    "second master at the drives": RiskEntry("F36", "H5", ("second master", "hold at a drive's fault")),
    "master's clock an hour ahead": RiskEntry(
        "F37", "H2", ("no command from the future", "trusted clocks only")
    ),
    "master's clock an hour back": RiskEntry("F38", "H2", ("no old command",)),
    "robot's clock an hour ahead": RiskEntry(
        "F39", "H1", ("hold without commands", "hold without encoders", "no old command")
    ),
    "robot's clock an hour back": RiskEntry(
        "F40", "H1", ("hold without commands", "hold without encoders", "no command from the future")
    ),
    "emergency stop in boot": RiskEntry("F41", "H7", ("e-stop in boot", "reset by key only")),
    "emergency stop in hold": RiskEntry("F42", "H7", ("e-stop in hold", "reset by key only")),
    "emergency stop in align": RiskEntry("F43", "H7", ("e-stop in align", "reset by key only")),
    "emergency stop in track": RiskEntry("F44", "H7", ("e-stop in track", "reset by key only")),
    "emergency stop in estop": RiskEntry("F45", "H7", ("reset by key only",)),
    "master killed": RiskEntry("F46", "H1", _DEAF),
    "master stopped": RiskEntry("F47", "H1", _DEAF),
    "robot's program told to stop": RiskEntry("F48", "H1", ("drives' own watch of the heartbeat",)),
    "robot's program killed": RiskEntry("F49", "H1", ("drives' own watch of the heartbeat",)),
    "stop button": RiskEntry("F50", "H7", _BUTTON),
    "stop button tapped": RiskEntry("F51", "H7", _BUTTON),
    "stop button while the link is down": RiskEntry("F52", "H7", _BUTTON),
    "stop button before an engage": RiskEntry("F53", "H7", _BUTTON),
    "stop wire broken": RiskEntry("F54", "H7", (*_BUTTON, "stop input: closing must last")),
    "stop input unplugged": RiskEntry("F55", "H7", ("stop input: unknown is open", "e-stop by input")),
    "stop input silent": RiskEntry("F56", "H7", ("stop input: silence", "e-stop by input")),
    "link slows from 20 to 200 ms at once": RiskEntry("F57", "H1", ("hold without commands",)),
    "link slows from 20 to 200 ms bit by bit": RiskEntry("F58", "H8", ("times that follow the link",)),
    "arm rested": RiskEntry("F59", "H2", ("resting joints held",)),
    "zero pose taken again while the robot follows": RiskEntry("F60", "H4", ("hold without a suit",)),
    "effort sensor lost": RiskEntry("F61", "H9", ("missing effort told",)),
    "operator of the same robot without the lease": RiskEntry("F62", "H2", ("commands on the own key only",)),
    "certificate revoked while tracking": RiskEntry("F63", "H2", ("revoked names refused",)),
    "arms crossed": RiskEntry("F64", "H10", ("distance kept",)),
    "hand to own head": RiskEntry("F65", "H10", ("distance kept",)),
    "hand into a zone": RiskEntry("F66", "H10", ("distance kept",)),
    "link cut while a hand comes near a zone": RiskEntry(
        "F67", "H10", ("distance kept", "hold without commands")
    ),
    "zone file wrong": RiskEntry("F68", "H10", ("zones checked at the start",)),
    "pedal released": RiskEntry("F69", "H1", ("deadman",)),
    "pedal released for a moment": RiskEntry("F70", "H1", ("deadman",)),
    "pedal unplugged": RiskEntry("F71", "H1", ("deadman", "press seen anew")),
    "pedal stuck from the start": RiskEntry("F72", "H1", ("press seen anew",)),
    "clutch released": RiskEntry("F73", "H1", ("clutch",)),
    "clutch released and pressed": RiskEntry("F74", "H3", ("clutch", "slow alignment")),
    "link lost while the clutch is released": RiskEntry("F75", "H1", ("hold without commands",)),
    "pedal released while the clutch is": RiskEntry("F76", "H1", ("deadman",)),
    "bus of the deadman's button off": RiskEntry("F77", "H1", ("deadman", "silent button released")),
    "node of the deadman's button frozen": RiskEntry("F78", "H1", ("deadman", "silent button released")),
    "contact, slow": RiskEntry("F79", "H9", ("contact noticed",)),
    "contact, fast": RiskEntry("F80", "H9", ("contact noticed",)),
    "contact, clamped": RiskEntry("F81", "H9", ("contact noticed",)),
    "payload wrong": RiskEntry("F82", "H9", ("contact noticed",)),
    "camera gives no picture any more": RiskEntry("F85", "H2", ("hold without fresh pictures",)),
}
"""The entry of each row of the table, by the row's name."""
