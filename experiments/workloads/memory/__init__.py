"""Memory of one method alone."""
