"""`python -m deploy` is `tandem`."""

from deploy.cli import main

main()
