"""The conversation by which one drive is set up: its plan's transfers, one after the other. Pure."""

from __future__ import annotations

from dataclasses import replace

from common.clock import NS_PER_MS
from slave.servos.canopen.sdo import Exchange, More, Read, SdoAnswer, Transfer, request
from slave.servos.canopen.setup import SetupPlan
from slave.servos.canopen.setup_checks import SetupRefusedError

SDO_TIMEOUT_NS = 300 * NS_PER_MS
SDO_TRIES = 3
_AGAIN_NS = 20 * NS_PER_MS
"""Before an entry that must change is read again."""
_UPLOADED = 0x40
"""The least command specifier of an answer that names its entry."""


class SetupRun:
    """One drive's, over and over."""

    def __init__(self, plan: SetupPlan) -> None:
        self.plan = plan
        self.lacks: dict[str, str] = {}
        """Parts of its settings that it refused, and why."""
        self.held: dict[tuple[int, int], int] = {}
        """What was read of it, by index and subindex, unsigned."""
        self.done = False
        self.failure = ""
        """A text for why the drive cannot be set up."""
        self._transfers: list[Transfer] = []
        self._patient = False
        self._asked_ns = 0
        self._step = self._tries = self._repeats = 0
        self._exchange: Exchange | None = None
        self._again_ns: int | None = None
        self._answered = b""
        """Index and subindex of the request that was answered last, where it had been sent once."""

    def begin(self, now_ns: int, patient: bool) -> bytes | None:
        """The first request. `patient`: an answer is waited for without end: the caller sets it."""
        self.lacks, self.held = {}, {}
        self.done, self.failure = False, ""
        self._transfers, self._step = self.plan.begin(), 0
        self._again_ns, self._answered = None, b""
        self._patient = patient
        return self._next(now_ns)

    def on_answer(self, data: bytes, now_ns: int) -> bytes | None:
        """The next request; None: not an answer to the last one, or all is done, or it failed."""
        answered = None if self._exchange is None or self._ended else self._exchange.on_answer(data)
        if answered is None:
            return None
        if isinstance(answered, More):
            self._asked_ns = now_ns
            return answered.request
        transfer = self._transfers[self._step]
        if not answered.done and isinstance(transfer, Read):
            if self._repeats < transfer.again:
                self._repeats += 1
                self._again_ns = now_ns + _AGAIN_NS
                return None
            answered = replace(answered, done=transfer.optional)
        if not answered.done and not transfer.part_of:
            self.failure = f"refuses its configuration: {answered.words}"
            return None
        self._note(transfer, answered)
        self._answered = data[1:4] if self._tries == 1 and not self._repeats else b""
        self._step += 1
        return self._next(now_ns)

    def overdue(self, now_ns: int) -> bytes | None:
        """The request once more, where its answer is overdue; after the last try it has failed."""
        if self._ended:
            return None
        if self._again_ns is not None:
            if now_ns < self._again_ns:
                return None
            self._again_ns, self._tries = None, 0
            return self._ask(now_ns)
        if now_ns - self._asked_ns < SDO_TIMEOUT_NS:
            return None
        if self._tries >= SDO_TRIES and not self._patient:
            self.failure = self.silence
            return None
        return self._ask(now_ns)

    def answers_twice(self, data: bytes) -> bool:
        """Whether this answers a request that was sent once and is answered already."""
        # the one under way may be for the same entry
        asked = not self._ended and request(self._transfers[self._step])[1:4] == data[1:4]
        return bool(self._answered) and data[1:4] == self._answered and data[0] >= _UPLOADED and not asked

    @property
    def silence(self) -> str:
        """What a request without a proper answer is called."""
        strange = self._exchange.strange if self._exchange is not None else ""
        return strange or "does not answer"

    @property
    def asked_again(self) -> bool:
        """Whether a request had to be repeated."""
        return self._tries > 1

    @property
    def _ended(self) -> bool:
        return self.done or bool(self.failure) or self._step >= len(self._transfers)

    def _note(self, transfer: Transfer, answered: SdoAnswer) -> None:
        if not answered.done:
            self.lacks[transfer.part_of] = answered.words
        elif isinstance(transfer, Read) and answered.data:
            self.held[transfer.index, transfer.subindex] = int.from_bytes(answered.data, "little")

    def _next(self, now_ns: int) -> bytes | None:
        """Ask for the next transfer that the drive may take; None where there is none."""
        self._tries = self._repeats = 0
        while True:
            while self._step < len(self._transfers):
                transfer = self._transfers[self._step]
                if transfer.part_of not in self.lacks and not self._left_out(transfer):
                    return self._ask(now_ns)
                self._step += 1
            try:
                self._transfers, self._step = self.plan.then(self.held, self.lacks), 0
            except SetupRefusedError as error:
                self.failure = str(error)
                return None
            if not self._transfers:
                self.done = True
                return None

    def _left_out(self, transfer: Transfer) -> bool:
        """Whether the drive's EDS says that it need not be asked."""
        refusal = self.plan.refusal(transfer) if transfer.part_of else ""
        if refusal and not (isinstance(transfer, Read) and transfer.optional):
            self.lacks[transfer.part_of] = refusal
        return bool(refusal)

    def _ask(self, now_ns: int) -> bytes:
        self._asked_ns = now_ns
        self._tries += 1
        if self._tries == 1 or self._exchange is None:
            self._exchange = Exchange(self._transfers[self._step])
        return self._exchange.begin()
