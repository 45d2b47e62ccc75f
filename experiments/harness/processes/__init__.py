"""The process that measures a point: how it is started, what runs in it, and what it hands back."""
