"""Packets per pixel over a BVH of the world, which serves every eye; rays start at the eye, rounded to float32."""

from __future__ import annotations

from dataclasses import replace

from atra.geometry.view import View
from atra.packets.pixel import PixelTracer
from atra.tracing.base import Views
from atra.tracing.geometry import AlignedGeometry, plan_plain_geometry


class KeptPackets(PixelTracer):
    """Another camera costs nothing. Not as exact as `PixelTracer`: docs/methods.md says why. The view must be wide
    enough for rays in the world's axes."""

    def _plan_geometry(self) -> AlignedGeometry:
        forward = tuple(self.camera.axes[2].tolist())
        return plan_plain_geometry(self.mesh, replace(self.camera, eye=(0.0, 0.0, 0.0), target=forward))  # type: ignore[type-var]

    def _show_views(self, views: Views) -> None:
        super()._show_views(views)
        for workspace in self._workspaces:
            workspace.set_origin(self.camera.eye)

    def _look(self, camera: View) -> bool:
        self._show(self.mesh, camera)
        if self._is_built:
            self._plan_ties()
        return True
