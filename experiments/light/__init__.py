"""What light costs, a wing: aligned rays from the tiles of a lightmap to the sun, beside packets and single rays."""

ROBUST = "no ray slips through between two triangles; off: Embree's fast setting, as in the paper"
"""Help of the option `robust_rays`."""
