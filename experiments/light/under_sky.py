"""The sky of a scene as options of a workload."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path

from atra.errors import InputError
from atra.light import PanoramaSky, Scene
from experiments.harness.options import Settings, option


@dataclass(frozen=True)
class UnderSky(Settings):
    """Options of a workload whose scene a file may light.

    sky_sha256 is computed: a changed file makes another point. Raises InputError for a file that cannot be read or that
    changed since the run began.
    """

    sky: str | None = option(None, "an EXR or Radiance HDR all around, in place of the scene's own sky", null="own")
    sky_sha256: str | None = option(None, "hash of that file, which is found and not set", null="own")
    robust_rays: bool = option(
        True, "no ray slips through between two triangles; off: Embree's fast setting, as in the paper"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.sky is None:
            if self.sky_sha256 is not None:
                raise InputError(f"workload.sky_sha256 is {self.sky_sha256!r} without a workload.sky, expected null")
            return
        path = Path(self.sky).expanduser().resolve()
        try:
            found = hashlib.sha256(path.read_bytes()).hexdigest()
        except OSError as error:
            raise InputError(f"workload.sky is {str(path)!r}, which cannot be read: {error.strerror}") from None
        if self.sky_sha256 not in (None, found):
            raise InputError(f"the sky {str(path)!r} changed since this run began; start it again")
        object.__setattr__(self, "sky", str(path))
        object.__setattr__(self, "sky_sha256", found)

    def under_sky(self, scene: Scene) -> Scene:
        """The scene with that sky, if there is one. Raises InputError for a file that holds none."""
        return scene if self.sky is None else replace(scene, sky=PanoramaSky.load(self.sky))
