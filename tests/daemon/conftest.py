"""Daemons that tests share where they do not change them, and others that may end as they like."""

import asyncio
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from inspect import iscoroutinefunction
from pathlib import Path
from typing import Any

import pytest

from tests.daemon.harness import Daemon, running
from tests.several import several


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    """A test that is a coroutine runs in a loop of its own."""
    if not iscoroutinefunction(pyfuncitem.obj):
        return None
    asyncio.run(pyfuncitem.obj(**{name: pyfuncitem.funcargs[name] for name in pyfuncitem._fixtureinfo.argnames}))
    return True


@pytest.fixture(scope="session")
def shared(model: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A daemon with the sensor's clock and metrics, for tests that use sensors of their own."""
    folder = tmp_path_factory.mktemp("shared")
    with running(folder, model, "--metrics", "127.0.0.1:0", "--max-sensors", 500) as daemon:
        yield daemon


@pytest.fixture
def start(model: Path, tmp_path: Path) -> Iterator[Callable[..., Daemon]]:
    """Starts daemons that end with the test."""

    def begin(*flags: object, model: object = model, **more: Any) -> Daemon:
        return Daemon.start(tmp_path, model, *flags, **more)

    yield from several(begin, Daemon.stop)


@pytest.fixture
def nobody():
    """The test is user and group 65534 while it is inside."""
    if os.getuid() != 0:
        pytest.skip("only root can be somebody else for a moment")

    @contextmanager
    def become():
        groups = os.getgroups()
        os.setgroups([])
        os.setegid(65534)
        os.seteuid(65534)
        try:
            yield
        finally:
            os.seteuid(0)
            os.setegid(0)
            os.setgroups(groups)

    return become
