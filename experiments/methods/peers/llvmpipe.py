"""Peer `llvmpipe`: Mesa's software rasteriser, through OpenGL."""

from __future__ import annotations

import ctypes
import os
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.geometry.view import View
from atra.prim_ids import MISS
from experiments.methods.peers.peer import PreparedPeer, peer_method

_EGL = "libEGL.so.1"
_DEBIAN = "Debian's libegl1 libgl1-mesa-dri libgles2"

_NEAREST = 1e-6
"""Near plane, as a fraction of the distance to the mesh's farthest corner; OpenGL needs one in front of the eye."""

# Numbers of the OpenGL registry, for three calls that moderngl has not.
_LOWER_LEFT, _ZERO_TO_ONE, _RENDERBUFFER, _DEPTH_32F = 0x8CA1, 0x935F, 0x8D41, 0x8CAC

_VERTEX_SHADER = """
#version 450
in vec3 position;
uniform mat4 to_clip;
uniform vec4 to_depth;
out float depth;
void main() {
    gl_Position = to_clip * vec4(position, 1.0);
    depth = dot(to_depth, vec4(position, 1.0));
}
"""

_FRAGMENT_SHADER = """
#version 450
in float depth;
layout(location = 0) out uint prim_id;
layout(location = 1) out float hit_depth;
void main() {
    prim_id = uint(gl_PrimitiveID);
    hit_depth = depth;
}
"""


@dataclass(frozen=True, eq=False)
class _Drawing:
    """What OpenGL holds, and the images it is read into: prim_id (H, W) uint32, depth (H, W) float32."""

    context: Any
    framebuffer: Any
    prim_ids: Any
    triangles: Any
    misses: bytes

    def release(self) -> None:
        self.context.gc_mode = "context_gc"
        self.context.release()


class PreparedLlvmpipe(PreparedPeer):
    """Triangles drawn by llvmpipe: `gl_PrimitiveID` to R32UI, depth along the view axis as a varying to R32F.

    Timed: clearing, drawing with a depth buffer of 32-bit floats, nearer ones larger, and reading both images
    back. The corners are rounded to float32 relative to the eye, and to 1/256 pixel by the rasteriser, so outlines are
    not exact, nor are depths, which it interpolates in float32; what is nearer to the eye than a millionth of the
    mesh's distance is cut away. No BVH is built; the build hands over the triangles and compiles the shaders.
    `LP_NUM_THREADS` says how many threads draw: with one it is the calling one. Mesa reads it when a context is made.
    """

    package = "moderngl"
    interface = "OpenGL 4.5 by moderngl: draw, read back"
    setting = "corners rounded to 1/256 pixel"
    rays_per_packet = 0

    def _rays_through(self, offset: tuple[float, float]) -> NDArray[np.float64]:
        """(5, 4): clip coordinates of points relative to the eye, then their depth."""
        camera = self.camera
        size = np.array([camera.width, camera.height])
        a, b, w = camera.to_pixels
        # A sample of OpenGL is the centre of its pixel; rows from below are rows from above, as it is read.
        x, y = (2.0 * (row + (0.5 - of) * w) / pixels - w for row, of, pixels in zip((a, b), offset, size, strict=True))
        depth = np.append(camera.axes[2], 0.0)
        corners = np.array(np.meshgrid(*(self.mesh.bounds - camera.eye).T)).reshape(3, -1)
        farthest = float(np.linalg.norm(corners, axis=0).max())
        nearer = w - depth / farthest if camera.is_parallel else np.array([0.0, 0.0, 0.0, _NEAREST * farthest])
        return np.stack([x, y, nearer, w, depth])

    def _build_scene(self) -> _Drawing:
        context = opengl_context(self.threads)
        context.enable(context.DEPTH_TEST)
        context.depth_func = ">"
        size = self.camera.width, self.camera.height
        prim_ids = context.texture(size, 1, dtype="u4")
        depths = context.texture(size, 1, dtype="f4")
        nearest = context.depth_renderbuffer(size)
        _gl("glBindRenderbuffer", _RENDERBUFFER, nearest.glo)
        _gl("glRenderbufferStorage", _RENDERBUFFER, _DEPTH_32F, *size)  # moderngl's own has 24 bits, evenly spaced
        _gl("glClipControl", _LOWER_LEFT, _ZERO_TO_ONE)
        framebuffer = context.framebuffer([prim_ids, depths], nearest)
        program = context.program(_VERTEX_SHADER, _FRAGMENT_SHADER)
        relative = (self.mesh.vertices - np.asarray(self.camera.eye)).astype(np.float32)
        triangles = context.vertex_array(
            program, [(context.buffer(relative), "3f", "position")], context.buffer(self.mesh.faces)
        )
        return _Drawing(context, framebuffer, prim_ids, triangles, MISS.tobytes() * (size[0] * size[1]))

    def still_serves(self, camera: View) -> bool:
        """Never: corners are relative to the eye, and images have the camera's size."""
        return False

    def _warm_up(self) -> None:
        """Draw once, as Mesa compiles some of the shaders only then."""
        self._cast(self._scene, self._rays)

    def _cast(self, scene: _Drawing, rays: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
        program, framebuffer = scene.triangles.program, scene.framebuffer
        program["to_clip"].write(np.ascontiguousarray(rays[:4].T, np.float32))
        program["to_depth"].write(rays[4].astype(np.float32))
        framebuffer.use()
        framebuffer.clear(red=np.inf, depth=0.0)
        scene.prim_ids.write(scene.misses)  # the colour it was cleared with is no whole number
        scene.triangles.render()
        shape = self.camera.height, self.camera.width
        depth, prim_id = np.empty(shape, np.float32), np.empty(shape, np.uint32)
        framebuffer.read_into(prim_id, components=1, attachment=0, dtype="u4")
        framebuffer.read_into(depth, components=1, attachment=1, dtype="f4")
        return depth, prim_id

    def close(self) -> None:
        """Let go of OpenGL's context."""
        self._scene.release()


def opengl_context(threads: int) -> Any:
    """A context of Mesa's llvmpipe, with so many threads."""
    os.environ["LP_NUM_THREADS"] = "0" if threads == 1 else str(threads)
    return import_module("moderngl").create_context(
        require=450, standalone=True, backend="egl", libgl=_EGL, libegl=_EGL
    )


def _gl(name: str, *values: int) -> None:
    """Call a function of OpenGL that takes whole numbers and returns nothing."""
    find = ctypes.CDLL(_EGL).eglGetProcAddress
    find.restype = ctypes.c_void_p
    ctypes.CFUNCTYPE(None, *[ctypes.c_uint] * len(values))(find(name.encode()))(*values)


def _check() -> str | None:
    import_module("moderngl")
    try:
        context = opengl_context(1)
    except Exception as error:  # moderngl raises nothing narrower
        return f"moderngl gets no OpenGL 4.5 through EGL ({' '.join(str(error).split())}); install {_DEBIAN}"
    renderer = context.info["GL_RENDERER"]
    context.release()
    if not renderer.startswith("llvmpipe"):
        return f"OpenGL is {renderer}, not llvmpipe; set LIBGL_ALWAYS_SOFTWARE=1 where Mesa is installed ({_DEBIAN})"
    return None


LLVMPIPE = peer_method("llvmpipe", "llvmpipe", _check, PreparedLlvmpipe)
