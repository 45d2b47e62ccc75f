"""What all tracers share, whatever finds their hits."""
