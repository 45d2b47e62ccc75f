"""What can be measured: our own methods and other people's ray tracers."""
