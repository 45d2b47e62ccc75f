"""Judging images in float64: comparison by pixel, reference, oracle."""
