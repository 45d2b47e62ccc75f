"""Which fields a camera has where it is written down, in cameras.json and in the manifest."""

from __future__ import annotations

from collections.abc import Iterable

REQUIRED_CAMERA_FIELDS = frozenset({"eye", "target"})
OPTIONAL_CAMERA_FIELDS = frozenset({"up", "fov_y_degrees"})


def camera_fields_problem(given: Iterable[str]) -> str | None:
    """What is wrong with these field names of `atra.camera.Camera`, as the end of a sentence; None = nothing."""
    names = set(given)
    if REQUIRED_CAMERA_FIELDS <= names <= REQUIRED_CAMERA_FIELDS | OPTIONAL_CAMERA_FIELDS:
        return None
    return (
        f"has the fields {', '.join(sorted(names)) or 'none'}; "
        "expected eye and target, and optionally up and fov_y_degrees"
    )
