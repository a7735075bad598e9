"""`python -m gestured.lab` is `gestured-lab`."""

import sys

from gestured.lab.cli import main

if __name__ == "__main__":
    sys.exit(main())
