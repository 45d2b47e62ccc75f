"""Many views of one mesh, traced in this process or by any executor."""
