"""``python -m signedheat``."""

import os
import sys
from contextlib import suppress

from .cli import main

if __name__ == "__main__":  # not in the processes of a pool, which import it again
    with suppress(FileNotFoundError):  # the current folder has been deleted
        if sys.path[0] == os.getcwd() != os.path.dirname(os.path.dirname(os.path.abspath(__file__))):
            del sys.path[0]  # `python -m` searches the current folder first
    sys.exit(main())
