"""The guard: admits commands, watches what must not be lost, and says whether and which joints may move.

It is the first stage of the slave's pipeline and knows nothing of the stages behind it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType

from common.clock import to_ns
from common.clock_sync import Offset
from common.errors import ConfigError
from common.quaternion import Array
from common.skeleton import Skeleton
from common.wire.messages import Command, Mask
from slave.guard.admit import DEADMAN, GATES, Admission, CommandGate, Gate, revocation
from slave.guard.align import AlignProgress
from slave.guard.body import WELL, Body
from slave.guard.config import GuardConfig
from slave.guard.elapsed import StepTime
from slave.guard.engage import Readiness, refusal
from slave.guard.events import Change, Clamp, Doubt, GuardCounters, Journal
from slave.guard.joints import JointReadings
from slave.guard.lease import DrawToken, Lease, random_token
from slave.guard.permission import Permission
from slave.guard.resting import RestingJoints
from slave.guard.states import ENGAGED, MOVING, GuardEvent, State, next_state
from slave.guard.times import LinkTimes
from slave.guard.watchdog import ARRIVAL_WATCHES, BODY_WATCHES, LossWatch, Signs, first_loss


class Guard:
    """One robot's guard. Pure: every time is the slave's own clock, and is given.

    Raises ConfigError where the configuration contradicts itself or the skeleton.
    """

    def __init__(
        self,
        robot: str,
        skeleton: Skeleton,
        config: GuardConfig,
        *,
        last_known_rad: Mapping[str, float] = MappingProxyType({}),
        draw_token: DrawToken = random_token,
        gates: Sequence[Gate] = GATES,
        arrival_watches: Sequence[LossWatch] = ARRIVAL_WATCHES,
        body_watches: Sequence[LossWatch] = BODY_WATCHES,
    ) -> None:
        mistakes = config.mistakes_for(skeleton)
        if mistakes:
            raise ConfigError(robot, mistakes)
        self.robot = robot
        self.state = State.BOOT
        self.reason = "waits for a valid reading of every encoder"
        self.episode = 0
        """Goes up whenever what the operator did before must not move the robot after."""
        self.counters = GuardCounters()
        self.events = Journal(config.events_kept)
        self.resting = RestingJoints(skeleton)
        self._config = config
        self._commands = CommandGate(robot, len(skeleton.joints), config, self.counters, draw_token, gates)
        self._joints = JointReadings(skeleton, config, last_known_rad)
        self._progress = AlignProgress(skeleton.joint_names, config)
        self._arrival_watches = tuple(arrival_watches)
        self._watches = (*arrival_watches, *body_watches)
        self._clutch_max_ns = to_ns(config.clutch_max_s)
        self._clutch_ns = 0
        self._body = WELL
        self._step_time = StepTime(config.max_step_s, self.counters)
        self._seat_rad: Array | None = None

    @property
    def lease(self) -> Lease:
        """The operator that may move the robot."""
        return self._commands.lease

    @property
    def times(self) -> LinkTimes:
        """How old a command may be, and how long none may come."""
        return self._commands.times

    @property
    def operator(self) -> str:
        """The operator that holds the lease; empty: none."""
        return self.lease.operator

    @property
    def doubts(self) -> Mapping[str, str]:
        """Joints that are held because their encoder is not believed, and why."""
        return self._joints.plausible.words

    @property
    def doubted(self) -> Mask:
        """(J,) those joints."""
        return self._joints.plausible.doubted

    def may_yield(self, now_ns: int) -> bool:
        """Whether nothing but contact is wrong: who yields goes by the drives' and encoders' angles."""
        return self._body.first_besides_contact is None and self._joints.life.silence(now_ns) is None

    @property
    def stand_rad(self) -> Array:
        """(J,) where the joints are, by the angles that their drives take setpoints by."""
        return self._joints.stand_rad

    @property
    def placed(self) -> bool:
        """Whether it is known where every joint stands."""
        return self._joints.seated and not self._joints.placement.differ

    # commands

    def admit(self, command: Command, received_ns: int, now_ns: int, master_offset: Offset) -> Admission:
        """Judge a command that arrived at `received_ns`.

        One that is refused changes nothing but counters, except that a released deadman makes the
        robot hold, and refuse to engage until it is held again.
        """
        received_ns = min(received_ns, now_ns)
        self.counters.received += 1
        # the gap before this command counts, even if the step that should have seen it came late
        self.watch_arrivals(received_ns)
        admission = self._commands.judge(
            command, received_ns, now_ns, master_offset, moving=self.state in ENGAGED
        )
        if admission.gate == DEADMAN:
            self.lose(now_ns, DEADMAN, admission.reason)
        elif admission.accepted:
            self._clutch(now_ns)
        return admission

    # the servo loop

    def step(
        self,
        now_ns: int,
        position_rad: Array,
        encoder_valid: Mask,
        encoder_ns: int,
        body: Body = WELL,
        *,
        drive_rad: Array | None = None,
    ) -> Permission:
        """One turn of the servo loop: the encoders (J,) as read at `encoder_ns` in, what is allowed out.

        `drive_rad` (J,): the same angles by the drives' own encoders, where they have any.
        """
        dt_s = self._step_time.elapsed_s(now_ns)
        joints = self._joints
        doubted, uncommanded = joints.read(
            position_rad, encoder_valid, encoder_ns, drive_rad, moving=self.state in MOVING
        )
        for joint in doubted:
            self.counters.doubts[joint] += 1
            self.events.add(Doubt(now_ns, joint, self.doubts[joint]))
        for what, reason in (("stop input", body.estop), ("uncommanded", uncommanded)):
            if reason is not None and self.state is not State.ESTOP:
                self.counters.losses[what] += 1
                self.estop(now_ns, reason)
        self._body = body.also(joints.placement.differ)
        self._watch(now_ns, self._watches)
        if not joints.seated:
            self._try_to_seat(now_ns)
        seat_rad, self._seat_rad = self._seat_rad, None
        return Permission(self.state, dt_s, self._believed(), joints.seated, seat_rad)

    def written(self, now_ns: int, position_rad: Array, velocity_rad_s: Array) -> None:
        """Take the setpoint (J,) of this turn, as the encoders are judged by it."""
        self._joints.written(now_ns, position_rad, velocity_rad_s)

    def clamped(self, clamps: Iterable[Clamp]) -> None:
        """Take the clamps that began at the limits."""
        for clamp in clamps:
            self.counters.clamps[clamp.rule] += 1
            self.events.add(clamp)

    def approached(self, now_ns: int, error_rad: Array) -> None:
        """In `align`: take how far the joints (J,) are from the operator, and track once they are near."""
        if self.state is not State.ALIGN:
            return
        if self._progress.done(now_ns, error_rad, self._believed()):
            self._change(now_ns, GuardEvent.ALIGNED, f"follows {self.operator}")
            return
        overdue = self._progress.overdue(now_ns)
        if overdue is not None:
            self.lose(now_ns, "align", overdue)

    def lose(self, now_ns: int, what: str, reason: str) -> None:
        """Hold, where somebody has engaged the robot: something was lost."""
        if self.state in ENGAGED:
            self.counters.losses[what] += 1
            self._change(now_ns, GuardEvent.LOSS, reason)

    # requests of people and masters

    def watch_arrivals(self, now_ns: int) -> None:
        """Look for what should have come by now, before anything that comes later is judged."""
        self._watch(now_ns, self._arrival_watches)

    def estop(self, now_ns: int, reason: str = "e-stop at the robot") -> None:
        """Brake and stay. From every state, by anybody; only a reset leaves it."""
        self._change(now_ns, GuardEvent.ESTOP, reason)

    def claim(self, operator: str, now_ns: int) -> int:
        """The token of a new lease, or 0 if an operator holds one and does not offer it to this one."""
        before = self.operator
        token = self._commands.claim(operator, now_ns)
        if token and before:
            self._hold(now_ns, f"{operator} took over from {before}; waits for {operator} to engage")
        return token

    def offer(self, operator: str, now_ns: int) -> None:
        """Offer the lease to another operator. The robot holds until the one or the other engages."""
        self.lease.offer(operator, now_ns)
        self._hold(now_ns, f"{self.operator} hands over to {operator}")

    @property
    def revoked(self) -> frozenset[str]:
        """Operators whose certificates are revoked: they may do nothing but stop."""
        return self._commands.revoked

    def revoke(self, operators: frozenset[str], now_ns: int) -> None:
        """Take the list of revoked operators. A holder on it loses the lease at once, and the robot holds."""
        self._commands.revoked = operators
        why = revocation(self.operator, operators)
        if why is not None:
            self.counters.losses["revoked"] += 1
            self.release(now_ns, why)

    def release(self, now_ns: int, reason: str) -> None:
        """End the lease; the robot holds."""
        self.lease.drop()
        self._change(now_ns, GuardEvent.LOSS, reason)

    def engage(self, operator: str, now_ns: int, together: bool = False) -> str | None:
        """Begin to move to the operator's posture; or why not. `together`: on purpose beside others."""
        why = self._refusal(operator, self.state, now_ns, together)
        if why is None:
            self._joints.plausible.trust()
            self._progress.begin(now_ns)
            self.lease.withdraw()
            self._change(now_ns, GuardEvent.ENGAGE, f"engaged by {operator}")
        return why

    def disengage(self, now_ns: int, reason: str) -> None:
        """Brake and stay."""
        self._change(now_ns, GuardEvent.DISENGAGE, reason)

    def reset(self, now_ns: int, reason: str) -> str | None:
        """Leave the e-stop for `hold`; or why not.

        Joints that were moved by hand meanwhile are held where they stand now: a drive that is switched
        on again must not fly back to where they were.
        """
        if self.state is not State.ESTOP:
            return f"there is no e-stop to reset, the robot is in {self.state}"
        silent = self._joints.life.silence(now_ns)
        if pressed := self.still_pressed():
            return pressed
        if not self._joints.seated or silent:
            return silent or "not every encoder has been read yet"
        if not self._joints.at_rest:
            return "still braking"
        seat_rad = self._joints.after_estop_rad()
        if seat_rad is not None:
            self._seat_rad = self._joints.seat(seat_rad)
        self._change(now_ns, GuardEvent.RESET, reason)
        return None

    def still_pressed(self) -> str | None:
        """Why an emergency stop input forbids a reset, or None."""
        return None if self._body.estop is None else f"{self._body.estop}: release or mend it first"

    def home(self, now_ns: int) -> str | None:
        """A person confirms the joint positions. Returns why that is refused, or None."""
        if self._joints.seated:
            return "the joint positions are known already"
        if self._joints.life.silence(now_ns) is None:
            self._joints.placement.confirm(self._joints.life.position_rad)
        return self._joints.unplaced(now_ns)[0]

    # the rest is the guard's own

    def _clutch(self, now_ns: int) -> None:
        """Stand while the operator repositions himself. Go slowly to his posture once he presses again."""
        if self._commands.clutch_out:
            self._clutch_ns = self._clutch_ns if self.state is State.CLUTCH else now_ns
            self._change(now_ns, GuardEvent.CLUTCH_OUT, "clutch: stands until it is pressed again")
        elif self.state is State.CLUTCH and self._joints.at_rest:
            why = self._refusal(self.operator, State.HOLD, now_ns)
            if why is not None:
                self.lose(now_ns, "clutch", f"clutch pressed, but {why}")
                return
            self._progress.begin(now_ns)
            self._change(now_ns, GuardEvent.CLUTCH_IN, f"clutch pressed by {self.operator}")

    def _refusal(self, operator: str, state: State, now_ns: int, together: bool = False) -> str | None:
        """Why the robot may not begin to move for this operator, were it in that state; None where it may."""
        arrival = first_loss(self._arrival_watches, self._signs(now_ns))
        return refusal(
            Readiness(
                state, self.reason, operator, self.operator, arrival[1] if arrival else None,
                self._joints.life.silence(now_ns), self._body.first_fault, self._commands, self._joints,
                together,
            )
        )  # fmt: skip

    def _hold(self, now_ns: int, reason: str) -> None:
        """Hold for a reason that is also why it holds on, where it holds already."""
        self._change(now_ns, GuardEvent.DISENGAGE, reason)
        if self.state is State.HOLD:
            self.reason = reason

    def _signs(self, now_ns: int) -> Signs:
        commands = self._commands
        return Signs(
            now_ns, self.lease.token != 0, commands.arrived_ns, commands.somebody_ns(now_ns),
            self.times.command_timeout_ns, commands.refusal, self._joints.life,
            self._joints.plausible.too_many(), self._body,
            self._clutch_ns if self.state is State.CLUTCH else None, self._clutch_max_ns,
            commands.operator_doubt,
        )  # fmt: skip

    def _watch(self, now_ns: int, watches: Sequence[LossWatch]) -> None:
        self.lease.lapse(now_ns)
        missed = self.lease.lapse_offer(now_ns)
        if missed:
            self._hold(now_ns, f"{missed} did not take over in time; waits for {self.operator} to engage")
        if self.state not in ENGAGED:
            return
        loss = first_loss(watches, self._signs(now_ns))
        if loss is not None:
            self.lose(now_ns, *loss)

    def _change(self, now_ns: int, event: GuardEvent, reason: str) -> None:
        after = next_state(self.state, event)
        if after is self.state:
            return
        self.events.add(Change(now_ns, self.state, after, reason))
        self.state, self.reason = after, reason
        if after is not State.TRACK:
            self.episode += 1
        if after in (State.HOLD, State.ESTOP):
            self._commands.arrived_ns = None

    def _try_to_seat(self, now_ns: int) -> None:
        """Hold the joints where they stand, once that is known of every one."""
        unplaced, silent = self._joints.unplaced(now_ns)
        if unplaced is None:
            self._seat_rad = self._joints.seat(self._joints.stand_rad.copy())
            self._change(now_ns, GuardEvent.ENCODERS_VALID, "waits for an operator to engage")
        elif not silent and self.state is State.BOOT:
            self.reason = unplaced

    def _believed(self) -> Mask:
        """(J,) joints that do not rest; both the operator's node and the joint's encoder are believed."""
        free: Mask = self._commands.valid & ~self._joints.plausible.doubted & ~self.resting.joints
        return free
