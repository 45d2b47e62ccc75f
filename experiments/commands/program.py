"""The program as it was called: messages begin with its name."""

from __future__ import annotations

import sys
from pathlib import Path

PROGRAM, COMMAND = ("atra", "atra") if Path(sys.argv[0]).stem == "atra" else ("run.py", "python run.py")
