"""Mutations of the library outside of compiled kernels."""

from tests.mutations.mutation import Mutation

LIBRARY = (
    Mutation(
        "finite_vertices",
        "atra/geometry/mesh.py",
        "good = np.abs(vertices.astype(np.float64)) <= _LARGEST_COORDINATE",
        "good = ~(np.abs(vertices.astype(np.float64)) > _LARGEST_COORDINATE)",
        "a mesh may hold vertices that are NaN",
        ("tests/geometry/test_mesh.py::test_a_vertex_that_cannot_be_traced_is_refused_naming_its_index_and_value",),
    ),
    Mutation(
        "split_of_rows",
        "atra/geometry/split.py",
        "if self.width % self.nx or self.height % self.ny:",
        "if self.width % self.nx:",
        "a split whose rows do not divide the image is accepted",
        ("tests/alignment/test_alignment.py::test_a_split_that_does_not_divide_the_image_is_refused_with_both_values",),
    ),
    Mutation(
        "tracer_lock",
        "atra/tracing/lifetime.py",
        "threading.RLock()",
        '__import__("contextlib").nullcontext()',
        "a tracer takes no lock, so it may be closed during a frame",
        ("tests/tracing/test_lifetimes.py::test_closing_waits_for_the_frame_in_progress[pixels]",),
    ),
    Mutation(
        "exr_channels",
        "atra/files/saving.py",
        '("N.X", "N.Y", "N.Z")',
        '("N.Y", "N.X", "N.Z")',
        "x and y of normals are swapped in EXR files",
        ("tests/exact/test_hits.py::test_an_image_is_saved_as_channels_of_an_exr",),
    ),
    Mutation(
        "colmap_rotation",
        "atra/files/cameras/colmap.py",
        "2 * (x * y - w * z)",
        "2 * (x * y + w * z)",
        "cameras of COLMAP models are turned wrongly",
        ("tests/files/test_camera_files.py::test_a_colmap_model_is_read_back_in_its_order",),
    ),
    Mutation(
        "damaged_kernel",
        "atra/compiled/store.py",
        "if sha256(code).digest() != digest:",
        "if False:",
        "compiled code that was damaged on disk is run",
        ("tests/compiled/test_kernel_cache.py::test_damaged_files_are_compiled_anew_and_replaced",),
    ),
    Mutation(
        "message_without_value",
        "atra/geometry/mesh.py",
        'f"face {face} names vertex {faces[face, corner]}, but',
        'f"face {corner} names vertex {faces[face, corner]}, but',
        "the error of a face with a wrong vertex names another face",
        ("tests/geometry/test_mesh.py::test_arrays_that_are_no_mesh_are_refused_naming_what_is_wrong",),
    ),
)
