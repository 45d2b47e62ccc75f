"""Rays per pixel in Embree's packets, and all of their hits by a filter."""
