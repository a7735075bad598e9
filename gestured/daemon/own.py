"""The user's own gestures in a running daemon: the open enrolment, the gestures in use, and their file."""

import asyncio
import time
from collections.abc import Callable, Collection
from functools import partial
from pathlib import Path
from typing import Any

from gestured.core.errors import GesturedError
from gestured.core.events import Cancelled, Unknown
from gestured.core.facts import Decided, Fact
from gestured.core.messages import json_line
from gestured.core.own import A_NAME, EXAMPLES, MOST, Examples, is_name
from gestured.daemon.keeper import Keeper
from gestured.daemon.log import log
from gestured.daemon.request import Connection, Refusal
from gestured.model.enrolment import Enrolment, Examiner
from gestured.model.ladder import Ladder
from gestured.model.model import Model
from gestured.model.own import Own
from gestured.model.own_file import OwnFileError

ATTEMPT_S = 120.0  # an enrolment without an attempt for so long is given up
ANSWERED_TWICE = "refractory"  # a contact that is cancelled for this reason was `Decided`, too, and counts once


def silent(sensor: str, gates: Collection[str]) -> str:
    """Why nothing can be enrolled on a sensor while these gates are closed."""
    return f"{sensor} is silent, since gates are closed: {', '.join(gates)}; allow them first"


class OwnGestures:
    """The own gestures in use, and one enrolment at a time. `changed` is called when the gestures have changed."""

    def __init__(self, changed: Callable[[], None]) -> None:
        """`follow` must be called before anything else."""
        self._changed = changed
        self._keeper = Keeper(None)
        self._open: tuple[Enrolment, Connection] | None = None  # and the connection that asked for it
        self._heard = 0.0  # monotonic s, the last attempt
        self._finishing: asyncio.Task[None] | None = None
        self._preparing: asyncio.Task[None] | None = None
        self.writing = asyncio.Lock()  # held from the reading of the file until its gestures are in use

    def read(self, path: Path | None, ladder: Ladder) -> tuple[Keeper, Own]:
        """Read a file, and make the prototypes of the model that answers; any thread that holds `writing` may."""
        keeper = self._keeper if path == self._keeper.path else Keeper(path)
        keeper.read()
        return keeper, ladder.compared(keeper.found.gestures)

    def follow(self, ladder: Ladder, keeper: Keeper, own: Own) -> None:
        """Compare contacts with examples that were read, by these models; called at the start and after a reload."""
        if self._finishing is None:
            self._give_up("the daemon was told to reload; enrol again")
        if keeper is not self._keeper:
            self._keeper.close()
        self._ladder, self._keeper = ladder, keeper
        for sentence in filter(None, (keeper.found.fault, keeper.unkept)):
            log.error("own gestures", what=sentence)
        self._use(own)

    def _use(self, own: Own) -> None:
        """Compare contacts with `own` from now on; log which gestures the model that answers cannot tell apart."""
        self._ladder.own = own
        own.missing = self._prepare
        self._warn()

    def _prepare(self, model: Model) -> None:
        """Have the prototypes of a model made that answers now; until they are, it knows no own gestures."""
        if self._preparing is None or self._preparing.done():
            self._preparing = asyncio.get_running_loop().create_task(self._make(self._ladder.own, model))

    async def _make(self, own: Own, model: Model) -> None:
        await asyncio.to_thread(own.make, model)
        self._warn()

    def _warn(self) -> None:
        for sentence in self._doubtful():
            log.warning("own gestures", what=sentence, model=self._ladder.active)

    def _doubtful(self) -> list[str]:
        own, bank = self._ladder.own, self._ladder.own.made(self._ladder.model)
        hidden = [f"{name} is off, since {self._ladder.name} has a gesture of that name" for name in own.hidden]
        return [*hidden, *(bank.doubtful if bank else ())]

    @property
    def gestures(self) -> Examples:
        """The own gestures that contacts are compared with."""
        return self._ladder.own.gestures

    @property
    def off(self) -> str | None:
        """Why the model that answers knows no own gestures, or None."""
        return f"{self._ladder.active} has no embedding" if self._ladder.model.space is None else None

    def report(self) -> dict[str, Any]:
        """What the status shows of own gestures; any thread may ask."""
        held = self._open
        return {
            "file": None if self._keeper.path is None else str(self._keeper.path),
            "fault": self._keeper.fault,
            "gestures": {name: len(examples) for name, examples in self.gestures.items()},
            "off": self.off,
            "doubtful": self._doubtful(),
            "enrolling": None if held is None or held[1].closed else held[0].name,
        }

    @property
    def enrolling(self) -> bool:
        """Whether an enrolment is open."""
        return self._open is not None

    async def writable(self) -> None:
        """Raises OwnFileError if nothing can be enrolled because the file cannot be read or written."""
        async with self.writing:
            if self._keeper.found.fault is not None:
                raise OwnFileError(self._keeper.found.fault)
            await asyncio.to_thread(self._keeper.hold)

    def begin(self, connection: Connection, name: str, sensor: str, examples: int, in_use: Collection[str]) -> None:
        """Take contacts of a sensor as examples, and tell the connection of each. Raises Refusal."""
        self.tick()
        if self._open is not None:
            before, _ = self._open
            raise Refusal(f"{before.name!r} is being enrolled on {before.sensor}; one at a time")
        self._check(name, self._keeper.found.gestures)
        if not 1 <= examples <= EXAMPLES:
            raise Refusal(f"expected 1 to {EXAMPLES} examples, found {examples}")
        model = self._ladder.model
        if model.space is None:
            raise Refusal(f"{self.off}: own gestures are off while it answers")
        self._examiner = partial(Examiner, model, model.space, in_use=in_use)
        self._open = Enrolment(name, sensor, examples, self._examiner(self._ladder.own)), connection
        self._heard = time.monotonic()
        connection.streams = True  # so that the connection is not closed for asking nothing

    def see(self, fact: Fact) -> None:
        """Look at a fact of the hub: each answer of the sensor is an attempt."""
        if self._open is None or not isinstance(fact, Decided | Cancelled | Unknown):
            return
        enrolment, connection = self._open
        if enrolment.complete or fact.sensor != enrolment.sensor:
            return
        if isinstance(fact, Cancelled) and fact.reason == ANSWERED_TWICE:
            return
        if isinstance(fact, Unknown) and not fact.gates:
            return  # this contact was `Decided`, too
        self._heard = time.monotonic()
        if isinstance(fact, Unknown):
            reason = silent(fact.sensor, fact.gates)
            connection.send(json_line({"example": len(enrolment.kept) + 1, "kept": False, "reason": reason}))
            return
        try:
            told = enrolment.see(fact.segment if isinstance(fact, Decided) else fact)
        except GesturedError as error:  # the model failed
            self._give_up(str(error))
            return
        connection.send(json_line(told))
        if enrolment.complete:
            self._finishing = asyncio.get_running_loop().create_task(self._finish(enrolment, connection))

    def tick(self) -> None:
        """Give up an enrolment that nobody waits for any more; call it once a second."""
        if self._open is None or self._finishing is not None:
            return
        if self._open[1].closed:
            self._give_up("its client has gone")
        elif time.monotonic() - self._heard > ATTEMPT_S:
            self._give_up(f"nothing was performed for {ATTEMPT_S:g} s")

    async def forget(self, name: str) -> None:
        """Forget a gesture and delete its examples from the file. Raises Refusal or OwnFileError."""

        def without(found: Examples) -> Examples:
            if name not in found and name not in self._keeper.found.gestures:
                known = f", expected one of {', '.join(found)}" if found else ": nothing is enrolled"
                raise Refusal(f"{name!r} is no gesture of your own{known}")
            return {other: examples for other, examples in found.items() if other != name}

        await self._change(without)

    async def _finish(self, enrolment: Enrolment, connection: Connection) -> None:
        def with_it(found: Examples) -> Examples:
            self._check(enrolment.name, found)  # models and file may have changed by now
            return {**found, enrolment.name: tuple(enrolment.kept)}

        try:
            if connection.closed:
                raise Refusal("its client has gone")
            await self._change(with_it)
            connection.send(json_line({"enrolled": enrolment.name, "examples": len(enrolment.kept)}))
            log.info("enrolled", gesture=enrolment.name, examples=len(enrolment.kept))
            self._end(connection)
        except GesturedError as error:
            self._give_up(str(error))
        finally:
            self._finishing = None

    async def _change(self, change: Callable[[Examples], Examples]) -> None:
        """Change the file, and use the gestures that it holds then."""
        async with self.writing:
            ladder = self._ladder
            await asyncio.to_thread(self._keeper.change, change, ladder.model.sha256)
            own = await asyncio.to_thread(ladder.compared, self._keeper.found.gestures)
            self._use(own)
        if self._open is not None:
            self._open[0].judge = self._examiner(own)  # a gesture that was forgotten must rule out no example
        self._changed()

    def _check(self, name: str, gestures: Examples) -> None:
        """Raises Refusal for a name that cannot be enrolled beside these gestures."""
        if not is_name(name):
            raise Refusal(f"{name!r} is no gesture's name: expected {A_NAME}")
        if name in self._ladder.gestures:
            raise Refusal(f"{name!r} is a gesture of {self._ladder.name}; choose another name")
        if name in gestures:
            raise Refusal(f"{name!r} is enrolled already; forget it first (gesturectl forget {name})")
        if len(gestures) >= MOST:
            raise Refusal(f"{MOST} gestures are enrolled already, which is the most there can be; forget one first")

    def _give_up(self, reason: str) -> None:
        """End the enrolment, if there is one, without keeping its examples."""
        if self._open is not None:
            enrolment, connection = self._open
            log.info("enrolment given up", gesture=enrolment.name, reason=reason)
            connection.send(json_line({"given_up": enrolment.name, "reason": reason}))
            self._end(connection)

    def _end(self, connection: Connection) -> None:
        connection.streams = False
        self._open = None
