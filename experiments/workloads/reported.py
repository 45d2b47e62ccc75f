"""What the paper reports."""

from __future__ import annotations

BEST_SPEEDUPS = {"cornell_box": 7.50, "mitsuba": 2.94, "fireplace_room": 1.85, "sponza": 1.71}
"""Its best speed-ups, aligned single rays at the best of 1 to 1,024 splits."""

PAPER_SIZE = (1024, 1024)
"""Width and height of its images in pixels."""
