"""Charts of a mesh: where its triangles lie in a map, which texels they have, and seams between them."""
