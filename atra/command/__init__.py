"""The console command `atra`: a program around the library, which knows nothing of it."""
