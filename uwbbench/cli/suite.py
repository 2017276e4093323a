"""Commands about suites: ``freeze`` their captures, and draw the ``seeds`` of a private half."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from uwbbench.api.text import counted
from uwbbench.cli import options


def freeze(
    suite: Annotated[str, typer.Argument(metavar="SUITE", help="Experiment: a YAML file or a shipped name.")],
    data_dir: options.DataDir = None,
) -> None:
    """Freeze the captures and rules of an experiment: a suite.

    Writes NAME.lock.json beside the file: the hash of every capture and a version made of these and of the scoring
    rules. From then on, a run of it stops at a capture that was changed. Freezing it again makes another version.
    """
    from uwbbench.api.locate import find_config
    from uwbbench.run.freeze import freeze as frozen
    from uwbbench.run.suite import read_frozen

    before = read_frozen(find_config("experiments", suite))
    after = frozen(suite, data_dir, lambda label: typer.echo(f"opening the captures of {label}", err=True))
    count = sum(map(len, after.captures.values()))
    if before is None or before.version == after.version:
        said = "is frozen as" if before is None else "is still"
        typer.echo(f"{after.name} {said} version {after.version[:12]}: {counted(count, 'capture')}, {after.path}")
        return
    old, new = before.contents(), after.contents()
    changed = sum(old.get(label, {}).get(name) != sha for label, of in new.items() for name, sha in of.items())
    typer.echo(
        f"{after.name} is now version {after.version[:12]}, before {before.version[:12]}: {changed} of {count} "
        f"captures are new or changed{'' if changed else ', the scoring rules are'}; {after.path}"
    )


def seeds(
    path: Annotated[Path, typer.Argument(metavar="FILE", help="File to write; it must not exist.")],
) -> None:
    """Draw the secret seeds of a private half.

    Writes a file that only you may read. 'uwbbench run SUITE --seeds FILE' then runs the suite's scenes on captures
    that nobody else can draw; its run folder holds the hash of the seeds and nothing else of them.
    """
    from uwbbench.config.seeds import write_seeds

    typer.echo(f"seeds {write_seeds(path).sha256[:12]} written to {path}; keep the file, and keep it to yourself")


def register(app: typer.Typer) -> None:
    """Add these commands."""
    app.command(epilog="Example: uwbbench freeze configs/suites/robot-1.yaml")(freeze)
    app.command(epilog="Example: uwbbench seeds robot-1.seeds")(seeds)
