"""Pictures on top of primary visibility: hybrid rendering and path tracing."""
