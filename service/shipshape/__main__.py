"""`python -m shipshape` is `shipshape`."""

import sys

from shipshape.cli import main

if __name__ == "__main__":
    sys.exit(main())
