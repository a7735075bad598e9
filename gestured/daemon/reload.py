"""A reload: everything is read anew, and only where all of it is valid does anything change."""

import asyncio
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from gestured.client.notify import notify
from gestured.core.errors import GesturedError
from gestured.core.own import Examples
from gestured.daemon import own_file
from gestured.daemon.ladder import open_ladder
from gestured.daemon.log import log
from gestured.daemon.metrics import Metrics
from gestured.daemon.settings import Settings
from gestured.daemon.sinks import OscSink
from gestured.model.ladder import Ladder

Loader = Callable[[], Settings]  # reads the configuration
OwnFile = tuple[Path | None, tuple[Examples, str | None]]  # where it is, what is in it, and what is wrong with it


@dataclass(frozen=True, slots=True)
class Fresh:
    """What a configuration asks for, opened and not yet used."""

    settings: Settings
    ladder: Ladder
    osc: list[OscSink]
    own: OwnFile


class Reload:
    """Reads with `load`, opens, and hands all of it to `swap`; frames are served meanwhile."""

    def __init__(self, load: Loader, swap: Callable[[Fresh], None], metrics: Metrics) -> None:
        self._load, self._swap, self._metrics = load, swap, metrics
        self._lock = asyncio.Lock()

    @property
    def running(self) -> bool:
        """Whether one has begun and not ended."""
        return self._lock.locked()

    async def run(self) -> str | None:
        """Reload once those are over that have begun; None, or why nothing has changed."""
        async with self._lock:
            notify(f"RELOADING=1\nMONOTONIC_USEC={time.monotonic_ns() // 1000}")
            try:
                settings = await asyncio.to_thread(self._load)  # a long file, or a slow disk
                fresh = await asyncio.to_thread(self._open, settings)
            except Exception as error:
                bug = not isinstance(error, GesturedError)
                said = log.exception if bug else log.error
                said("reload refused, nothing has changed", reason=str(error))
                self._metrics.reloads.add("refused")
                return f"a bug: {error!r}" if bug else str(error)
            else:
                self._swap(fresh)
                self._metrics.reloads.add("done")
                return None
            finally:
                notify("READY=1")

    def _open(self, settings: Settings) -> Fresh:
        """What may take long: models, names of hosts, and the file of own gestures."""
        ladder = open_ladder(settings, insist=True)
        return Fresh(settings, ladder, destinations(settings, self._metrics), own_file_of(settings))


def destinations(settings: Settings, metrics: Metrics) -> list[OscSink]:
    """Where OSC is sent."""
    return [OscSink(address, metrics, provisional=settings.publish_provisional) for address in settings.publish]


def own_file_of(settings: Settings) -> OwnFile:
    """Find the file of own gestures, and read it."""
    path = own_file.where(settings.own_gestures, os.environ)
    return path, own_file.load(path)
