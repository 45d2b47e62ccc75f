"""What all tracers of others have in common: one mesh, one camera, and no account of their memory."""

from __future__ import annotations

from collections.abc import Mapping

from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.hits import Hits
from atra.tracing.budgets import check_image_memory
from atra.tracing.lifetime import TracerLifetime


class OneViewTracer(TracerLifetime[Hits]):
    """A tracer of one mesh for one camera."""

    def _show(self, mesh: Mesh, camera: View) -> None:
        check_image_memory(camera.height, camera.width)
        self.mesh, self.camera = mesh, camera

    @property
    def triangle_count(self) -> int:
        """Triangles of the mesh."""
        return self.mesh.triangle_count

    @property
    def embree_bytes(self) -> int:
        """0: nobody tells."""
        return 0

    @property
    def counters(self) -> Mapping[str, float]:
        """Triangles traced; see `atra.Tracer`."""
        return {"triangles_traced": self.triangle_count}

    @property
    def views(self) -> tuple[tuple[Mesh, View], ...]:
        """The one mesh and camera."""
        return ((self.mesh, self.camera),)
