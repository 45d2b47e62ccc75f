"""Peer `llvmpipe`: Mesa's software rasteriser, through OpenGL."""

from __future__ import annotations

import ctypes
import os
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.prim_ids import MISS
from experiments.methods.peers.peer import Answer, PeerScene, peer_method

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


class LlvmpipeScene(PeerScene):
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
    follows = False

    def __init__(self, mesh: Mesh, camera: View, threads: int) -> None:
        self._mesh, self._context = mesh, opengl_context(threads)
        context, self._size = self._context, (camera.width, camera.height)
        context.enable(context.DEPTH_TEST)
        context.depth_func = ">"
        self._prim_ids = context.texture(self._size, 1, dtype="u4")
        depths = context.texture(self._size, 1, dtype="f4")
        nearest = context.depth_renderbuffer(self._size)
        _gl("glBindRenderbuffer", _RENDERBUFFER, nearest.glo)
        _gl("glRenderbufferStorage", _RENDERBUFFER, _DEPTH_32F, *self._size)  # moderngl's has 24 bits, evenly spaced
        _gl("glClipControl", _LOWER_LEFT, _ZERO_TO_ONE)
        self._framebuffer = context.framebuffer([self._prim_ids, depths], nearest)
        self._program = context.program(_VERTEX_SHADER, _FRAGMENT_SHADER)
        relative = (mesh.vertices - np.asarray(camera.eye)).astype(np.float32)
        self._triangles = context.vertex_array(
            self._program, [(context.buffer(relative), "3f", "position")], context.buffer(mesh.faces)
        )
        self._misses = MISS.tobytes() * (self._size[0] * self._size[1])

    def rays_through(self, camera: View, offset: tuple[float, float], order: NDArray[np.int64]) -> NDArray[np.float64]:
        """(5, 4): clip coordinates of points relative to the eye, then their depth."""
        a, b, w = camera.to_pixels
        # A sample of OpenGL is the centre of its pixel; rows from below are rows from above, as it is read.
        sides = zip((a, b), offset, self._size, strict=True)
        x, y = (2.0 * (row + (0.5 - of) * w) / pixels - w for row, of, pixels in sides)
        depth = np.append(camera.axes[2], 0.0)
        corners = np.array(np.meshgrid(*(self._mesh.bounds - camera.eye).T)).reshape(3, -1)
        farthest = float(np.linalg.norm(corners, axis=0).max())
        nearer = w - depth / farthest if camera.is_parallel else np.array([0.0, 0.0, 0.0, _NEAREST * farthest])
        return np.stack([x, y, nearer, w, depth])

    def warm_up(self, rays: NDArray[np.float64]) -> None:
        """Draw once, as Mesa compiles some of the shaders only then."""
        self.cast(rays)

    def cast(self, rays: NDArray[np.float64]) -> Answer:
        """Both images. rays: as of `rays_through`."""
        program, framebuffer = self._program, self._framebuffer
        program["to_clip"].write(np.ascontiguousarray(rays[:4].T, np.float32))
        program["to_depth"].write(rays[4].astype(np.float32))
        framebuffer.use()
        framebuffer.clear(red=np.inf, depth=0.0)
        self._prim_ids.write(self._misses)  # the colour it was cleared with is no whole number
        self._triangles.render()
        shape = self._size[::-1]
        depth, prim_id = np.empty(shape, np.float32), np.empty(shape, np.uint32)
        framebuffer.read_into(prim_id, components=1, attachment=0, dtype="u4")
        framebuffer.read_into(depth, components=1, attachment=1, dtype="f4")
        return depth, prim_id

    def close(self) -> None:
        """Let go of OpenGL's context."""
        self._context.gc_mode = "context_gc"
        self._context.release()


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


LLVMPIPE = peer_method("llvmpipe", "llvmpipe", _check, LlvmpipeScene)
