"""A wheel that brings compiled kernels along is one for this system alone, and says so in its name."""

from __future__ import annotations

import sys
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

SHIPPED = "atra/compiled/shipped"
"""Where `.ci/kernels` has kernels compiled to; `atra.compiled.store` reads them there."""


class CustomBuildHook(BuildHookInterface[Any]):
    """Adds the kernels, which git ignores, and the tag of the system and of the Python that has compiled them."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called before the files are gathered. version: "editable" for an install of a clone."""
        if version == "standard" and (Path(self.root) / SHIPPED).is_dir():
            platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
            platform = platform.replace("linux_", "manylinux_2_28_", 1)  # nothing in it is linked to a C library
            build_data["tag"] = f"cp{sys.version_info.major}{sys.version_info.minor}-none-{platform}"
            build_data["pure_python"] = False
            build_data["artifacts"].append(f"{SHIPPED}/**")
