"""`python -m eqs` is the command `eqs`."""

from eqs.commands import main

main()
