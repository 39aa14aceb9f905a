"""``python -m signedheat.cli``."""

import sys

from . import main

sys.exit(main())
