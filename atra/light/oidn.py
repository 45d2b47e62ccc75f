"""Intel Open Image Denoise (https://www.openimagedenoise.org), by the package pyoidn."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import resolve_threads
from atra.errors import AtraError, InputError


@contextmanager
def denoiser(threads: int | None = None) -> Iterator[Callable[..., NDArray[np.float32]]]:
    """What takes noise from an (H, W, 3) image `color`, on the CPU; what it returns is at least 0.

    `color` alone is a lightmap (filter RTLightmap). With `albedo` and `normal` of what each pixel sees first, without
    noise, it is a linear picture (filter RT). threads: None = every core. Raises InputError without the package pyoidn,
    AtraError if denoising fails.
    """
    try:
        import pyoidn
    except ImportError:
        raise InputError(
            "denoising needs the package pyoidn, which is not installed; run: pip install -e '.[denoise]'"
        ) from None
    device = pyoidn.Device()
    device.set_int("numThreads", resolve_threads(threads))
    device.set_bool("setAffinity", False)
    device.commit()

    def filtered(**given: NDArray[np.floating]) -> NDArray[np.float32]:
        images = {name: np.ascontiguousarray(image, np.float32) for name, image in given.items()}
        out = np.empty_like(images["color"])
        is_lightmap = len(given) == 1
        kind = pyoidn.OIDN_FILTER_TYPE_RT_LIGHTMAP if is_lightmap else pyoidn.OIDN_FILTER_TYPE_RT
        with pyoidn.Filter(device, kind) as one:
            for name, image in (images | {"output": out}).items():
                one.set_image(getattr(pyoidn, f"OIDN_IMAGE_{name.upper()}"), image, pyoidn.OIDN_FORMAT_FLOAT3)
            for switch in () if is_lightmap else ("hdr", "cleanAux"):
                one.set_bool(switch, True)
            one.commit()
            one.execute()
        problem = device.get_error()
        if problem is not None:
            size = f"{out.shape[1]} x {out.shape[0]}"
            raise AtraError(f"Open Image Denoise failed at an image of {size}: {problem}")
        return np.maximum(out, 0.0)

    with device:
        yield filtered


def check_denoiser() -> None:
    """Raise InputError without the package pyoidn: to be called before work whose result is to be denoised."""
    with denoiser(1):
        pass
