"""What shines by itself and is aimed at: emissive triangles and the texels of a panorama."""
