"""Rays that come from no camera, in batches: what they hit first, and whether they hit anything."""
