"""Memory layout of triangles: blocks of four."""

BLOCK = 4
"""Triangles that a single ray tests at once. Unused entries hold NaN, which no ray hits."""

BLOCK_BYTES = 40 * BLOCK
"""A block: x, y, z of the first, second and third corners, then prim_ids, four triangles side by side. It stores
corners rather than edges, so that neighbours share the same numbers and no ray slips through between them."""

IDS = 36 * BLOCK
"""Byte offset of a block's prim_ids."""

DEEPEST = 60
"""Maximum depth of a tree; deeper subtrees become large leaves."""
