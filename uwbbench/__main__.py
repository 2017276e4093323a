"""``python -m uwbbench``: the same as the ``uwbbench`` command."""

from uwbbench.cli import main

main()
