"""Light that is found once and used for more than one pixel, or for more than one picture."""
