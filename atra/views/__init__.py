"""Many views of one mesh, here or by any executor."""
