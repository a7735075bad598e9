"""`python -m gestured.control` is `gesturectl`."""

import sys

from gestured.control.cli import main

if __name__ == "__main__":
    sys.exit(main())
