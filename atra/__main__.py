"""`python -m atra` is the command `atra`."""

import sys

from atra.command.main import main

sys.exit(main())
