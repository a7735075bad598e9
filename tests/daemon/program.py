"""`python -m gestured.daemon` as `harness.Daemon` starts it: it trusts the tests' own small model."""

import sys

from gestured.daemon.cli import main
from tests.daemon.trust import trust

if __name__ == "__main__":
    trust()
    sys.exit(main())
