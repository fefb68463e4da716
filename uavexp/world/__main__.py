"""`python -m uavexp.world FILE`: what was understood of somebody's building (see `uavexp.cli.world`)."""

from __future__ import annotations

import sys

from uavexp.cli.world import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
