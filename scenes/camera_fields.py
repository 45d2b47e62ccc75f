"""Which fields a camera has where it is written down, in cameras.json and in the manifest."""

from __future__ import annotations

from collections.abc import Mapping

REQUIRED_CAMERA_FIELDS = frozenset({"eye", "target"})
OPTIONAL_CAMERA_FIELDS = frozenset({"up", "fov_y_degrees"})


_VECTORS = ("eye", "target", "up")
_LARGEST_NUMBER = 1e300
_SHOWN = 100


def camera_fields_problem(given: Mapping[str, object]) -> str | None:
    """What is wrong with these fields of `atra.geometry.camera.Camera`, as the end of a sentence; None = nothing.

    Whether they make a view together (eye and target differ, up is not along the view) only the camera knows.
    """
    names = set(given)
    if not REQUIRED_CAMERA_FIELDS <= names <= REQUIRED_CAMERA_FIELDS | OPTIONAL_CAMERA_FIELDS:
        return (
            f"has the fields {', '.join(sorted(names)) or 'none'}; "
            "expected eye and target, and optionally up and fov_y_degrees"
        )
    for name, value in given.items():
        if name in _VECTORS:
            usable = isinstance(value, (list, tuple)) and len(value) == 3 and all(map(_is_finite_number, value))
        else:
            usable = _is_finite_number(value)
        if not usable:
            expected = "three finite numbers" if name in _VECTORS else "an angle in degrees"
            return f"has {name} = {str(value)[:_SHOWN]}, expected {expected}"
    return None


def _is_finite_number(value: object) -> bool:
    # Compared, not converted: JSON has whole numbers no float can hold.
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < _LARGEST_NUMBER
