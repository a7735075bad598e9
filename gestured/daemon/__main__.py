"""`python -m gestured.daemon` is `gestured`."""

import sys

from gestured.daemon.cli import main

if __name__ == "__main__":
    sys.exit(main())
