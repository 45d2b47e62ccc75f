"""Lens models: where directions are seen on a sensor, and the exact inverse."""
