"""The daemons of the daemon's own tests."""

from tests.daemon.conftest import model, start

__all__ = ["model", "start"]
