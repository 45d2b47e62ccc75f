"""Nearest hits of rays, and whether they hit anything, decided without rounding by a tree of our own."""
