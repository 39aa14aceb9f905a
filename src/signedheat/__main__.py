"""``python -m signedheat``."""

import sys

from .cli import main

if __name__ == "__main__":  # not in the processes of a pool, which import it again
    sys.exit(main())
