"""The daemons of the daemon's own tests."""

from tests.daemon.conftest import model, shared, start

__all__ = ["model", "shared", "start"]
