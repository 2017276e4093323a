"""How long the commands that only list and explain take to start, and that they import no scientific module.

Run through ``python tests/bench/run.py startup``.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from functools import partial
from time import perf_counter

import numpy as np
from harness import Disagreement, Effort, Row, at_most, interleaved, ratio

LIMIT = 0.26
"""0.35 s where a bare interpreter takes 0.01 s and scikit-learn 1.3 s."""
COMMANDS = (("--help",), ("list",))
HEAVY = ("numpy", "numba", "scipy", "sklearn", "pandas", "matplotlib", "h5py", "pyarrow")
_TOLD = """
import json, sys
from uwbbench.cli import main
sys.argv[0] = "uwbbench"
try:
    main()
finally:
    sys.stderr.write(json.dumps(sorted(sys.modules)))
"""


def rows(effort: Effort) -> Iterator[Row]:
    """All targets of this module."""
    for arguments in COMMANDS:
        check_imports(arguments)
    python = [sys.executable, "-c"]
    contenders = {"bare": [*python, "pass"], "scikit-learn": [*python, "import sklearn.cluster"]}
    contenders |= {arguments[0]: [sys.executable, "-m", "uwbbench.cli", *arguments] for arguments in COMMANDS}
    spent = interleaved(
        {name: partial(_started, command) for name, command in contenders.items()},
        effort.rounds(11),
        clock=perf_counter,
    )
    extra = {name: times - spent["bare"] for name, times in spent.items()}
    for arguments in COMMANDS:
        name = arguments[0]
        seconds = f"{np.median(extra[name]):.2g} s, scikit-learn {np.median(extra['scikit-learn']):.2g} s"
        note = f"beyond a bare interpreter: {seconds}; no scientific module imported"
        yield at_most(
            f"uwbbench {name} / import of scikit-learn", LIMIT, ratio(extra[name], extra["scikit-learn"]), note=note
        )


def check_imports(arguments: Sequence[str]) -> None:
    """Refuse to time a command that imports what it does not need.

    Raises
    ------
    Disagreement
    """
    command = [sys.executable, "-c", _TOLD, *arguments]
    answer = subprocess.run(command, check=True, capture_output=True, text=True)
    roots = {name.partition(".")[0] for name in json.loads(answer.stderr.splitlines()[-1])}
    if found := sorted(roots.intersection(HEAVY)):
        raise Disagreement(f"uwbbench {' '.join(arguments)} imports {', '.join(found)}")


def _started(command: list[str]) -> partial[object]:
    return partial(subprocess.run, command, check=True, stdout=subprocess.DEVNULL)
