"""`python -m atra.command`: what the console command does."""

from atra.command.main import main

if __name__ == "__main__":
    raise SystemExit(main())
