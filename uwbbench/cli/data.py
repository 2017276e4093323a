"""Commands about data: ``convert`` recordings into capture files, ``fetch`` published datasets."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from uwbbench.api.errors import ConfigError, nearest
from uwbbench.cli import options

if TYPE_CHECKING:
    from uwbbench.api.dataset import Dataset


def convert(
    source: Annotated[Path, typer.Argument(metavar="SOURCE", help="Recording: a file, or the folder that holds it.")],
    dataset: Annotated[str, typer.Option("--dataset", metavar="NAME", help="Adapter that reads it.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE.h5", help="Capture file to write.")],
    capture: Annotated[
        str | None, typer.Option(metavar="NAME", help="Which capture, if there are several.", show_default=False)
    ] = None,
    settings: options.Settings = None,
) -> None:
    """Convert a recording into a capture file."""
    from uwbbench.api.capture_file import write_capture

    options.format_of(output, ".h5")
    opened = _open(source, dataset, settings)
    names = opened.names()
    if capture is None and len(names) != 1:
        raise ConfigError(f"{source}: holds {len(names)} captures; choose one with --capture: {', '.join(names)}")
    chosen = capture or names[0]
    if chosen not in names:
        raise ConfigError(f"{source}: no capture '{chosen}'.{nearest(chosen, names)}")
    found = opened.open(chosen)
    write_capture(output, found)
    label = "simulated capture" if found.source == "simulated" else "capture"
    typer.echo(f"{label} '{found.name}', {len(found)} frames of {found.radar.taps} taps, written to {output}", err=True)


def _open(source: Path, name: str, settings: list[str] | None) -> Dataset[Any]:
    """Adapter that reads a recording from its own folder and nowhere else."""
    from uwbbench import registry
    from uwbbench.config.override import parse_settings
    from uwbbench.config.source import open_dataset

    if not source.exists():
        raise ConfigError(f"{source}: no such file or folder")
    folder = source.resolve() if source.is_dir() else source.resolve().parent
    params = parse_settings(settings or ())
    if source.is_file():
        adapter = registry.load("datasets", name)
        fields = adapter.params_type().model_fields
        if "mapping" in fields and source.suffix in (".yaml", ".yml"):
            params.setdefault("mapping", source.name)
        elif "files" in fields:
            params.setdefault("files", [source.name])
        elif source.name not in [file.path for file in adapter.card.files]:
            raise ConfigError(
                f"{source}: dataset '{name}' is not told its file, only its folder; give the folder, "
                f"and --set for other file names (see 'uwbbench show {name}')"
            )
    return open_dataset(name, params, [folder])


def fetch(
    dataset: Annotated[str, typer.Argument(metavar="NAME", help="Dataset; see 'uwbbench list datasets'.")],
    folder: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Instead of the cache, which is searched always.")
    ] = None,
) -> None:
    """Download a published dataset. It is checked against its hashes."""
    import uwbbench.fetch

    def tell(file: Any, done: int, count: int) -> None:
        typer.echo(f"{done + 1}/{count} {file.path}", err=True)

    typer.echo(uwbbench.fetch.fetch(dataset, folder, tell))


def register(app: typer.Typer) -> None:
    """Add these commands."""
    app.command(epilog="Example: uwbbench convert data/et4173-walk --dataset et4173-walk --capture 101 -o walk.h5")(
        convert
    )
    app.command(epilog="Example: uwbbench fetch pulson440-rail")(fetch)
