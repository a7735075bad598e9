"""`python -m gestured.bridge` is `gestured-bridge`."""

import sys

from gestured.bridge.cli import main

if __name__ == "__main__":
    sys.exit(main())
