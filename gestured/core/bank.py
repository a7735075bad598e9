"""Banks: calm sensors as rows of arrays, whose idle frames are processed together if they wait together.

Nearly all frames of many sensors are idle, and a call of numpy costs more than the work on 81 numbers. So what is
known of a sensor that nobody touches moves into a row of a bank. It moves back into the sensor's own objects before
anything but an idle frame in its turn is processed. A bank does with an idle frame what `Sensor.receive` does, to the
last bit: `matmul` of a stack of grids gives what `dot` gives for each, and exponentials are those of `math`.
"""

import math
from collections.abc import Container, Sequence
from itertools import combinations, repeat
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gestured.core.activity import SURPRISE, USUAL_AT_MOST, Activity
from gestured.core.beside.reading import WEIGHT as JITTER_SHARE
from gestured.core.conditioning import Look, weigh
from gestured.core.contact import AfterEffect
from gestured.core.cutter import LEAD_FRAMES, LEAD_S, Kept
from gestured.core.facts import Arrived, Fact, Fault
from gestured.core.front_end import FrontEnd
from gestured.core.idle import (
    BASELINE_TAU_S,
    GLANCE_S,
    GLANCES,
    NOISE_TAU_S,
    QUIETER,
    RECOVERY_TAU_S,
    REVIEW_S,
    UNSEEN_S,
    glances,
    seen,
)
from gestured.core.mounting import Mounting
from gestured.core.owner import Source
from gestured.core.quantiles import median
from gestured.core.segmenter import IDLE
from gestured.core.sensor import Sensor
from gestured.core.stamping import Stamper
from gestured.core.taxels import NOISY
from gestured.core.timing import SHARE
from gestured.core.wire import Block

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Kind = tuple[int, int, Mounting, bool, int]  # a grid, its mounting, whether time tags count, and the frames kept

NOBODY: Source = "", 0  # owns no sensor
FEW = 6  # from so many frames on, taking them together costs less than one by one
FIRST_ROWS = 16  # rows of a new bank
RECENT = 1 << (Stamper.RECENT - 1).bit_length()  # the fewest frames whose times are kept; like a depth, a power of two
# The numbers that are known of each sensor, by name; `Bank.enter` shows which attribute each of them stands for. Of the
# first three, the values at the last few frames are kept as well.
NAMES = (
    "last", "new", "gap", "arrived", "tag", "counter", "interval", "jitter",
    "glance", "learned", "quieter", "lively", "reviewed", "step", "level",
    "usual", "scale", "active", "count",
    "expected", "before", "pause", "came",
)  # fmt: skip
COLUMN = {name: n for n, name in enumerate(NAMES)}
TURNS = 4  # ticks of the hub in which each sensor in a bank is shown once
COUNTS, SIGMA, WEIGHT, COMPARED, SENT = range(5)  # tables by taxel: of `Idle`, `Conditioner`, and the last frame sent


class Banks:
    """The calm sensors of a hub: a bank for each kind of them."""

    def __init__(self) -> None:
        self._banks: dict[Kind, Bank] = {}
        self.homes: dict[str, Kind] = {}  # by sensor: the kind of its bank
        self.states: dict[str, str] = {}  # by sensor in a bank: its state, as of when it was shown last
        self._turn = 0
        self.doubted: set[str] = set()  # sensors, in banks or not, whose next frame may come after lost ones

    def enter(self, sensor: Sensor) -> None:
        """Move what is known of a sensor into a bank, if it is calm and its last frame came in its turn."""
        front, stamper, owner = sensor.front_end, sensor.stamper, sensor.owner
        front.calm = _calm(front)  # this holds until its next frame
        if not sensor.calm:
            return
        times = {stamper.last, front.pace.last, front.conditioner.idle.followed}
        arrived = {stamper.arrived, sensor.vitals.last, owner.heard, owner.source_heard}
        if stamper.by_tag and stamper.tag is None:
            return  # a bank could take no frame without a time tag, and each would cost the way in and out
        if owner.steady and len(times) == len(arrived) == 1 and not stamper.ahead:
            frames = min(max(LEAD_S / front.pace.interval_s, 1.0), LEAD_FRAMES)  # even a slow sensor keeps one
            kind = (*front.kind, stamper.by_tag, 2 << math.ceil(math.log2(frames)))
            bank = self._banks.get(kind) or self._banks.setdefault(kind, Bank(front, *kind[-2:]))
            bank.enter(sensor)
            self.homes[sensor.name] = kind
            self.tell(sensor)

    def leave(self, sensor: Sensor) -> None:
        """Move what is known of a sensor that is in a bank back into its objects."""
        kind = self.homes.pop(sensor.name)
        self.states.pop(sensor.name, None)
        if len(self._banks[kind]) == 1:
            self._banks.pop(kind).leave(sensor.name)  # an empty bank would keep its memory
        else:
            self._banks[kind].leave(sensor.name)

    def show(self) -> None:
        """Copy what readings tell, and when sensors were heard, into their objects; they stay in their banks."""
        for bank in self._banks.values():
            bank.show(range(TURNS))

    def silent(self, since: float) -> list[str]:
        """The sensors in banks that were heard last before `since` (s)."""
        return [name for bank in self._banks.values() for name in bank.silent(since)]

    def tick(self) -> list[Sensor]:
        """Show the sensors whose turn it is, since a thousand at once would delay every answer; returns them."""
        self._turn = (self._turn + 1) % TURNS
        shown = [sensor for bank in self._banks.values() for sensor in bank.show((self._turn,))]
        for bank in self._banks.values():
            bank.review()
        return shown

    def tell(self, sensor: Sensor) -> None:
        """Keep the state of a sensor that was shown just now."""
        self.states[sensor.name], _ = sensor.condition(sensor.owner.heard)

    def take(
        self, blocks: Sequence[Block], sources: Sequence[Source], others: set[str], now: float, facts: list[Fact]
    ) -> dict[int, tuple[Block, int]]:
        """Take the idle frames of sensors that are in banks; by packet, the block and the place of each that is left.

        `sources` are those of all packets. `others`: sensors of other packets, which must not be overtaken.
        """
        left: dict[int, tuple[Block, int]] = {}
        arrived: dict[int, list[str]] = {}  # sensors by how many frames were lost before
        for one, other in combinations(blocks, 2):
            others = others.union(set(one.sensors).intersection(other.sensors))
        for block in blocks:
            senders = [NOBODY if block.sensors[i] in others else sources[n] for i, n in enumerate(block.packets)]
            lost = np.zeros(len(senders), np.intp) - 1
            for bank in self._banks.values():
                try:
                    bank.take(block, senders, self.doubted, now, lost)
                except Exception as error:  # after a bug, the frames that are left are taken one by one
                    facts.append(Fault(None, error))
            if not lost.any():  # nearly always
                arrived.setdefault(0, []).extend(block.sensors)
                continue
            for n, (name, before) in enumerate(zip(block.sensors, lost.tolist(), strict=True)):
                if before < 0:
                    left[block.packets[n]] = block, n
                else:
                    arrived.setdefault(before, []).append(name)
        facts += [Arrived(tuple(each), 1, lost, 0, 0, 0) for lost, each in arrived.items() if each]
        return left


class Bank:
    """Calm sensors of one kind: with the same grid, mounting and clock, and about the same rate."""

    def __init__(self, front: FrontEnd, by_tag: int, depth: int) -> None:
        """A bank for sensors with front ends like this one, which keeps the last `depth` frames of each."""
        self._by_tag, self._least_s = by_tag, max(LEAD_S / depth, Stamper.MIN_STEP_S)  # least interval between frames
        self._most_s = min(
            front.timing.stale_s, 0.99 * Stamper.MAX_STEP_S
        )  # the most; less than the stamper allows, in case of rounding
        self._front, self._activity = front, Activity(front.rows, front.columns)  # for what all sensors share
        taxels = front.rows * front.columns
        self._sensors: dict[str, Sensor] = {}
        self._owners: dict[str, Source] = {}
        self._rows: dict[tuple[str, Source], int] = {}  # by sensor and the source that owns it
        self._recover: dict[int, AfterEffect] = {}  # by row of a sensor that recovers from a contact
        self._free = list(range(FIRST_ROWS))
        self._known = np.zeros((FIRST_ROWS, len(NAMES)))
        self._taxels = [np.zeros((FIRST_ROWS, taxels)) for _ in range(5)]
        self._above = np.zeros((FIRST_ROWS, depth, taxels))  # counts of the last frames, of which the cutter keeps some
        self._when = np.zeros((FIRST_ROWS, max(depth, RECENT), 3))  # s, by frame: its time, `Kept.new`, its interval

    def __len__(self) -> int:
        """How many sensors are in the bank."""
        return len(self._rows)

    def enter(self, sensor: Sensor) -> None:
        """Move what is known of a sensor into a row."""
        front, stamper, vitals = sensor.front_end, sensor.stamper, sensor.vitals
        idle, activity = front.conditioner.idle, front.conditioner.activity
        if not self._free:
            self._free = list(range(len(self._known), 2 * len(self._known)))
            for name in ("_known", "_above", "_when"):
                setattr(self, name, _twice(getattr(self, name)))
            self._taxels = [_twice(table) for table in self._taxels]
        row = self._free[-1]
        self._known[row] = (
            stamper.last, front.cutter.new, 0.0, stamper.arrived,  # 0: the interval before the last frame
            math.nan if stamper.tag is None else stamper.tag,
            math.nan if stamper.counter is None else stamper.counter,
            front.pace.interval_s, vitals.jitter_s,
            idle.glance, idle.learned, idle.quieter, idle.lively, idle.reviewed, idle.step, idle.level,
            activity.usual, activity.scale, 0.0, 0,  # 0: activity, and frames taken here
            vitals.interval_s, *vitals.together,
        )  # fmt: skip
        assert front.last_sent is not None
        sent, weight = front.last_sent.reshape(-1), front.conditioner.weight
        for table, values in zip(self._taxels, (idle.counts, idle.sigma, weight, idle.compared, sent), strict=True):
            table[row] = values
        self._when[row] = -math.inf
        if steps := stamper.intervals:
            self._when[row, -len(steps) :, 2] = steps
        self._sensors[sensor.name], self._owners[sensor.name] = sensor, sensor.owner.source
        if front.segmenter.after.recovering(self._known[row, COLUMN["last"]]):
            self._recover[row] = front.segmenter.after
        self._rows[sensor.name, sensor.owner.source] = self._free.pop()

    def leave(self, name: str) -> None:
        """Move what is known of a sensor back into its objects."""
        row, sensor = self._rows.pop((name, self._owners.pop(name))), self._sensors.pop(name)
        self._recover.pop(row, None)
        self._free.append(row)
        (last, new, _, arrived, tag, counter, interval, jitter, glance, _, quieter, _, reviewed, _, level,
         usual, scale, active, count, expected, *together) = self._known[row].tolist()  # fmt: skip
        front, stamper, vitals, owner = sensor.front_end, sensor.stamper, sensor.vitals, sensor.owner
        vitals.interval_s = expected
        if not count:
            return
        conditioner, cutter = front.conditioner, front.cutter
        idle, activity = conditioner.idle, conditioner.activity
        owner.heard = owner.source_heard = vitals.last = stamper.arrived = arrived
        stamper.last = front.pace.last = idle.followed = last
        stamper.tag, stamper.overtaken = None if math.isnan(tag) else tag, 0
        if not math.isnan(counter):
            stamper.counter, stamper.late = int(counter), (0, 0)
        front.pace.interval_s, vitals.jitter_s = interval, jitter
        vitals.together = together[0], together[1], int(together[2])
        idle.glance, idle.quieter, idle.reviewed, idle.level = glance, int(quieter), reviewed, level
        activity.usual, activity.scale = usual, scale
        idle.counts, idle.sigma, conditioner.weight, idle.compared, sent = [table[row].copy() for table in self._taxels]
        when, above = (  # oldest first
            ring[row, np.arange(int(count), int(count) + ring.shape[1]) % ring.shape[1]]
            for ring in (self._when, self._above)
        )
        stamper.intervals.clear()
        stamper.intervals.extend(step for _, _, step in when.tolist() if step > 0)
        for higher, (t, since, _) in zip(above, when[-len(above) :].tolist(), strict=True):
            if t > -math.inf:
                cutter.kept.append(Kept(t, higher, 0, None, since))
        cutter.trim(last)
        front.last_sent = sent.reshape(front.grid_sent)
        raw = self._mounted(front.last_sent[np.newaxis])[0]
        cutter.last_raw, cutter.new = raw.tobytes(), new
        front.look = Look(last, raw, above[-1], active, False, False, False)
        if front.rows != front.columns:
            sensor.habits.see(front)  # `habits` compares contacts with the last idle frame

    def show(self, turns: Container[int]) -> list[Sensor]:
        """Copy what readings tell, and when sensors were heard, into the objects of those whose turn it is.

        Returns these sensors.
        """
        pairs = zip(self._sensors.values(), self._rows.values(), strict=True)
        at = [(sensor, row) for sensor, row in pairs if row % TURNS in turns]
        rows = [row for _, row in at]
        told = [COLUMN[name] for name in ("last", "arrived", "interval", "jitter", "level")]
        known = self._known[rows][:, told].tolist()
        for (sensor, _), counts, (last, heard, interval, jitter, level) in zip(
            at, self._taxels[COUNTS][rows], known, strict=True
        ):
            sensor.owner.heard = sensor.owner.source_heard = sensor.stamper.arrived = sensor.vitals.last = heard
            sensor.stamper.last = last
            sensor.front_end.pace.interval_s, sensor.vitals.jitter_s = interval, jitter
            sensor.front_end.conditioner.idle.level, sensor.front_end.conditioner.idle.counts = level, counts
        return [sensor for sensor, _ in at]

    def silent(self, since: float) -> list[str]:
        """The sensors that were heard last before `since` (s)."""
        arrived = self._known[list(self._rows.values()), COLUMN["arrived"]]
        return [name for (name, _), late in zip(self._rows, (arrived < since).tolist(), strict=True) if late]

    def review(self) -> None:
        """From now on jitter is computed with the sensors' present intervals, as by `Vitals.review`."""
        self._known[:, COLUMN["expected"]] = self._known[:, COLUMN["interval"]]

    def take(
        self, block: Block, senders: Sequence[Source], doubted: set[str], now: float, lost: NDArray[np.intp]
    ) -> None:
        """Take the idle frames of a block. `lost` (n,) gets how many were lost just before each that was taken."""
        if block.values.shape[1:] != self._front.grid_sent or (self._by_tag and block.tags is None):
            return
        named = zip(block.sensors, senders, strict=True)
        rows = np.fromiter(map(self._rows.get, named, repeat(-1)), np.intp, len(senders))
        mine = (rows >= 0).nonzero()[0]
        places = mine[rows[mine].argsort(kind="stable")]  # by row, and those of one row as they arrived
        row = np.concatenate(([-1], rows[places], [-1]))
        edges = (row[1:] != row[:-1]).nonzero()[0]
        begins, ends = edges[:-1], edges[1:]  # of the frames of each row
        if len(begins) < len(places):
            # Frames of a sensor share their time of arrival unless their time tags rise; its stamper has to space them.
            tags = block.tags[places] if self._by_tag and block.tags is not None else np.zeros(len(places))
            later = np.concatenate(([True], tags[1:] > tags[:-1]))
            later[begins] = True
            apart = np.logical_and.reduceat(later, begins)
            begins, ends = begins[apart], ends[apart]
        while len(begins):  # one frame of each row at a time
            turn = places[begins]
            doubts = np.array([block.sensors[n] in doubted for n in turn.tolist()]) if doubted else None
            lost[turn] = found = self._take(block, turn, rows[turn], doubts, now)
            for n in turn[found > 0].tolist():  # as `Sensor.receive` counts them
                sensor = self._sensors[block.sensors[n]]
                sensor._lost, sensor._lost_at = sensor._lost + int(lost[n]), now
            for name in doubted.intersection([block.sensors[n] for n in turn[found >= 0].tolist()]) if doubted else ():
                doubted.remove(name)
                self._sensors[name].vitals.stretches = 0  # see `Vitals.arrived`
            more = (found >= 0) & (begins + 1 < ends)
            begins, ends = begins[more] + 1, ends[more]

    def _take(
        self, block: Block, places: NDArray[np.intp], rows: NDArray[np.intp], doubts: Mask | None, now: float
    ) -> NDArray[np.intp]:
        """Take one frame of each of n rows, if it is idle and in its turn; (n,) how many were lost just before each.

        That number is -1 for a frame that was not taken. Frames that were lost while a sensor was idle change only its
        counts and intervals. `doubts`: (n,) whether this machine may have lost frames just before; None for no frame.
        """
        front, known = self._front, self._known.take(rows, axis=0)
        (last, new, gap, arrived, tag, counter, interval, jitter, glance, learned, quieter, lively, reviewed, step,
         level, usual, scale, active, count, expected, before, pause, came) = known.T  # fmt: skip
        tags = math.nan if block.tags is None else block.tags.take(places)
        t = last + (tags - tag) if self._by_tag else np.full(len(rows), now)
        tag[:], since, waited = tags, t - last, now - arrived
        taken = (since >= self._least_s) & (np.maximum(since, waited) <= self._most_s)
        if self._by_tag:
            taken &= t <= now + Stamper.AHEAD_S
        if block.counters is None:
            taken &= np.isnan(counter)
            gap[:], lost = since, np.zeros(len(rows))
            if doubts is not None:  # as many frames as fit into the pause count as lost, see `Stamper.stamp`
                lost[doubts] = np.maximum(np.rint(since / self._usual(rows, count))[doubts] - 1, 0)
        else:  # see `Stamper._count`; a frame whose counter wraps is left to its sensor
            steps = block.counters.take(places) - counter
            taken &= (steps >= 1) & (steps <= Stamper.LEAP)
            counter += steps
            gap[:], lost = since / np.maximum(steps, 1), steps - 1
        sent = block.values.take(places, axis=0).reshape(len(rows), -1).astype(np.float64)
        raw = sent if front.as_sent else self._mounted(sent.reshape(-1, *front.grid_sent))

        glanced = (t >= glance).nonzero()[0]
        if glanced.size:
            changes = raw[glanced] - self._taxels[COMPARED][rows[glanced]]
            loud = (np.abs(changes) * QUIETER >= learned[glanced, np.newaxis]).sum(axis=1)
            # If most taxels moved that much, so did the median of those that moved, and `glances` is not needed.
            clear = (loud > changes.shape[1] // 2) & (learned[glanced] > 0)
            quieter[glanced[clear]] = 0.0
            glance[glanced] = t[glanced] + GLANCE_S
            if not clear.all():
                changes, less = changes[~clear], glanced[~clear]
                quieter[less] += glances(changes, learned[less], lively[less], quieter[less])
                taken &= quieter < GLANCES  # else no idle sensor was learned, see `Idle.mistaken`
        counts = self._taxels[COUNTS].take(rows, axis=0)
        above = raw - counts
        active[:], lowest = self._activity.measure_all(above * self._taxels[WEIGHT].take(rows, axis=0))
        taken &= (active < front.segmenter.on) & (lowest >= -front.conditioner.deep)
        idle = np.maximum(since, 0.0)
        usual += (np.minimum(active, SURPRISE * self._activity.typical) * scale - usual) * _shares(idle, NOISE_TAU_S)
        counts += above * _shares(idle, self._taus(rows, t))[:, np.newaxis]
        due = (t - reviewed >= REVIEW_S).nonzero()[0]
        if due.size:
            sigma = self._taxels[SIGMA][rows[due]]
            unseen = t[due] - np.maximum(reviewed[due], t[due] - UNSEEN_S)
            sigma += (seen(above[due], sigma) - sigma) * _shares(unseen, NOISE_TAU_S)[:, np.newaxis]
            sigma = np.maximum(sigma, step[due, np.newaxis] / 2)
            level[due], reviewed[due] = median(sigma.T), t[due]
            scale[due] = np.minimum(np.maximum(usual[due] / self._activity.typical, 1.0), USUAL_AT_MOST)
            taken[due] &= np.all(sigma <= NOISY * level[due, np.newaxis], axis=1)  # else a taxel is bad
            weight = weigh(sigma, level[due, np.newaxis], scale[due, np.newaxis])

        first = arrived != now  # whether it is the first of the sensor's frames that arrived at `now`
        for column, begun in ((before, jitter), (pause, waited), (came, 0.0)):
            np.copyto(column, begun, where=first)
        came += 1
        moved = before + (np.abs(pause - came * expected) - before) * JITTER_SHARE
        np.copyto(jitter, moved, where=(expected > 0) & (pause < math.inf))
        interval += (since - interval) * SHARE
        changed = sent.view(np.int64) != self._taxels[SENT].take(rows, axis=0).view(np.int64)  # compared bit by bit
        np.copyto(new, t, where=changed.any(axis=1) | (lively == 0))
        last[:], arrived[:] = t, now
        # Nothing of a sensor has changed so far. From here on, what was found is stored for the frames that are taken.
        if glanced.size:
            glanced = glanced[taken[glanced]]
            self._taxels[COMPARED][rows[glanced]] = raw[glanced]
        if due.size:
            fine = taken[due]
            due = rows[due[fine]]
            self._taxels[SIGMA][due], self._taxels[WEIGHT][due] = sigma[fine], weight[fine]
        keep = taken if 0 in taken.tobytes() else slice(None)
        slot = count[keep].astype(np.intp)
        count += 1
        rows, known = rows[keep], known[keep]
        self._above[rows, slot % self._above.shape[1]] = above[keep]
        self._when[rows, slot % self._when.shape[1]] = known[:, :3]
        self._taxels[COUNTS][rows], self._taxels[SENT][rows] = counts[keep], sent[keep]
        self._known[rows] = known
        return np.where(taken, lost, -1).astype(np.intp)

    def _usual(self, rows: NDArray[np.intp], count: Array) -> Array:
        """(n,) s, the usual interval of n rows, of each of which `count` frames were taken here; see `Stamper`."""
        slots = (count.astype(np.intp)[:, np.newaxis] - 1 - np.arange(Stamper.RECENT)) % self._when.shape[1]
        steps = self._when[rows[:, np.newaxis], slots, 2]
        steps = np.sort(np.where(steps > 0, steps, math.inf), axis=1)
        known = np.isfinite(steps).sum(axis=1)
        return np.where(known > 0, steps[np.arange(len(rows)), known // 2], Stamper.PERIOD_S)

    def _taus(self, rows: NDArray[np.intp], t: Array) -> float | Array:
        """The time constants in s with which the baselines follow until (n,) times `t`; one number if all are alike."""
        if not self._recover:
            return BASELINE_TAU_S
        taus = np.zeros(len(rows)) + BASELINE_TAU_S
        for n, row in enumerate(rows.tolist()):
            if (after := self._recover.get(row)) is not None:
                if after.recovering(t[n]):
                    taus[n] = RECOVERY_TAU_S
                else:
                    del self._recover[row]
        return taus

    def _mounted(self, values: NDArray[np.generic]) -> Array:
        """(n, R, C) counts as they were sent -> (n, N) as a person in front of the sensor sees them."""
        return self._front.mounting.frame(values).astype(np.float64).reshape(len(values), -1)


def _calm(front: FrontEnd) -> bool:
    """Whether a front end is calm, or would be without a contact's after-effect, so that a bank can take its frames."""
    look = front.look
    known = look is not None and not look.sunken and front.conditioner.sound and front.pace.interval_s > 0
    return front.calm or (known and front.segmenter.phase is IDLE)


def _twice(table: NDArray[Any]) -> NDArray[Any]:
    """A table with as many free rows more."""
    return np.concatenate([table, np.zeros_like(table)])


def _shares(seconds: Array, tau: float | Array) -> Array:
    """(n,) shares of a difference by which a filter of time constant `tau` moves in (n,) s; one if all are alike."""
    times = (seconds / -tau).tolist()
    if times.count(times[0]) == len(times):
        times = times[:1]
    return np.array([-math.expm1(time) for time in times])
