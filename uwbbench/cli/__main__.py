"""``python -m uwbbench.cli``: the same as the ``uwbbench`` command."""

from uwbbench.cli import main

main()
