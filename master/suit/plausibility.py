"""Whether what a node answers can be true: frozen, zero, stuck, clipped, or against gravity. Pure.

    add ─▶ ring of 0.1 s ─ every 20 ms ─▶ evidence a node ─▶ doubt (N,), held for some time ─▶ words

A real converter's last bits always move. In the recordings of people and of units at rest that there are no
accelerometer and no gyro repeats all three axes for more than 3 samples (10 ms), nor one axis for more than
10 (35 ms); one that hangs repeats for ever. All rules look at exact repeats, at the ends of the range, at
gravity while a node is still, and at gravity against the gyro's turn (`gravity`).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from common.clock import to_ns
from common.quaternion import Array
from common.wire.messages import Mask
from master.suit.chance import RepeatChance
from master.suit.doubt import NodeDoubt, Weight
from master.suit.gravity import GravityWatch
from master.suit.plausibility_config import PlausibilityConfig
from master.suit.plausibility_words import axes_of, frozen_words, letters_of, values_of
from master.suit.sweep import Sweep

BLOCK = 4
"""Ticks from one judgement to the next."""
_ACC, _GYR, _MAG = slice(0, 3), slice(3, 6), slice(6, 9)
_G_M_S2 = 9.80665
_CLIPPED_ACC, _CLIPPED_GYR = 0.5, 0.2
"""Shares of the window at the end of the range. A knock on the unit clips its accelerometer for 4 samples of
20 in the recordings; what a clipped gyro missed is lost for good, so it is believed less long."""
_BLANK_COUNTS = 3.5
"""Counts of the accelerometer's three axes together, in one sample: 0, 0, 0 is a sensor without power or
after a reset, −1, −1, −1 a bus without a sensor. The sample is not used."""
_MOVES_M_S2 = 0.4
"""Within the window; an accelerometer of 0.04 m/s² of noise goes through 0.16."""
_QUIET_M_S2, _QUIET_RAD_S = 1.0, math.radians(5.0)
"""Within the window: the node is still enough for its accelerometer to show gravity alone."""
_MAG_TURN_RAD = 1.0
_LIVELY_COUNTS = 5.5
"""A sensor of which an axis goes farther than this within the window moves, or has noise of a count or more,
of which an axis repeats for `axis_s` by chance less than once a year. Below, `chance` decides."""
_NOISE_COUNTS = 12.5
"""An axis that goes farther within the window is no axis at rest whose noise could be learnt."""
_CONCLUDED = 25
"""Judgements (0.5 s) from one look at the noise of the axes to the next."""


class PlausibilityWatch:
    """State of N nodes between ticks."""

    def __init__(
        self,
        config: PlausibilityConfig,
        count: int,
        rate_hz: float,
        scale: Array,
        affine: Array | None = None,
        top: Array | None = None,
        derived: Mask | None = None,
    ) -> None:
        """SI per count (9,) or (N, 9); calibration (3, N, 3, 4); largest readings (6,) or (N, 6).

        `derived` (N,): nodes whose readings follow from an orientation, which prove nothing.
        """
        self._config = config
        self._scale = scale
        self._rows = BLOCK * max(3, round(config.repeats_s * rate_hz / BLOCK))
        self._ring = np.full((self._rows, count, 9), np.nan)
        self._fresh = np.zeros((self._rows, count), np.bool_)
        self._row = 0
        self._judged = None if derived is None else ~derived
        self._blank_sum = _BLANK_COUNTS * scale[..., 0]
        self._top = (32767.0 * scale[..., :6] if top is None else top) * (1.0 - 1e-9)
        self._axis_blocks = self._blocks(config.axis_s, rate_hz)
        self._chance = RepeatChance(count, rate_hz, scale[..., :6], config.still_axis_s * rate_hz)
        self._chance_blocks = self._blocks_of(self._chance.samples, self._axis_blocks)
        self._frozen_blocks = self._blocks_of(self._chance.all_three, 1)
        self._judgements = 0
        self._mag_blocks = self._blocks(config.magnetometer_s, rate_hz)
        self._stood = np.zeros((count, 9), np.int64)
        """Judgements in a row in which a channel did not move."""
        self._turned_rad = np.zeros((count, 3))
        """By how much a node turned since each axis of its magnetometer moved."""
        self._off_scale = np.zeros(count, np.int64)
        self._norm_g = np.ones(count)
        self._held_until_ns = np.zeros(count, np.int64)
        self._words: dict[int, str] = {}
        self._mag_words: dict[int, str] = {}
        self._saturated = np.zeros((self._rows, count), np.bool_)
        self._gravity = GravityWatch(count, config.contradiction_deg, affine)
        self._judged_ns = 0
        self.doubted: Mask = np.zeros(count, np.bool_)
        """(N,) nodes whose readings are not used now."""
        self.mag_doubted: Mask = np.zeros(count, np.bool_)

    def _blocks(self, seconds: float, rate_hz: float) -> int:
        return max(1, math.ceil((seconds * rate_hz - self._rows) / BLOCK) + 1)

    def _blocks_of(self, samples: NDArray[np.int64], least: int) -> NDArray[np.int64]:
        # of n equal readings the first is no repeat
        return np.maximum(least, -((self._rows - 1 - samples) // BLOCK) + 1)

    def doubts(self) -> dict[int, NodeDoubt]:
        """What is wrong with which node, by its index."""
        out = {node: NodeDoubt(words, Weight.REFUSED) for node, words in self._words.items()}
        for node, words in self._mag_words.items():
            out.setdefault(node, NodeDoubt(words, Weight.NOTED))
        return out

    def take(self, sweep: Sweep, readings: Array, saturated: Mask | None = None) -> Sweep:
        """One tick's sweep with doubted nodes marked as lost, and stuck magnetometers left out.

        `readings` (N, 9): the sweep's, in one array. `saturated` (N,): nodes that report a clipped reading.
        """
        row = self._row
        self._ring[row] = readings
        blank = np.abs(readings[:, _ACC]).sum(axis=1) < self._blank_sum
        self._fresh[row] = sweep.fresh if self._judged is None else sweep.fresh & self._judged
        self._saturated[row] = False if saturated is None else saturated
        self._row = (row + 1) % self._rows
        if self._row % BLOCK == 0:
            self._judge(sweep.sampled_ns)
        if not (blank.any() or self._words or self._mag_words):
            return sweep
        mag = np.where(self.mag_doubted[:, None], np.nan, sweep.mag_ut) if self._mag_words else sweep.mag_ut
        fresh = sweep.fresh & ~blank & ~self.doubted
        return replace(sweep, mag_ut=mag, fresh=fresh, lost=sweep.lost | self.doubted)

    def _judge(self, now_ns: int) -> None:
        ring = self._ring
        low, high = ring.min(axis=0), ring.max(axis=0)
        span = high - low
        heard = 2 * self._fresh.sum(axis=0) >= self._rows
        same = (span == 0.0) & heard[:, None]
        # a missed window repeats the reading before it, which is no evidence
        whole: Mask = np.logical_and.reduce(self._fresh[self._block()], axis=0)
        self._stood = (self._stood + whole[:, None]) * same
        dt_s, self._judged_ns = 1e-9 * (now_ns - self._judged_ns), now_ns
        found: dict[int, str] = {}
        self._judgements += 1
        if not self._config.noise_free:
            self._learn_noise(same, span)
            self._find_repeats(same, span, found)
        self._find_clipped(low, high, found)
        if self._judgements % 2 == 0:  # half as often: it costs much, and looks back 0.1 s anyway
            self._weigh(low, high, span, heard)
        self._find_wrong_gravity(found)
        self._follow_gravity(self._block(), dt_s, found)
        self._settle(found, now_ns)

    def _block(self) -> slice:
        """The ticks since the last judgement."""
        end = self._row or self._rows
        return slice(end - BLOCK, end)

    def _follow_gravity(self, block: slice, dt_s: float, found: dict[int, str]) -> None:
        mean = self._ring[block].mean(axis=0)
        silent: Mask = ~np.logical_or.reduce(self._fresh[block], axis=0)
        # what repeats or is clipped says nothing of how the gyro turns
        silent[list(found)] = True
        self._gravity.update(mean[:, _ACC], mean[:, _GYR], dt_s, silent)
        if not self._config.noise_free:
            self._find_stuck_magnetometers()
        for contradicted in np.flatnonzero(self._gravity.contradicted):
            node = int(contradicted)
            found.setdefault(
                node,
                f"its gyroscope contradicts gravity by {self._gravity.worst_deg[node]:.0f}°: dead, wrong "
                "sign, axis or scale, or a large bias; calibrate it, or replace it",
            )

    def _find_repeats(self, same: Mask, span: Array, found: dict[int, str]) -> None:
        if not same[:, :6].any():
            return
        stood = self._stood[:, :6].reshape(-1, 2, 3).min(axis=2)
        repeats: Mask = (stood > 0) & (stood >= self._frozen_blocks)
        newest = self._ring[self._row - 1]
        for node in np.flatnonzero(repeats.any(axis=1)):
            scale = self._scale if self._scale.ndim == 1 else self._scale[node]
            found[int(node)] = frozen_words(newest[node] / scale, repeats[node])
        needed = np.where(self._lively(span), self._axis_blocks, self._chance_blocks)
        stuck = self._stood[:, :6] >= needed
        for node in np.flatnonzero(stuck.any(axis=1)):
            axes = np.flatnonzero(stuck[node])
            found.setdefault(int(node), f"{axes_of(axes)} stuck at {values_of(newest[node], axes)}")

    def _lively(self, span: Array) -> Mask:
        """(N, 6) axes whose sensor moves or has much noise."""
        wide = span[:, :6] > _LIVELY_COUNTS * self._scale[..., :6]
        lively = wide.copy()
        lively[:, :3] |= (wide[:, 0] | wide[:, 1] | wide[:, 2])[:, None]
        # a gyro turns about one axis alone at times; then gravity moves through the accelerometer
        moves = _widest(span[:, _ACC]) > _MOVES_M_S2
        lively[:, 3:] |= (wide[:, 3] | wide[:, 4] | wide[:, 5] | moves)[:, None]
        return lively

    def _learn_noise(self, same: Mask, span: Array) -> None:
        """A window in `_rows`, so that each reading is seen about once, and a pause between them never."""
        if self._judgements * BLOCK % self._rows == 0:
            # noise spreads far, but goes nowhere
            half = self._rows // 2
            drift = np.abs(self._ring[half:, :, :6].mean(axis=0) - self._ring[:half, :, :6].mean(axis=0))
            rests = (span[:, :6] < _NOISE_COUNTS * self._scale[..., :6]) & (
                drift < 2.0 * self._scale[..., :6]
            )
            rests &= (_widest(span[:, _ACC]) < _MOVES_M_S2)[:, None]
            self._chance.learn(self._ring[..., :6], rests & ~same[:, :6])
        if self._judgements % _CONCLUDED == 0:
            self._chance.conclude()
            self._chance_blocks = self._blocks_of(self._chance.samples, self._axis_blocks)
            self._frozen_blocks = self._blocks_of(self._chance.all_three, 1)

    def _find_clipped(self, low: Array, high: Array, found: dict[int, str]) -> None:
        ends = (high[:, :6] >= self._top) | (low[:, :6] <= -self._top)
        reported = self._saturated.sum(axis=0) >= _CLIPPED_ACC * self._rows
        if not (ends.any() or reported.any()):
            return
        share = (np.abs(self._ring[..., :6]) >= self._top).mean(axis=0)
        clipped = share >= np.repeat([_CLIPPED_ACC, _CLIPPED_GYR], 3)
        for node in np.flatnonzero(clipped.any(axis=1) | reported):
            axes = np.flatnonzero(clipped[node])
            which = axes_of(axes) if len(axes) else "a reading is"
            found[int(node)] = f"{which} saturated: at the end of its range"

    def _weigh(self, low: Array, high: Array, span: Array, heard: Mask) -> None:
        quiet = heard & (_widest(span[:, _ACC]) < _QUIET_M_S2) & (_widest(span[:, _GYR]) < _QUIET_RAD_S)
        centre = self._gravity.calibrated_acc(0.5 * (low[:, _ACC] + high[:, _ACC]))
        self._norm_g = np.sqrt(np.einsum("ni,ni->n", centre, centre)) / _G_M_S2
        off = quiet & (np.abs(self._norm_g - 1.0) > self._config.gravity_share)
        self._gravity.learn_bias(quiet, centre, self._ring[self._row - 1][:, _GYR])
        self._off_scale = (self._off_scale + 1) * off

    def _find_wrong_gravity(self, found: dict[int, str]) -> None:
        for node in np.flatnonzero(self._off_scale >= 2):
            found.setdefault(
                int(node),
                f"its accelerometer reads {self._norm_g[node]:.2f} g while still: wrong range, self-test, or "
                "a broken axis",
            )

    def _find_stuck_magnetometers(self) -> None:
        stood = self._stood[:, _MAG]
        if not (stood.any() or self._mag_words):
            self._turned_rad[:] = 0.0
            return
        turned = self._gravity.turned_rad[:, None]
        self._turned_rad = (self._turned_rad + turned) * (stood > 0)
        stuck = (stood >= self._mag_blocks) & (self._turned_rad > _MAG_TURN_RAD)
        # once stuck, until it moves again
        self.mag_doubted = np.logical_or.reduce(stuck, axis=1)
        self._mag_words = {
            int(node): f"its magnetometer's {letters_of(np.flatnonzero(stuck[node]))} stuck: it is not used"
            for node in np.flatnonzero(self.mag_doubted)
        }

    def _settle(self, found: dict[int, str], now_ns: int) -> None:
        if not (found or self._words):
            return
        for node, words in found.items():
            self._words[node] = words
            self._held_until_ns[node] = now_ns + to_ns(self._config.clear_s)
        for node in [n for n in self._words if n not in found and now_ns >= self._held_until_ns[n]]:
            del self._words[node]
        doubted = np.zeros_like(self.doubted)
        doubted[list(self._words)] = True
        self.doubted = doubted


def _widest(span: Array) -> Array:
    # a reduction over three columns costs twice as much
    out: Array = np.maximum(np.maximum(span[:, 0], span[:, 1]), span[:, 2])
    return out
