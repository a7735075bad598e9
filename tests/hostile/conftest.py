"""The daemons of the daemon's own tests."""

from tests.daemon.conftest import start

__all__ = ["start"]
