"""Charts of a mesh: where its triangles lie on a map, and which texels belong to them."""
