"""Exposure and tone maps: from linear light to what a screen shows."""

from __future__ import annotations

from math import log2

import numpy as np
from numpy.typing import NDArray

from atra.choices import check_choice
from atra.errors import InputError
from atra.geometry.numbers import as_number
from atra.light.numbers_kernels import LUMINANCE

TONES = ("none", "neutral", "agx")
"""none: light above 1 becomes white. neutral: Khronos PBR Neutral, which keeps base colours. agx: film-like."""

AUTO = "auto"

MOST_STOPS = 64.0

_MIDDLE, _WHITE, _BRIGHT = 0.18, 0.9, 0.95
"""`auto` maps the geometric mean of the luminance to the first, or the quantile `_BRIGHT` to `_WHITE` where that is
brighter."""

_NO_LIGHT = 1e-4
"""Darker pixels, as a share of the bright quantile, do not count for `auto`."""

_START, _DESATURATION = 0.8 - 0.04, 0.15

_TO_AGX = np.array(
    [(0.856627153315983, 0.0951212405381588, 0.0482516061458583),
     (0.137318972929847, 0.761241990602591, 0.101439036467562),
     (0.11189821299995, 0.0767994186031903, 0.811302368396859)]
) @ np.array([(0.6274, 0.3293, 0.0433), (0.0691, 0.9195, 0.0113), (0.0164, 0.0880, 0.8956)])  # fmt: skip
_FROM_AGX = np.array(
    [(1.1271005818144368, -0.11060664309660323, -0.016493938717834573),
     (-0.1413297634984383, 1.157823702216272, -0.016493938717834257),
     (-0.14132976349843826, -0.11060664309660294, 1.2519364065950405)]
)  # fmt: skip
_FROM_REC2020 = np.array([(1.6605, -0.5876, -0.0728), (-0.1246, 1.1329, -0.0083), (-0.0182, -0.1006, 1.1187)])
_AGX_STOPS = -12.47393, 4.026069
_AGX_CURVE = (15.5, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.00232)


def stops_of(image: NDArray[np.floating], exposure: float | str) -> float:
    """The exposure of an (H, W, 3) linear picture in stops: `exposure` itself, or what `auto` finds for it.

    `auto` ignores black pixels. Raises InputError for anything else, naming it.
    """
    if exposure != AUTO:
        try:
            stops = float(exposure) if isinstance(exposure, str) else as_number(exposure)
        except ValueError:
            stops = np.nan
        if not abs(stops) <= MOST_STOPS:
            raise InputError(f"exposure is {exposure!r}, expected auto or a number of stops from -64 to 64")
        return stops
    luminance = np.asarray(image, np.float64) @ np.array(LUMINANCE)
    lit = luminance[np.isfinite(luminance) & (luminance > 0.0)]
    if not len(lit):
        return 0.0
    bright = float(np.quantile(lit, _BRIGHT))
    middle = float(np.exp(np.log(lit[lit >= _NO_LIGHT * bright]).mean()))
    return float(np.clip(log2(max(_MIDDLE / middle, _WHITE / bright)), -MOST_STOPS, MOST_STOPS))


def toned(image: NDArray[np.floating], stops: float = 0.0, tone: str = "none") -> NDArray[np.float32]:
    """(H, W, 3) linear RGB to be encoded as sRGB: light times 2^stops, then the tone map, one of `TONES`.

    Raises InputError for another name. Sources: Khronos PBR Neutral, specification 1.0; AgX by T. Sobotka, as fitted by
    B. Wrensch and used by three.js.

    Examples
    --------
    >>> from atra import light
    >>> import numpy as np
    >>> light.toned(np.array([[[4.0, 1.0, 0.25]]]), stops=-1, tone="none").round(2).tolist()
    [[[2.0, 0.5, 0.11999999731779099]]]
    """
    check_choice("tone", tone, TONES)
    light = np.asarray(image, np.float32) * np.float32(2.0**stops)
    if tone == "none":
        return light
    return _neutral(light) if tone == "neutral" else _agx(light)


def _neutral(light: NDArray[np.float32]) -> NDArray[np.float32]:
    least = light.min(axis=-1, keepdims=True)
    light = light - np.where(least < 0.08, least - np.float32(6.25) * least * least, np.float32(0.04))
    peak = light.max(axis=-1, keepdims=True)
    bright = peak > _START
    room = np.float32(1.0 - _START)
    shown = np.float32(1.0) - room * room / np.where(bright, peak + room - np.float32(_START), 1.0)
    pale = np.float32(1.0) / (np.float32(_DESATURATION) * (peak - shown) + np.float32(1.0))
    compressed = light * (shown / np.where(bright, peak, 1.0))
    return np.where(bright, shown + pale * (compressed - shown), light)


def _agx(light: NDArray[np.float32]) -> NDArray[np.float32]:
    low, high = _AGX_STOPS
    stops = np.log2(np.maximum(light @ _TO_AGX.T.astype(np.float32), np.float32(1e-10)))
    share = np.clip((stops - low) / (high - low), 0.0, 1.0)
    curve = np.polyval(_AGX_CURVE, share) @ _FROM_AGX.T
    return np.clip(np.maximum(curve, 0.0) ** 2.2 @ _FROM_REC2020.T, 0.0, 1.0).astype(np.float32)
