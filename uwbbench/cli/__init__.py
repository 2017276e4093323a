"""The ``uwbbench`` command: one function a command, and what the shell sees when something is wrong.

Exit codes: 0 fine; 1 a check failed; 2 a wrong option, file or configuration; 3 some units of a run failed;
130 interrupted. Heavy libraries are imported inside the commands that need them, so that help and lists are instant.
"""

from __future__ import annotations

import os
import sys
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

import uwbbench
from uwbbench.api.errors import UwbbenchError
from uwbbench.cli import (
    calibrate,
    data,
    evaluate,
    export,
    fit,
    gate,
    inspection,
    leaderboard,
    plot,
    runs,
    scaffold,
    simulate,
    stability,
    suite,
    time,
    train,
    tune,
    warmup,
)
from uwbbench.cli.exit_codes import INTERRUPTED, USAGE_ERROR


class _Commands(TyperGroup):
    """All commands, with one way for mistakes to reach the user: a message on stderr and an exit code."""

    def invoke(self, ctx: Any) -> Any:
        try:
            result = super().invoke(ctx)
            sys.stdout.flush()
        except UwbbenchError as error:
            typer.echo(f"error: {error}", err=True)
            raise typer.Exit(USAGE_ERROR) from error
        except SystemExit as stop:  # none of the commands ends so
            typer.echo(f"error: a plugin has asked the program to end (SystemExit: {stop.code})", err=True)
            raise typer.Exit(USAGE_ERROR) from stop
        except KeyboardInterrupt as stop:
            typer.echo("interrupted", err=True)
            raise typer.Exit(INTERRUPTED) from stop
        except BrokenPipeError:  # the reader, such as `head`, has all it wants
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return None
        except OSError as error:  # stdout on a full disk; files have messages of their own
            typer.echo(f"error: the output cannot be written: {error.strerror or error}", err=True)
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise typer.Exit(USAGE_ERROR) from error
        return result


app = typer.Typer(
    cls=_Commands,
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    epilog="First steps: uwbbench run configs/experiments/demo.yaml --out demo",
)


def _show_version(asked: bool) -> None:
    if asked:
        typer.echo(f"uwbbench {uwbbench.__version__}")
        raise typer.Exit


@app.callback()
def _start(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and leave.")
    ] = False,
) -> None:
    """Benchmark UWB radar detectors: the same captures, the same metrics, speed against error."""


for _group in (
    runs,
    evaluate,
    calibrate,
    time,
    tune,
    train,
    fit,
    gate,
    inspection,
    data,
    simulate,
    stability,
    scaffold,
    plot,
    export,
    warmup,
    leaderboard,
    suite,
):
    _group.register(app)


def main() -> None:
    """Run the command line."""
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]  # file names need not be valid text
    app(prog_name="uwbbench")
