"""Messages of pages: which of them make sense; all others are ignored."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import hypot, isfinite, pi
from typing import Any

LARGEST_BYTES = 4096
"""Longest message that is read; those of the page have some hundred bytes."""

_FARTHEST = 1e12
"""Largest coordinate of a camera."""

_MOST_PIXELS = 1 << 15
"""Widest and highest page."""

_CAMERA = {
    "type", "wxyz", "position", "fov", "near", "far", "image_height", "image_width", "look_at", "up_direction",
}  # fmt: skip
_CONTROL = {"type", "uuid", "updates"}
_HOLD = {"type", "uuid", "frequency"}


class Messages:
    """What a page may say: where its camera is, the new value of a control, and that a button is held.

    controls: by the control's identifier, whether it can have a value; held: how often a second a held button says so.
    Both are filled while the page is made.
    """

    def __init__(self) -> None:
        self.controls: dict[str, Callable[[Any], bool]] = {}
        self.held: dict[str, float] = {}

    def make_sense(self, raw: object) -> bool:
        """Whether these bytes are a message of the page. Never raises."""
        import msgspec  # comes with viser

        if not isinstance(raw, bytes) or len(raw) > LARGEST_BYTES:
            return False
        try:
            return self.make_sense_decoded(msgspec.msgpack.decode(raw))
        except (ValueError, RecursionError):  # msgspec's own errors are ValueErrors
            return False

    def make_sense_decoded(self, message: object) -> bool:
        """The same of a message that is decoded."""
        if not isinstance(message, dict) or not all(isinstance(key, str) for key in message):
            return False
        if message.get("type") == "ViewerCameraMessage":
            return message.keys() == _CAMERA and _is_camera(message)
        if message.get("type") == "GuiButtonHoldMessage" and message.keys() == _HOLD:
            uuid, often = message["uuid"], message["frequency"]
            return isinstance(uuid, str) and _is_number(often) and self.held.get(uuid) == often
        if message.get("type") == "GuiUpdateMessage" and message.keys() == _CONTROL:
            uuid, updates = message["uuid"], message["updates"]
            can_have = self.controls.get(uuid) if isinstance(uuid, str) else None
            return can_have is not None and isinstance(updates, dict) and updates.keys() == {"value"} and can_have(
                updates["value"]
            )  # fmt: skip
        return False


def _is_camera(message: Mapping[str, Any]) -> bool:
    return (
        _are_numbers(message["wxyz"], 4)
        and 0.9 < hypot(*message["wxyz"]) < 1.1
        and all(_are_numbers(message[name], 3) for name in ("position", "look_at", "up_direction"))
        and _is_number(message["fov"])
        and 0.0 < message["fov"] < pi
        and all(_is_number(message[name]) for name in ("near", "far"))
        and all(_is_size(message[name]) for name in ("image_height", "image_width"))
    )  # fmt: skip


def _is_size(value: object) -> bool:
    return type(value) is int and 0 < value <= _MOST_PIXELS


def _are_numbers(value: object, count: int) -> bool:
    return isinstance(value, list) and len(value) == count and all(map(_is_number, value))


def _is_number(value: object) -> bool:
    return type(value) in (int, float) and isfinite(value) and abs(value) <= _FARTHEST  # type: ignore[arg-type, operator]
