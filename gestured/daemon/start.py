"""The start of the daemon: sockets, models, signals, and the line that says that it is ready."""

import asyncio
import faulthandler
import gc
import json
import os
import resource
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from typing import Any

from gestured.client.notify import notify
from gestured.daemon import log as logging
from gestured.daemon.asked import open_all
from gestured.daemon.bound import Bound, bind_all
from gestured.daemon.log import Throttle, log
from gestured.daemon.metrics import Metrics
from gestured.daemon.service import Loader, Service
from gestured.daemon.settings import Settings
from gestured.daemon.sockets import AddressError
from gestured.model.process import end_all

DESCRIPTORS = 4096  # wanted, for 1024 clients; the usual soft limit is 1024 in all
FEWEST_DESCRIPTORS = 256  # needed for the daemon itself, destinations, some clients, and what is kept from clients
STOPS = (signal.SIGTERM, signal.SIGINT)
END_S = 4.0  # s for open contacts, and for clients to read their answers; systemd's units allow 5


def run(settings: Settings, load: Loader) -> None:
    """Run a daemon until it is asked to end. Raises AddressError, ModelError, SettingsError."""
    _raise_descriptor_limit()
    import uvloop

    if sys.stderr is not None:
        faulthandler.enable()  # when systemd's watchdog ends a hang (SIGABRT), the log says on which line it hung
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.run(_run(settings, load))


async def _run(settings: Settings, load: Loader) -> None:
    """Bind sockets, open models, serve. A failure before that ends the daemon before it says that it is ready."""
    loop = asyncio.get_running_loop()
    _abort(signal.SIG_BLOCK)  # in all threads that are made from here on; this one unblocks it below
    loop.set_default_executor(ThreadPoolExecutor(initializer=_abort, initargs=(signal.SIG_BLOCK,)))
    stop, reload = asyncio.Event(), asyncio.Event()
    loop.set_exception_handler(partial(report, Throttle()))
    _when(signal.SIGHUP, partial(loop.call_soon_threadsafe, reload.set))
    served = threading.Event()
    _end_surely(loop, served)
    bound = bind_all(settings)
    for number in STOPS:
        _when(number, partial(_end_at_once, bound))
    try:
        metrics = Metrics()
        service = Service(open_all(settings, metrics), metrics, bound, load)  # no variable here keeps a model alive
        for number in STOPS:
            _when(number, partial(loop.call_soon_threadsafe, stop.set))
        gc.freeze()  # the objects of the start stay, so later collections need not visit them
        await service.start()
        _abort(signal.SIG_UNBLOCK)
        _announce(service)
        await service.serve(stop, reload)
        _ignore_stops()
    finally:
        bound.close()
        end_all()  # threads may wait for a model that is being opened, and the end waits for threads
    served.set()  # threads may also wait for a name server or a disk: for these the end waits END_S in all


def report(throttle: Throttle, _: asyncio.AbstractEventLoop, what: dict[str, Any]) -> None:
    """Log an error that nobody handled, as an event loop reports it.

    A lost connection is no bug, though asyncio reports it, too, when its streams are collected as garbage.
    """
    error = what.get("exception")
    if not isinstance(error, ConnectionError):
        throttle.error("a bug in a callback", what["message"], exc_info=error)


def _abort(how: int) -> None:
    """Block or unblock, in this thread, SIGABRT, with which systemd ends a daemon that hangs.

    Only the loop's thread may take this signal. systemd wakes a stopped process to end it; if another thread took the
    signal, the loop would first read the packets in its sockets, which are meant for the daemon that starts next.
    """
    signal.pthread_sigmask(how, [signal.SIGABRT])


def _when(number: signal.Signals, act: Callable[[], object]) -> None:
    """Call `act` on a signal.

    The event loop's own handlers are not used. A loop that closes gives its signals their default action, so that a
    signal at that moment would kill the process; blocking it would not help, since other threads do not block it.
    """
    signal.signal(number, lambda *_: act())


def _ignore_stops() -> None:
    """Ignore further signals, since the daemon ends: a stop that is repeated must not look like a crash."""
    for number in (*STOPS, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)


def _end_at_once(bound: Bound) -> None:
    """End the process during its start, without waiting for a model that is being opened.

    It raises no exception, since a library that is being imported would turn it into an error of its own.
    """
    _ignore_stops()
    bound.close()
    end_all()
    logging.close()
    os._exit(0)


def _end_surely(loop: asyncio.AbstractEventLoop, served: threading.Event) -> None:
    """Make sure that a stop ends the process, even if the loop's thread never comes back from a model.

    The exit status is then 1, or 0 if all was `served` and only other threads are not done. Python's signal handlers
    wait for the loop's thread, but any thread can read what a signal writes to the wakeup descriptor. A thread of our
    own takes the loop's place there, so it wakes the loop, too.
    """
    signals, wakeup = socket.socketpair()
    wakeup.setblocking(False)
    signal.set_wakeup_fd(wakeup.detach(), warn_on_full_buffer=False)

    def watch() -> None:
        while number := signals.recv(1):
            with suppress(RuntimeError):  # the loop is closed, and only the end of the process is left
                loop.call_soon_threadsafe(lambda: None)
            if number[0] in STOPS:
                time.sleep(END_S)
                if not served.is_set():
                    log.error("ended by force: it did not end by itself", seconds=END_S)
                logging.close()  # its reader has the last lines before the process is gone
                os._exit(0 if served.is_set() else 1)

    threading.Thread(target=watch, name="signals", daemon=True).start()


def _announce(service: Service) -> None:
    model = service.parts.ladder.active
    where = {key: value for key, value in service.parts.bound.addresses().items() if value is not None}
    control = where.pop("control")
    ready: dict[str, Any] = {"type": "ready", **where, "model": model, "control": control}
    log.info("ready", **where, model=model)
    logging.print_line(json.dumps(ready, separators=(",", ":")))
    notify(f"READY=1\nSTATUS={model} on {where['listen']}")


def _raise_descriptor_limit() -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = DESCRIPTORS if hard == resource.RLIM_INFINITY else min(DESCRIPTORS, hard)
    if wanted < FEWEST_DESCRIPTORS:
        raise AddressError(
            f"the limit of open files (ulimit -n, LimitNOFILE=) is too low: expected at least {FEWEST_DESCRIPTORS}, "
            f"found {hard}"
        )
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
