"""The console command `atra`."""
