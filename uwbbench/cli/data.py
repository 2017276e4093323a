"""Commands about data: ``convert`` recordings into capture files, ``fetch`` published datasets."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from uwbbench.api.errors import ConfigError, nearest
from uwbbench.cli import options

if TYPE_CHECKING:
    from uwbbench.api.capture import Capture
    from uwbbench.api.dataset import Dataset


def convert(
    source: Annotated[Path, typer.Argument(metavar="SOURCE", help="Recording: a file, or the folder that holds it.")],
    dataset: Annotated[str, typer.Option("--dataset", metavar="NAME", help="Adapter that reads it.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE.h5", help="Capture file to write.")],
    capture: Annotated[str | None, typer.Option(metavar="NAME", help="Only this capture.", show_default=False)] = None,
    settings: options.Settings = None,
) -> None:
    """Convert a recording into a capture file.

    The receivers of one run share the file. Several runs get a file each, FILE-NAME.h5; --capture chooses one.
    """
    from uwbbench.api.capture_writing import write_capture

    options.format_of(output, ".h5")
    opened = _open(source, dataset, settings)
    names = opened.names()
    if capture is not None and capture not in names:
        raise ConfigError(f"{source}: no capture '{capture}'.{nearest(capture, names)}")
    runs: dict[str, list[Capture]] = {}
    for name in [capture] if capture is not None else names:
        recorded = opened.open(name)
        runs.setdefault(_run_of(name, recorded), []).append(recorded)
    for run, captures in runs.items():
        path = output if len(runs) == 1 else output.with_name(f"{output.stem}-{_file_part(run)}{output.suffix}")
        if len(captures) > 1:
            captures = [replace(recorded, name=run or path.stem) for recorded in captures]
        write_capture(path, *captures)
        for recorded in captures:
            label = "simulated capture" if recorded.source == "simulated" else "capture"
            size = f"{len(recorded)} frames of {recorded.radar.taps} taps"
            size += ", with background" if recorded.background is not None else ""
            receiver = f", receiver '{recorded.radar.receiver}'" if len(captures) > 1 else ""
            typer.echo(f"{label} '{recorded.name}'{receiver}, {size}, written to {path}", err=True)


def _run_of(name: str, capture: Capture) -> str:
    """What the captures of one run, which share a file, have in common: their names without the receiver."""
    run, _, last = name.rpartition("/")
    return run if last == capture.radar.receiver else name


def _file_part(name: str) -> str:
    """Name with nothing in it that a file name cannot hold."""
    return re.sub(r"[^\w.-]+", "-", name)[:100]


def _open(source: Path, name: str, settings: list[str] | None) -> Dataset[Any]:
    """Adapter that reads a recording from its own folder and nowhere else."""
    from uwbbench.api import registry
    from uwbbench.api.override import parse_settings
    from uwbbench.config.source import open_dataset

    if not source.exists():
        raise ConfigError(f"{source}: no such file or folder")
    folder = source.resolve() if source.is_dir() else source.resolve().parent
    params = parse_settings(settings or ())
    if source.is_file():
        adapter = registry.load_plugin("datasets", name)
        fields = adapter.params_type().model_fields
        if "mapping" in fields and source.suffix in (".yaml", ".yml"):
            params.setdefault("mapping", source.name)
        elif "files" in fields:
            params.setdefault("files", [source.name])
        elif source.name not in [file.path for file in adapter.card.files]:
            raise ConfigError(
                f"{source}: dataset '{name}' takes a folder, and no file; give the folder, "
                f"and --set for other file names (see 'uwbbench show {name}')"
            )
    return open_dataset(name, params, [folder])


def fetch(
    dataset: Annotated[str, typer.Argument(metavar="NAME", help="Dataset; see 'uwbbench list datasets'.")],
    folder: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Instead of the cache, which is searched always.")
    ] = None,
    more: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Also this folder of its 'more' (see 'uwbbench show'), or 'all'."),
    ] = None,
) -> None:
    """Download a published dataset. It is checked against its hashes.

    Of the folders that --more names no hash is published. They are checked against size and git hash of the commit that
    they are taken from, their SHA-256 is recorded in hashes.json, and later downloads are checked against that.
    """
    import uwbbench.tools.fetch
    from uwbbench.api import registry

    license_ = registry.load_plugin("datasets", dataset).card.license

    def report_file(file: Any, done: int, count: int) -> None:
        size = "" if file.size is None else f", {file.size / 1e6:.1f} MB, {license_}"
        unverified = "" if file.sha256 else "; no SHA-256 known yet: unverified until checked against its commit"
        typer.echo(f"{done + 1}/{count} {file.path}{size}{unverified}", err=True)

    typer.echo(uwbbench.tools.fetch.fetch(dataset, folder, report_file, more or ()))


def register(app: typer.Typer) -> None:
    """Add these commands."""
    app.command(epilog="Example: uwbbench convert data/et4173-walk --dataset et4173-walk -o walk.h5")(convert)
    app.command(epilog="Example: uwbbench fetch pulson440-rail --more trial_3")(fetch)
