"""The guard: admits commands, watches what must not be lost, gives the servos a setpoint they may follow."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from common.clock import to_ns, to_s
from common.clock_sync import Offset
from common.errors import ConfigError
from common.quaternion import Array
from common.skeleton import Skeleton
from common.wire.messages import Command, ControlReply, ControlRequest, Mask
from slave.guard.admit import DEADMAN, GATES, Gate, Situation, Verdict, admit
from slave.guard.align import Alignment, Rejoin
from slave.guard.body import WELL, Body
from slave.guard.config import GuardConfig
from slave.guard.control import Control
from slave.guard.engage import Readiness, refusal
from slave.guard.events import Change, Doubt, GuardCounters, Journal
from slave.guard.lease import DrawToken, Lease, random_token
from slave.guard.placed import Placement
from slave.guard.plausible import Plausibility
from slave.guard.states import MOVING, Event, State, next_state
from slave.guard.watchdog import ARRIVAL_WATCHES, BODY_WATCHES, EncoderLife, Signs, Watch, first_loss
from slave.limit.limit import SetpointLimiter
from slave.limit.nearest import NearestPosture
from slave.track import Target, Tracker


@dataclass(frozen=True, slots=True)
class Setpoint:
    """Where the servos are to go now. (J,) each, read-only."""

    position_rad: Array
    velocity_rad_s: Array
    ready: bool = True
    """False until every joint has been read: where it stands is not known, so write it to no servo."""


class Guard:
    """One robot's guard. Pure: every time is the slave's own clock, and is given.

    Raises ConfigError where the configuration contradicts itself or the skeleton.
    """

    def __init__(
        self,
        robot: str,
        skeleton: Skeleton,
        config: GuardConfig,
        tracker: Tracker,
        *,
        last_known_rad: Mapping[str, float] | None = None,
        draw_token: DrawToken = random_token,
        gates: Sequence[Gate] = GATES,
        arrival_watches: Sequence[Watch] = ARRIVAL_WATCHES,
        body_watches: Sequence[Watch] = BODY_WATCHES,
    ) -> None:
        mistakes = config.mistakes_for(skeleton)
        if mistakes:
            raise ConfigError(robot, mistakes)
        names = skeleton.joint_names
        limits = config.limits(skeleton)
        self.robot = robot
        self.state = State.BOOT
        self.reason = "waits for a valid reading of every encoder"
        self.lease = Lease(to_ns(config.lease_timeout_s), draw_token)
        self.counters = GuardCounters()
        self.events = Journal(config.events_kept)
        self._config = config
        self._names = names
        self._tracker = tracker
        self._gates = tuple(gates)
        self._arrival_watches = tuple(arrival_watches)
        self._watches = (*arrival_watches, *body_watches)
        self._max_age_ns = to_ns(config.max_age_s)
        self._future_tolerance_ns = to_ns(config.future_tolerance_s)
        self._command_timeout_ns = to_ns(config.command_timeout_s)
        self._control = Control(self, config.reset_key)
        self._encoders = EncoderLife(names, to_ns(config.encoder_timeout_s))
        self._plausible = Plausibility(names, skeleton.max_velocity_rad_s, config)
        self._placement = Placement(
            names, skeleton.lower_rad, skeleton.upper_rad, last_known_rad=last_known_rad
        )
        self._drive_rad: Array | None = None
        self._body = WELL
        self._nearest = NearestPosture(skeleton, limits)
        self._limiter = SetpointLimiter(names, limits)
        self._alignment = Alignment(names, config)
        self._rejoin = Rejoin(limits, config)
        self._seated = False
        self._stepped_ns: int | None = None
        self._command_ns: int | None = None
        self._somebody_ns: int | None = None
        self._refusal = ""
        self._newest_sequence = -1
        self._valid: Mask = np.zeros(len(names), np.bool_)
        self._operator_doubt = ""

    @property
    def operator(self) -> str:
        """Who holds the lease, empty where nobody does."""
        return self.lease.operator

    @property
    def doubts(self) -> Mapping[str, str]:
        """Joints that are held because their encoder is not believed, and why."""
        return self._plausible.words

    # inputs

    def on_control(self, request: ControlRequest, now_ns: int) -> ControlReply:
        """Answer a request of a person or a master: what happened, or why not."""
        self._watch(now_ns, self._arrival_watches)
        return self._control.answer(request, now_ns)

    def on_command(self, command: Command, received_ns: int, now_ns: int, master_offset: Offset) -> Verdict:
        """Judge a command that arrived at `received_ns`.

        One that is refused changes nothing but counters, except that a released deadman makes the
        robot hold, and refuse to engage until it is held again.
        """
        received_ns = min(received_ns, now_ns)
        self.counters.received += 1
        # the gap before this command counts, even if the step that should have seen it came late
        self._watch(received_ns, self._arrival_watches)
        self.lease.lapse(now_ns)
        situation = Situation(
            self.robot, len(self._names), self.lease.token, self._newest_sequence, now_ns, master_offset,
            self._max_age_ns, self._future_tolerance_ns,
        )  # fmt: skip
        verdict = admit(command, situation, self._gates)
        if not verdict.accepted:
            self.counters.dropped[verdict.gate] += 1
            self._refusal = verdict.reason
            if verdict.gate == DEADMAN:
                # the operator's newest word: what was said before it may neither engage nor come after it
                self._newest_sequence, self._command_ns = command.sequence, None
                self._lose(now_ns, DEADMAN, verdict.reason)
            return verdict
        self.counters.accepted += 1
        self.lease.renew(received_ns)
        self._newest_sequence = command.sequence
        self._command_ns = received_ns
        if command.valid.any():
            self._somebody_ns = received_ns
        self._refusal = ""
        self._valid, self._operator_doubt = command.valid.copy(), command.doubt
        self._accept(command, situation.sampled_ns(command), now_ns)
        return verdict

    def step(
        self,
        now_ns: int,
        position_rad: Array,
        encoder_valid: Mask,
        encoder_ns: int,
        body: Body = WELL,
        *,
        drive_rad: Array | None = None,
    ) -> Setpoint:
        """One turn of the servo loop: the encoders (J,) as read at `encoder_ns` in, the setpoint out.

        `drive_rad` (J,): the same angles by the drives' own encoders, where they tell them.
        """
        dt_s = self._elapsed_s(now_ns)
        self._encoders.update(position_rad, encoder_valid, encoder_ns)
        self._drive_rad = drive_rad
        self._doubt(now_ns, position_rad, encoder_valid, encoder_ns)
        self._place(now_ns, position_rad, encoder_valid, encoder_ns)
        self._body = body.also(self._placement.differ)
        self._watch(now_ns, self._watches)
        if not self._seated:
            return self._wait(now_ns, position_rad)
        target = self._tracker.target(now_ns) if self.state in MOVING else None
        if target is not None and not _finite(target):
            self._lose(now_ns, "target", "the tracker's target is not finite")
            target = None
        if target is None:
            self._limiter.stop(dt_s)
        else:
            self._follow(now_ns, dt_s, target)
        self._plausible.note(now_ns, self._limiter.position_rad)
        return Setpoint(self._limiter.position_rad, self._limiter.velocity_rad_s)

    def estop(self, now_ns: int, reason: str = "e-stop at the robot") -> None:
        """Brake and stay. From every state, by anybody; only a reset leaves it."""
        self._change(now_ns, Event.ESTOP, reason)

    # what `Control` asks for on behalf of people

    def claim(self, operator: str, now_ns: int) -> int:
        """The token of a new lease, or 0 where somebody holds one. Its commands are counted from 0."""
        token = self.lease.claim(operator, now_ns)
        if token:
            self._newest_sequence, self._command_ns, self._refusal = -1, None, ""
        return token

    def release(self, now_ns: int, reason: str) -> None:
        """End the lease; the robot holds."""
        self.lease.drop()
        self._change(now_ns, Event.LOSS, reason)

    def engage(self, operator: str, now_ns: int) -> str | None:
        """Begin to move to the operator's posture; or why not."""
        signs = self._signs(now_ns)
        arrival = first_loss(self._arrival_watches, signs)
        body = self._encoders.silence(now_ns)
        why = refusal(
            Readiness(
                state=self.state,
                reason=self.reason,
                operator=operator,
                holder=self.operator,
                command_loss=arrival[1] if arrival else None,
                encoder_loss=body,
                body_fault=self._body.amiss,
                unsettled=self._plausible.unsettled(),
                operator_doubt=self._operator_doubt,
                any_valid=bool(self._valid.any()),
                at_rest=self._limiter.at_rest,
                strayed=self._strayed(),
            )
        )
        if why is None:
            self._plausible.trust()
            self._alignment.begin(now_ns)
            self._change(now_ns, Event.ENGAGE, f"engaged by {operator}")
        return why

    def disengage(self, now_ns: int, reason: str) -> None:
        """Brake and stay."""
        self._change(now_ns, Event.DISENGAGE, reason)

    def reset(self, now_ns: int, reason: str) -> str | None:
        """Leave the e-stop for `hold`; or why not.

        Joints that were moved by hand meanwhile are held where they stand now: a drive that is switched
        on again must not fly back to where they were.
        """
        if self.state is not State.ESTOP:
            return f"there is no e-stop to reset, the robot is in {self.state}"
        silent = self._encoders.silence(now_ns)
        if not self._seated or silent:
            return silent or "not every encoder has been read yet"
        if not self._limiter.at_rest:
            return "still braking"
        if self._drive_rad is not None:
            # a drive that is switched on stays where it stands, by its own angle: the setpoint is there
            self._limiter.seat(self._drive_rad)
        elif self._strayed():
            # nor to where an encoder says it is that is not believed
            self._limiter.seat(
                np.where(self._plausible.doubted, self._limiter.position_rad, self._stands_rad())
            )
        self._change(now_ns, Event.RESET, reason)
        return None

    def home(self, now_ns: int) -> str | None:
        """A person has looked at the robot: it stands as it says. Or why that does not count."""
        if self._seated:
            return "where every joint stands is known already"
        silent = self._encoders.silence(now_ns)
        if silent is None:
            self._placement.confirm(self._encoders.position_rad)
        return silent or self._placement.unplaced(self._encoders.position_rad)

    @property
    def placed(self) -> bool:
        """Whether it is known where every joint stands."""
        return self._seated and not self._placement.differ

    # the rest is the guard's own

    def _accept(self, command: Command, sampled_ns: int, now_ns: int) -> None:
        """What the operator does, as far as this robot's own limits let it, becomes the tracker's."""
        asked = command.position_rad
        # by the master's own stamps: what is thought of its clock may step
        position, velocity = self._nearest.of(
            command.stamps.sampled_ns, asked, command.velocity_rad_s, command.valid
        )
        for clamp in self._nearest.clamps(now_ns, asked, position):
            self.counters.clamps[clamp.rule] += 1
            self.events.add(clamp)
        self._tracker.accept(sampled_ns, now_ns, position, velocity)

    def _signs(self, now_ns: int) -> Signs:
        somebody_ns = now_ns if self._valid.any() else self._somebody_ns
        return Signs(
            now_ns, self.lease.token != 0, self._command_ns, somebody_ns, self._command_timeout_ns,
            self._refusal, self._encoders, self._plausible.too_many(), self._body,
            doubt=self._operator_doubt,
        )  # fmt: skip

    def _doubt(self, now_ns: int, position_rad: Array, encoder_valid: Mask, encoder_ns: int) -> None:
        moving = self.state in MOVING
        for joint in self._plausible.judge(position_rad, encoder_valid, encoder_ns, moving):
            self.counters.doubts[joint] += 1
            self.events.add(Doubt(now_ns, joint, self._plausible.words[joint]))

    def _place(self, now_ns: int, position_rad: Array, encoder_valid: Mask, encoder_ns: int) -> None:
        if self._seated and self._plausible.span is None:
            return  # an old reading
        good = encoder_valid & np.isfinite(position_rad)
        moves = self._placement.take(
            encoder_ns,
            position_rad,
            good,
            drive_rad=self._drive_rad,
            span=self._plausible.span,
            under_way=self.state in MOVING,
        )
        if moves is not None and self.state is not State.ESTOP:
            self.counters.losses["unbidden"] += 1
            self.estop(now_ns, moves)

    def _stands_rad(self) -> Array:
        """Where to hold the joints: by the drives' own angles, where there are any, as they take setpoints.

        Held at the encoders' angles they would walk there, by what the two differ.
        """
        return self._encoders.position_rad if self._drive_rad is None else self._drive_rad

    def _watch(self, now_ns: int, watches: Sequence[Watch]) -> None:
        self.lease.lapse(now_ns)
        if self.state not in MOVING:
            return
        loss = first_loss(watches, self._signs(now_ns))
        if loss is not None:
            self._lose(now_ns, *loss)

    def _lose(self, now_ns: int, what: str, reason: str) -> None:
        if self.state in MOVING:
            self.counters.losses[what] += 1
            self._change(now_ns, Event.LOSS, reason)

    def _change(self, now_ns: int, event: Event, reason: str) -> None:
        after = next_state(self.state, event)
        if after is self.state:
            return
        self.events.add(Change(now_ns, self.state, after, reason))
        self.state, self.reason = after, reason
        if after is State.TRACK:
            self._rejoin.begin(now_ns, self._believed())
        else:
            # what the operator did before must not move the robot after
            self._tracker.reset()
            self._nearest.forget()
        if after in (State.HOLD, State.ESTOP):
            self._command_ns = None

    def _elapsed_s(self, now_ns: int) -> float:
        before_ns, self._stepped_ns = self._stepped_ns, now_ns
        if before_ns is None:
            return 0.0
        dt_s = to_s(now_ns - before_ns)
        if not 0.0 <= dt_s <= self._config.max_step_s:
            self.counters.late_steps += 1
        return min(max(dt_s, 0.0), self._config.max_step_s)

    def _wait(self, now_ns: int, position_rad: Array) -> Setpoint:
        """Before every joint has been read: no setpoint, only where the joints seem to stand."""
        silent = self._encoders.silence(now_ns) is not None
        unplaced = None if silent else self._placement.unplaced(self._encoders.position_rad)
        if unplaced is not None and self.state is State.BOOT:
            self.reason = unplaced
        if silent or unplaced is not None:
            return Setpoint(position_rad.copy(), np.zeros_like(position_rad), ready=False)
        self._limiter.seat(self._stands_rad())
        self._seated = True
        self._change(now_ns, Event.ENCODERS_VALID, "waits for an operator to engage")
        return Setpoint(self._limiter.position_rad, self._limiter.velocity_rad_s)

    def _follow(self, now_ns: int, dt_s: float, target: Target) -> None:
        error = self._limiter.limits.reachable(target.position_rad) - self._limiter.position_rad
        aligning, free = self.state is State.ALIGN, self._believed()
        if aligning:
            maxima = self._rejoin.slow_velocity_rad_s, self._rejoin.slow_acceleration_rad_s2
        else:
            maxima = self._rejoin.maxima(now_ns, error, free)
        clamps = self._limiter.step(now_ns, dt_s, target.position_rad, target.velocity_rad_s, ~free, *maxima)
        for clamp in clamps:
            self.counters.clamps[clamp.rule] += 1
            self.events.add(clamp)
        if aligning:
            self._align(now_ns, error, free)

    def _believed(self) -> Mask:
        """Joints that may move: both the operator's nodes and the joint's own encoder are to be believed."""
        free: Mask = self._valid & ~self._plausible.doubted
        return free

    def _align(self, now_ns: int, error_rad: Array, free: Mask) -> None:
        if self._alignment.done(now_ns, error_rad, free):
            self._change(now_ns, Event.ALIGNED, f"follows {self.operator}")
            return
        overdue = self._alignment.overdue(now_ns)
        if overdue is not None:
            self._lose(now_ns, "align", overdue)

    def _strayed(self) -> str | None:
        """The joint that is farthest from where it is held, if that is too far."""
        gap = np.abs(self._encoders.position_rad - self._limiter.position_rad)
        worst = int(gap.argmax())
        if gap[worst] <= self._config.engage_window_rad:
            return None
        return f"{self._names[worst]} is {gap[worst]:.2f} rad from where it is held"


def _finite(target: Target) -> bool:
    # a sum of squares is finite only if every value is, and costs a third of asking each
    return math.isfinite(
        target.position_rad @ target.position_rad + target.velocity_rad_s @ target.velocity_rad_s
    )
