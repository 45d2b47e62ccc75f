"""Files: where they are written, what one that is read may cost, and how images are saved."""
