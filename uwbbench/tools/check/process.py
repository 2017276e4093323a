"""Results computed in a new process with another hash seed, as the hash of each."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from uwbbench.api.case import last_line
from uwbbench.tools.check.subject import Subject

HASH_SEED = "20251201"


def digests_elsewhere(subjects: Sequence[Subject]) -> list[str]:
    """Hash of each subject's result, computed in one new process; the reason where there is none.

    Raises
    ------
    RuntimeError
        If that process broke down.
    """
    wanted = [[one.kind, one.name, one.given, [str(root) for root in one.roots]] for one in subjects]
    environment = {**os.environ, "PYTHONHASHSEED": HASH_SEED, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-m", "uwbbench.tools.check.process"]
    done = subprocess.run(  # noqa: S603 - our own module, with this interpreter
        command, input=json.dumps(wanted), capture_output=True, text=True, check=False, env=environment
    )
    if done.returncode:
        raise RuntimeError(f"the other process broke down: {done.stderr.strip().rpartition(chr(10))[2]}")
    digests: list[str] = json.loads(done.stdout.rpartition("\n")[2])
    return digests


def _main() -> None:
    from uwbbench.tools.check.suite import subject_of

    digests = []
    for kind, name, params, roots in json.loads(sys.stdin.read()):
        try:
            digests.append(subject_of(kind, name, params, tuple(map(Path, roots))).digest)
        except BaseException as error:  # noqa: BLE001 - a plugin may raise anything, and this process is for it alone
            digests.append(last_line(error))
    sys.stdout.write("\n" + json.dumps(digests))  # on a line of its own, whatever a plugin has printed


if __name__ == "__main__":
    _main()
