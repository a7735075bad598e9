"""The user's own gestures in a running daemon: who enrols one now, what is known, and the file they are kept in."""

import asyncio
import time
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

from gestured.core.enrolment import Enrolment
from gestured.core.errors import GesturedError
from gestured.core.events import Cancelled
from gestured.core.facts import Decided, Fact
from gestured.core.own import MOST, Examples, is_name
from gestured.core.prototypes import EXAMPLES
from gestured.daemon.caller import Connection
from gestured.daemon.log import log
from gestured.daemon.request import Refusal, json_line
from gestured.model import own_file
from gestured.model.ladder import Ladder
from gestured.model.own import Examiner, Own
from gestured.model.own_file import OwnFile

ATTEMPT_S = 120.0  # an enrolment without an attempt for so long gives its place to others
ANSWERED_TWICE = "refractory"  # such a contact was decided, too


class OwnGestures:
    """What is known, and one enrolment at a time. `changed` is called when the list is another one."""

    def __init__(self, changed: Callable[[], None]) -> None:
        """`follow` comes before anything else."""
        self._changed = changed
        self.gestures: Examples = {}
        self.path: Path | None = None
        self.fault: str | None = None  # why nothing can be enrolled
        self._open: tuple[Enrolment, Connection] | None = None  # what is being learned, and who waits for it
        self._heard = 0.0  # monotonic s, the last attempt
        self._finishing: asyncio.Task[None] | None = None
        self._writing = asyncio.Lock()

    def follow(self, ladder: Ladder, read: OwnFile) -> None:
        """Use what was read of a file, with these models: at the start, and after a reload."""
        if self._finishing is None:
            self._give_up("the daemon was told to reload; enrol again")
        self._ladder, (self.path, self.gestures, self.fault) = ladder, read
        if self.fault is not None:
            log.error("own gestures", what=self.fault)
        self._use()

    def _use(self) -> None:
        """Compare with these from now on; say where they do not hold apart for the model that answers."""
        self._ladder.own = Own(self.gestures)
        bank = self._ladder.own.bank(self._ladder.model) if self.gestures else None
        for sentence in bank.doubtful if bank else ():
            log.warning("own gestures", what=sentence, model=self._ladder.active)

    @property
    def off(self) -> str | None:
        """Why the model that answers knows none of them, or None."""
        return f"{self._ladder.active} has no embedding" if self._ladder.model.space is None else None

    def report(self) -> dict[str, Any]:
        """For the status; any thread may ask."""
        held = self._open
        return {
            "file": None if self.path is None else str(self.path),
            "fault": self.fault,
            "gestures": {name: len(examples) for name, examples in self.gestures.items()},
            "off": self.off,
            "doubtful": list(bank.doubtful) if (bank := self._ladder.own.made(self._ladder.model)) else [],
            "enrolling": None if held is None or held[1].closed else held[0].name,
        }

    @property
    def enrolling(self) -> bool:
        """Whether somebody performs examples now."""
        return self._open is not None

    def begin(self, connection: Connection, name: str, sensor: str, examples: int, in_use: Collection[str]) -> None:
        """Take what is performed on a sensor as examples, and tell the connection of each. Raises Refusal."""
        self.tick()
        if self._open is not None:
            before, _ = self._open
            raise Refusal(f"{before.name!r} is being enrolled on {before.sensor}; one at a time")
        self._check(name)
        if not 1 <= examples <= EXAMPLES:
            raise Refusal(f"expected 1 to {EXAMPLES} examples, found {examples}")
        model = self._ladder.model
        if model.space is None:
            raise Refusal(f"{self.off}: own gestures are off while it answers")
        judge = Examiner(model, model.space, self._ladder.own, in_use)
        self._open = Enrolment(name, sensor, examples, judge), connection
        self._heard = time.monotonic()
        connection.streams = True  # it need not ask for anything meanwhile

    def see(self, fact: Fact) -> None:
        """Look at what the hub found: an answer on the sensor is an attempt."""
        if self._open is None or not isinstance(fact, Decided | Cancelled):
            return
        enrolment, connection = self._open
        if enrolment.complete or fact.sensor != enrolment.sensor:
            return
        if isinstance(fact, Cancelled) and fact.reason == ANSWERED_TWICE:
            return
        self._heard = time.monotonic()
        try:
            told = enrolment.see(fact.segment if isinstance(fact, Decided) else fact)
        except GesturedError as error:  # the model failed
            self._give_up(str(error))
            return
        connection.send(json_line(told))
        if enrolment.complete:
            self._finishing = asyncio.get_running_loop().create_task(self._finish(enrolment, connection))

    def tick(self) -> None:
        """Give up what nobody waits for any more; call it once a second."""
        if self._open is None or self._finishing is not None:
            return
        if self._open[1].closed:
            self._give_up("its client has gone")
        elif time.monotonic() - self._heard > ATTEMPT_S:
            self._give_up(f"nothing was performed for {ATTEMPT_S:g} s")

    async def forget(self, name: str) -> None:
        """Have a gesture no longer, nor its examples in the file. Raises Refusal or OwnFileError."""
        async with self._writing:
            if name not in self.gestures:
                known = ", ".join(self.gestures) or "none: nothing is enrolled"
                raise Refusal(f"{name!r} is no gesture of your own, expected one of {known}")
            await self._keep({other: examples for other, examples in self.gestures.items() if other != name})

    async def _finish(self, enrolment: Enrolment, connection: Connection) -> None:
        try:
            if connection.closed:
                raise Refusal("its client has gone")
            async with self._writing:
                self._check(enrolment.name)  # the models may be others by now
                await self._keep({**self.gestures, enrolment.name: tuple(enrolment.kept)})
            connection.send(json_line({"enrolled": enrolment.name, "examples": len(enrolment.kept)}))
            log.info("enrolled", gesture=enrolment.name, examples=len(enrolment.kept))
            self._end(connection)
        except GesturedError as error:
            self._give_up(str(error))
        finally:
            self._finishing = None

    async def _keep(self, gestures: Examples) -> None:
        """Write them, and use them, unless a reload has named another file meanwhile."""
        path = self._file()
        await asyncio.to_thread(own_file.write, path, gestures, self._ladder.model.sha256)
        if path == self.path:
            self.gestures = gestures
            self._use()
            self._changed()

    def _file(self) -> Path:
        """The file that examples are written to. Raises Refusal where there is none, or it could not be read."""
        if self.path is None or self.fault is not None:
            raise Refusal(self.fault or f"there is no file for own gestures: {own_file.REMEDY}")
        return self.path

    def _check(self, name: str) -> None:
        """Raises Refusal for a name that cannot be enrolled here and now."""
        self._file()
        if not is_name(name):
            raise Refusal(f"{name!r} is no gesture's name: expected a-z, then a-z, 0-9, _, 32 at most, not `use`")
        if name in self._ladder.gestures:
            raise Refusal(f"{name!r} is a gesture of {self._ladder.name}; choose another name")
        if name in self.gestures:
            raise Refusal(f"{name!r} is enrolled already; forget it first (gesturectl forget {name})")
        if len(self.gestures) >= MOST:
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
