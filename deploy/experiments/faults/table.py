"""The fault matrix: every row there is, but for those that need processes to kill (`processes.py`)."""

from __future__ import annotations

from deploy.experiments.faults import body, link, machine
from deploy.experiments.faults.fault import Fault, Reaction
from slave.guard import State

NOTICED_S = 0.21
"""`command_timeout_s` of 0.2 s, and the step in which it is seen."""
BRAKED_S = 0.3
"""From the order to brake to standstill, the servos' settling included."""
AT_ONCE_S = 0.01
"""The next step but one."""
ENGAGE = "Remove the cause, then engage; the robot goes slowly to the operator's posture."
SWITCH_ON = (
    "Remove the cause. Drives that stopped by themselves are switched on by an emergency stop and its reset "
    "with the key, or by starting the robot's program anew; then engage."
)
NOTHING = "Nothing."

LINK = (
    Fault(
        "link cut",
        "No message passes, either way, for 1 s; then the link is whole again.",
        Reaction.HOLDS,
        "Brakes and stands. When the link is back it still stands.",
        ENGAGE,
        link.cut,
        reacts_s=NOTICED_S, stands_s=NOTICED_S + BRAKED_S, lasts_s=1.0,
        held_by=frozenset({"command", "lease"}),
    ),
    Fault(
        "link delayed 1 s, then released",
        "All messages of one second arrive together at its end.",
        Reaction.HOLDS,
        "Brakes and stands. What comes late moves nothing.",
        ENGAGE,
        link.held_back,
        reacts_s=NOTICED_S, stands_s=NOTICED_S + BRAKED_S,
        held_by=frozenset({"command", "lease"}),
    ),
    Fault(
        "link slow",
        "From one moment to the next every message takes half a second.",
        Reaction.HOLDS,
        "Takes no command older than 0.3 s; brakes and stands.",
        ENGAGE,
        link.slow,
        reacts_s=NOTICED_S, stands_s=NOTICED_S + BRAKED_S,
        refused_by=frozenset({"age"}), held_by=frozenset({"age", "command"}),
    ),
    Fault(
        "packets reordered",
        "Every second command arrives after its successor.",
        Reaction.GOES_ON,
        "Follows. It never goes back to an older command; half of them missing, it follows less exactly.",
        NOTHING,
        link.reordered,
        ends=State.TRACK, strays_deg=10.0,
        refused_by=frozenset({"sequence"}), held_by=frozenset({"sequence"}),
    ),
    Fault(
        "packets duplicated",
        "Every message arrives three times: at once, 10 ms and 110 ms later.",
        Reaction.GOES_ON,
        "Follows as if each had come once.",
        NOTHING,
        link.duplicated,
        ends=State.TRACK, strays_deg=0.0,
        refused_by=frozenset({"sequence"}), held_by=frozenset({"sequence"}),
    ),
)  # fmt: skip

STRANGERS = (
    Fault(
        "yesterday's recording replayed",
        "A session of another day, its requests to claim and to engage included, beside the operator's.",
        Reaction.GOES_ON,
        "Follows its operator. Nothing of the recording is accepted.",
        "Find out who sends it.",
        link.replayed_yesterday,
        ends=State.TRACK, strays_deg=0.0,
        refused_by=frozenset({"lease"}), held_by=frozenset({"lease", "sequence", "age", "future"}),
    ),
    Fault(
        "this session's recording replayed",
        "The operator's own commands of the last seconds once more.",
        Reaction.GOES_ON,
        "Follows its operator. Nothing of the recording is accepted.",
        "Find out who sends it.",
        link.replayed_today,
        ends=State.TRACK, strays_deg=0.0,
        refused_by=frozenset({"sequence"}), held_by=frozenset({"sequence", "age"}),
    ),
    Fault(
        "second operator",
        "Another person claims, engages, disengages, releases, and sends commands 12.5 times a second.",
        Reaction.GOES_ON,
        "Follows its operator, and tells the other who that is. Only an emergency stop is open to everybody.",
        "Nothing; or the operator releases the robot, and the other claims it.",
        link.second_operator,
        ends=State.TRACK, strays_deg=0.0,
        refused_by=frozenset({"lease"}), held_by=frozenset({"lease"}),
    ),
    Fault(
        "wrong robot",
        "Commands for another robot arrive here, with this robot's own lease.",
        Reaction.GOES_ON,
        "Follows its operator. What is not for it is not accepted.",
        "Correct the robot's name in the file of the other side.",
        link.wrong_robot,
        ends=State.TRACK, strays_deg=0.0,
        refused_by=frozenset({"robot"}), held_by=frozenset({"robot"}),
    ),
    Fault(
        "another robot of the same name",
        "A second robot starts under this one's name: nobody knows which of the two an order is for.",
        Reaction.HOLDS,
        "Brakes all joints and stands; names where the other is. Nobody can engage while both are there.",
        "Give each robot a name of its own (`robot` in its file); then engage.",
        body.namesake,
        reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S, held_by=frozenset({"namesake"}),
    ),
)  # fmt: skip

VALUES = (
    Fault(
        "values that are not numbers",
        "NaN and infinities as angles and as velocities, with the operator's lease.",
        Reaction.GOES_ON,
        "Follows the sound commands; takes none of the others.",
        "Replace the program that sends them.",
        link.not_numbers,
        ends=State.TRACK, strays_deg=0.0,
        refused_by=frozenset({"codec", "valid"}), held_by=frozenset({"valid"}),
    ),
    Fault(
        "huge values",
        "Angles beyond two turns, up to 1e30 rad, with the operator's lease.",
        Reaction.GOES_ON,
        "Follows the sound commands; takes none of the others.",
        "Replace the program that sends them.",
        link.huge,
        ends=State.TRACK, strays_deg=0.0,
        refused_by=frozenset({"codec"}),
    ),
    Fault(
        "negative zeros",
        "Every zero comes with a minus.",
        Reaction.GOES_ON,
        "Follows: it is the same number.",
        NOTHING,
        link.negative_zero,
        ends=State.TRACK, strays_deg=0.0,
    ),
    Fault(
        "largest values that a message can carry",
        "The master asks for 12.5 rad at 99 rad/s of every joint, in command after command.",
        Reaction.LIMITED,
        "Cannot know that this is not meant: goes to the ends of its ranges, slowly.",
        "Let go of the deadman, or emergency stop.",
        link.largest,
        ends=State.TRACK,
        held_by=frozenset({"position", "velocity", "acceleration"}),
    ),
    Fault(
        "valid but impossible jump",
        "From one command to the next every joint is asked to be at the far end of its range.",
        Reaction.LIMITED,
        "Cannot know that this is not meant: goes there, slowly.",
        "Let go of the deadman, or emergency stop.",
        link.jump,
        ends=State.TRACK,
        held_by=frozenset({"velocity", "acceleration"}),
    ),
    Fault(
        "a jump with every command",
        "Each command asks for the other end of every joint's range than the one before.",
        Reaction.LIMITED,
        "Cannot know that this is not meant: goes to and fro, slowly.",
        "Let go of the deadman, or emergency stop.",
        link.jumps,
        ends=State.TRACK,
        held_by=frozenset({"velocity", "acceleration"}),
    ),
)  # fmt: skip

SUIT = (
    Fault(
        "sensor node lost",
        "A node of the reaching arm does not answer any more.",
        Reaction.HOLDS_JOINTS,
        "Holds the joints that need the node; the others follow.",
        "Mend the node. Its joints come back slowly by themselves.",
        body.node_lost,
        ends=State.TRACK, concerns=body.joints_of_node, strays_deg=1.0, sway_deg=1.0,
        stands_s=0.1 + 0.08 + BRAKED_S,
    ),
    # a liar is told by a command out of turn, which is fresher: the others follow a little closer
    *(
        Fault(
            name,
            done,
            Reaction.HOLDS_JOINTS,
            "Holds the joints that need the node; the others follow. The node is named with what is wrong.",
            "Mend the node. Its joints come back slowly by themselves; until then nobody can engage.",
            act,
            ends=State.TRACK, concerns=body.joints_of_node, strays_deg=2.5, sway_deg=1.0,
            stands_s=0.2 + BRAKED_S,
        )
        for name, done, act in (
            ("sensor node frozen", "A node of the reaching arm repeats one reading.", body.node_frozen),
            ("sensor node reads zero", "The node answers with zeros, as after a reset.", body.node_zero),
            ("sensor axis stuck", "One axis of the node's accelerometer stands.", body.node_stuck),
            ("sensor axis saturated", "One axis of its gyro is at its range's end.", body.node_saturated),
        )
    ),
    Fault(
        "zero pose of somebody who leans",
        "The suit is put on, and the operator stands bowed by 25° where the zero pose is to be taken.",
        Reaction.HOLDS,
        "Refuses to engage, and says which segment leaned by how much. It stands.",
        "Stand upright, arms hanging, and still for `zero_pose_s`; then engage.",
        body.leans,
        begins=State.HOLD, setting=body.LEANS, stands_s=AT_ONCE_S,
    ),
    # compared with an operator who stood for less long before, which alone makes 3° of difference
    Fault(
        "gyro with a gross bias",
        "A gyro of the reaching arm has read 12 °/s too much on each axis since it was put on; the operator "
        "stood still for 5 s before engaging.",
        Reaction.GOES_ON,
        "Follows: the bias was learnt at rest. The node is named with its rate; beyond "
        "`rest_bias_limit_deg_s` its joints would be held, or engage refused.",
        "Calibrate the node (`tandem calibrate imu`).",
        body.nothing,
        ends=State.TRACK, setting=body.GROSS_BIAS, strays_deg=5.0,
    ),
    Fault(
        "iron at a magnetometer while it is worn",
        "Iron sticks to a node of the reaching arm: 15 µT more on each axis, since 14 s before the trial.",
        Reaction.GOES_ON,
        "Follows. The node's gyro keeps its heading; `tandem status` names the node.",
        "Take the iron away, or calibrate the node (`tandem calibrate mag`).",
        body.nothing,
        ends=State.TRACK, setting=body.IRON, strays_deg=5.0,
    ),
    Fault(
        "second suit on the bus",
        "Another suit answers the same SYNCs with the same node numbers.",
        Reaction.HOLDS,
        "Believes neither: brakes and stands. The log and `tandem status` name the nodes.",
        "Take one suit off the bus, or give it other numbers. " + ENGAGE,
        body.two_suits,
        reacts_s=0.02 + NOTICED_S, stands_s=0.02 + 0.08 + BRAKED_S, held_by=frozenset({"valid"}),
    ),
    Fault(
        "CAN bus of the suit off",
        "The bus between the suit and the master fails.",
        Reaction.HOLDS,
        "Brakes and stands. When the bus is back it still stands.",
        ENGAGE,
        body.suit_bus_off,
        # the joints brake with the first command in which none is valid; the robot holds by the time-out
        reacts_s=NOTICED_S, stands_s=0.08 + BRAKED_S, held_by=frozenset({"valid"}),
    ),
)  # fmt: skip

ROBOT = (
    Fault(
        "CAN bus of the drives off",
        "No reading comes from the drives, and no setpoint gets to them.",
        Reaction.HOLDS,
        "The drives hold their last setpoint, and stop by themselves when they miss the robot's heartbeat.",
        SWITCH_ON,
        body.drive_bus_off,
        reacts_s=0.11, stands_s=0.11 + BRAKED_S, held_by=frozenset({"encoder"}),
    ),
    Fault(
        "drive fault",
        "The drive of a moving joint reports over-current and stands still.",
        Reaction.HOLDS,
        "Brakes all joints and stands; names the joint and what its drive says.",
        SWITCH_ON,
        body.drive_fault,
        reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S, held_by=frozenset({"drive"}),
    ),
    Fault(
        "encoder silent",
        "The encoder of a moving joint says that its readings are not valid: magnet lost, wrong parity.",
        Reaction.HOLDS,
        "Brakes all joints and stands; names the joint.",
        ENGAGE,
        body.encoder_silent,
        reacts_s=0.11, stands_s=0.11 + BRAKED_S, held_by=frozenset({"encoder"}),
    ),
    Fault(
        "encoder stuck",
        "The encoder of a moving joint shows one angle for ever, and says that it is well.",
        Reaction.HOLDS_JOINTS,
        "Holds that joint and names it; the others follow. More than three such joints: holds them all.",
        "Mend the encoder, then disengage and engage.",
        body.encoder_stuck,
        ends=State.TRACK, concerns=body.one_joint, strays_deg=1.0, sway_deg=1.0,
        stands_s=0.1 + 0.1 + 0.1 + BRAKED_S,
    ),
    Fault(
        "drive moves by itself",
        "While nobody is engaged a drive turns its joint by 60°/s, whatever it is told.",
        Reaction.STOPS,
        "Stops all drives by force; names the joint.",
        "Find out why before you reset with the key at the robot; then engage.",
        body.drive_runs_away,
        begins=State.HOLD, ends=State.ESTOP,
        reacts_s=0.1, stands_s=0.1 + BRAKED_S,
    ),
    Fault(
        "drive and output encoder differ",
        "A drive's own angle is 40° off its output encoder's: turns lost, or wrong zero, gear or direction.",
        Reaction.HOLDS,
        "Brakes all joints and stands; names joint and both angles. At a start: does not enable the drive.",
        "Look at the joint: correct the drive's zero, gear or direction, or mend the encoder; then engage.",
        body.drive_lost_turns,
        reacts_s=0.02, stands_s=0.02 + BRAKED_S, held_by=frozenset({"drive"}),
    ),
    Fault(
        "base tilted",
        "The base leans by 12° where 10° is the most it may.",
        Reaction.HOLDS,
        "Brakes all joints and stands.",
        ENGAGE,
        body.base_tilted,
        reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S, held_by=frozenset({"base"}),
    ),
    Fault(
        "base falls",
        "The base tips over at 100°/s, as an instrument of ten frames a second tells it.",
        Reaction.HOLDS,
        "Brakes all joints and stands, with the second frame beyond the limit.",
        ENGAGE,
        machine.base_falls,
        reacts_s=0.1 + 0.2 + AT_ONCE_S, stands_s=0.1 + 0.2 + AT_ONCE_S + BRAKED_S,
        held_by=frozenset({"base"}),
    ),
    Fault(
        "attitude frames spoiled",
        "Every fourth frame of the attitude instrument has one flipped bit; the base stands level.",
        Reaction.GOES_ON,
        "Follows. Of three frames in a row each angle's median counts.",
        NOTHING,
        machine.frames_spoiled,
        ends=State.TRACK, strays_deg=0.1,
    ),
    Fault(
        "second master at the drives",
        "Another program sends SYNC on a bus of the drives.",
        Reaction.HOLDS,
        "Stops all drives by NMT, brakes and stands; names the second master by what it sends.",
        "End the other program, then emergency stop and its reset with the key; then engage.",
        machine.second_master,
        reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S, held_by=frozenset({"drive"}),
    ),
)  # fmt: skip

CLOCKS = (
    Fault(
        "master's clock an hour ahead",
        "The clock that stamps the commands is set ahead by an hour.",
        Reaction.HOLDS,
        "Takes no command from the future; brakes and stands. It measures the clock anew within a second.",
        ENGAGE,
        body.master_clock_ahead,
        reacts_s=NOTICED_S, stands_s=NOTICED_S + BRAKED_S,
        refused_by=frozenset({"future"}), held_by=frozenset({"future", "clock"}),
    ),
    Fault(
        "master's clock an hour back",
        "The same clock is set back by an hour.",
        Reaction.HOLDS,
        "Takes no command so old; brakes and stands.",
        ENGAGE,
        body.master_clock_back,
        reacts_s=NOTICED_S, stands_s=NOTICED_S + BRAKED_S,
        refused_by=frozenset({"age"}), held_by=frozenset({"age"}),
    ),
    Fault(
        "robot's clock an hour ahead",
        "The clock by which the robot counts its own time-outs is set ahead by an hour.",
        Reaction.HOLDS,
        "Takes everything for an hour late; brakes at once and stands.",
        ENGAGE,
        body.slave_clock_ahead,
        reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S,
        held_by=frozenset({"command", "lease", "encoder", "age"}),
    ),
    Fault(
        "robot's clock an hour back",
        "The same clock is set back by an hour.",
        Reaction.HOLDS,
        "Sees that its time went back; brakes at once and stands.",
        ENGAGE,
        body.slave_clock_back,
        reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S,
        held_by=frozenset({"command", "lease", "encoder", "future"}),
    ),
)  # fmt: skip

ESTOPS = tuple(
    Fault(
        f"emergency stop in {state}",
        "A visitor asks for an emergency stop; then the operator tries to go on, without the key.",
        Reaction.STOPS,
        does,
        "Make sure that all is well, reset with the key at the robot, then engage.",
        body.estop,
        begins=state, ends=State.ESTOP,
        reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S,
    )
    for state, does in {
        State.BOOT: "Has not begun to move, and will not: nothing is written to the drives.",
        State.HOLD: "Stands already, and stays.",
        State.ALIGN: "Brakes and stands.",
        State.TRACK: "Brakes and stands.",
        State.ESTOP: "Stands already; the second stop changes nothing.",
    }.items()
)  # fmt: skip

FAULTS: tuple[Fault, ...] = (*LINK, *STRANGERS, *VALUES, *SUIT, *ROBOT, *CLOCKS, *ESTOPS)
