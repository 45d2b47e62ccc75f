"""Tracers of others, and of methods that bring their own: one mesh and one camera, behind the interface of `Tracer`."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping

from atra.geometry.mesh import Mesh
from atra.geometry.view import View, check_offset
from atra.hits import Hits
from atra.tracing.budgets import check_image_memory
from atra.tracing.lifetime import Lifetime, check_same_faces, synchronized


class OneViewTracer(Lifetime):
    """A tracer of one mesh for one camera that builds and traces by itself, as `atra.Tracer` does by a method."""

    mesh: Mesh
    camera: View

    @abstractmethod
    def _trace(self, offset: tuple[float, float], out: Hits | None) -> Hits:
        """One frame, while nothing else happens. out: an earlier result that may be overwritten."""

    def _show(self, mesh: Mesh, camera: View) -> None:
        """Take mesh and camera; changes nothing where they are refused."""
        check_image_memory(camera.height, camera.width)
        self.mesh, self.camera = mesh, camera

    def _still_serves(self, before: View) -> bool:
        """Whether what is built for the camera before serves the one just taken."""
        return False

    def trace(self, offset: tuple[float, float] = (0.5, 0.5), out: Hits | None = None) -> Hits:
        """As `atra.Tracer.trace`."""
        check_offset(offset)
        with self._in_use():
            return self._trace(offset, out)

    @synchronized
    def look(self, camera: View) -> None:
        """As `atra.Tracer.look`."""
        self._check_open()
        before = self.camera
        self._show(self.mesh, camera)
        if self._is_built and not self._still_serves(before):
            self.build()

    @synchronized
    def update(self, mesh: Mesh) -> None:
        """As `atra.Tracer.update`."""
        self._check_open()
        check_same_faces(self.mesh, mesh)
        self._show(mesh, self.camera)
        if self._is_built:
            self.build()

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
