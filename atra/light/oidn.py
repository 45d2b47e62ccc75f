"""Intel Open Image Denoise (https://www.openimagedenoise.org), by the package pyoidn."""

from __future__ import annotations

from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import resolve_threads
from atra.errors import AtraError, InputError


class Denoiser:
    """A denoiser on the CPU, for use in `with`. threads: None = every core. Raises InputError without the package
    pyoidn."""

    def __init__(self, threads: int | None = None) -> None:
        try:
            import pyoidn
        except ImportError:
            raise InputError(
                "denoising needs the package pyoidn, which is not installed; run: pip install -e '.[denoise]'"
            ) from None
        self._oidn: Any = pyoidn
        self._device = pyoidn.Device()
        self._device.set_int("numThreads", resolve_threads(threads))
        self._device.set_bool("setAffinity", False)
        self._device.commit()

    def lightmap(self, image: NDArray[np.floating]) -> NDArray[np.float32]:
        """An (H, W, 3) lightmap without its noise (filter RTLightmap), at least 0. Raises AtraError if it fails."""
        return self._filtered(self._oidn.OIDN_FILTER_TYPE_RT_LIGHTMAP, {"color": image}, ())

    def picture(
        self, image: NDArray[np.floating], albedo: NDArray[np.floating], normals: NDArray[np.floating]
    ) -> NDArray[np.float32]:
        """An (H, W, 3) linear picture without its noise (filter RT), at least 0.

        albedo, normals: (H, W, 3) of what each pixel sees first, without noise. Raises AtraError if it fails.
        """
        images = {"color": image, "albedo": albedo, "normal": normals}
        return self._filtered(self._oidn.OIDN_FILTER_TYPE_RT, images, ("hdr", "cleanAux"))

    def _filtered(self, kind: Any, images: dict[str, Any], switches: tuple[str, ...]) -> NDArray[np.float32]:
        images = {name: np.ascontiguousarray(image, np.float32) for name, image in images.items()}
        out = np.empty_like(images["color"])
        with self._oidn.Filter(self._device, kind) as one:
            for name, image in (images | {"output": out}).items():
                one.set_image(getattr(self._oidn, f"OIDN_IMAGE_{name.upper()}"), image, self._oidn.OIDN_FORMAT_FLOAT3)
            for switch in switches:
                one.set_bool(switch, True)
            one.commit()
            one.execute()
        problem = self._device.get_error()
        if problem is not None:
            size = f"{out.shape[1]} x {out.shape[0]}"
            raise AtraError(f"Open Image Denoise failed at an image of {size}: {problem}")
        return np.maximum(out, 0.0)

    def __enter__(self) -> Self:
        self._device.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._device.__exit__(kind, error, trace)


def check_denoiser() -> None:
    """Raise InputError without the package pyoidn: to be called before work whose result is to be denoised."""
    with Denoiser(1):
        pass
