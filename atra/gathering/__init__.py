"""All hits along the rays of an image: what is gathered of them, and what that results in."""
