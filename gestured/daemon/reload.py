"""A reload: everything is read anew, and only where all of it is valid does anything change."""

import asyncio
import time
from collections.abc import Awaitable, Callable

from gestured.client.notify import notify
from gestured.core.errors import GesturedError
from gestured.daemon.asked import Asked, open_all
from gestured.daemon.log import log
from gestured.daemon.metrics import Metrics
from gestured.daemon.settings import Settings

Loader = Callable[[], Settings]  # reads the configuration


class Reload:
    """Reads settings with `load`, opens what they ask for, and gives that to `swap`; frames are served meanwhile."""

    def __init__(self, load: Loader, swap: Callable[[Asked], Awaitable[None]], metrics: Metrics) -> None:
        self._load, self._swap, self._metrics = load, swap, metrics
        self._lock = asyncio.Lock()

    @property
    def running(self) -> bool:
        """Whether a reload has begun and not ended."""
        return self._lock.locked()

    async def run(self) -> str | None:
        """Reload, after the reloads that have begun; returns None, or why nothing has changed."""
        async with self._lock:
            notify(f"RELOADING=1\nMONOTONIC_USEC={time.monotonic_ns() // 1000}")
            try:
                settings = await asyncio.to_thread(self._load)  # a long file, or a slow disk
                asked = await asyncio.to_thread(open_all, settings, self._metrics, insist=True)
            except Exception as error:
                bug = not isinstance(error, GesturedError)
                said = log.exception if bug else log.error
                said("reload refused, nothing has changed", reason=str(error))
                self._metrics.reloads.add("refused")
                return f"a bug: {error!r}" if bug else str(error)
            else:
                await self._swap(asked)
                self._metrics.reloads.add("done")
                return None
            finally:
                notify("READY=1")
