"""``python -m signedheat.cli``."""

import sys

from . import main

if __name__ == "__main__":  # not in the processes of a pool, which import it again
    sys.exit(main())
