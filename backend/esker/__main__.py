"""``python -m esker`` is the same as ``esker``."""

import sys

from esker.cli import main

sys.exit(main())
