"""What light costs, a wing: aligned rays from the tiles of a lightmap to the sun, beside packets and single rays."""
