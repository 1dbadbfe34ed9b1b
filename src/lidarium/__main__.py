"""``python -m lidarium``: the command line."""

import sys

from lidarium_command import main

if __name__ == "__main__":
    sys.exit(main())
