"""`python -m wetwell.services` is the command `wetwell`."""

from wetwell.services.cli import main

main()
