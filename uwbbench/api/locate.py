"""Where shipped configuration files are found: an explicit path, then the checkout, then inside the wheel."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from uwbbench.api import registry
from uwbbench.api.errors import ConfigError, PluginError, nearest

Folder = Literal["detectors", "experiments", "suites", "scenes", "robots", "gates", "tuning", "training", "fits"]

_PACKAGE = Path(__file__).resolve().parent.parent


def config_folder() -> Path:
    """Folder of the shipped configs: beside the package in a checkout, inside it in an installed wheel."""
    checkout = _PACKAGE.parent / "configs"
    return checkout if (_PACKAGE.parent / "pyproject.toml").is_file() and checkout.is_dir() else _PACKAGE / "configs"


def shipped(folder: Folder) -> dict[str, Path]:
    """Shipped configs of a folder by name."""
    return {path.stem: path for path in sorted((config_folder() / folder).glob("*.yaml"))}


def is_path(name: str) -> bool:
    """Whether a config is named by the path of its file."""
    return name.endswith((".yaml", ".yml")) or "/" in name or "\\" in name


def find_config(folder: Folder, name: str, relative_to: Path | None = None) -> Path:
    """File of a config.

    Parameters
    ----------
    folder : {"detectors", "experiments", "suites", "scenes", "robots", "gates", "tuning", "training", "fits"}
        Kind of config; suites are experiments, and are found among them.
    name : str
        A path (ends in ``.yaml`` or ``.yml``, or holds a separator), a shipped name, or for detectors a name that a
        package registers.
    relative_to : Path, optional
        Folder of the file that mentions ``name``.

    Raises
    ------
    ConfigError
        If there is no such file; names the nearest known name.
    PluginError
        If several packages bring a detector of that name.
    """
    if is_path(name):
        tried = [(relative_to or Path()) / name]
        if name.startswith("configs/"):  # the way the documentation names shipped files, from anywhere
            tried.append(config_folder() / name.removeprefix("configs/"))
        for path in tried:
            if path.is_file():
                return path
        raise ConfigError(f"{tried[0]}: no such file")
    known = shipped(folder) | (shipped("suites") if folder == "experiments" else {})
    others = registry.entries("detectors") if folder == "detectors" else {}
    if name in known and name in others:
        packages = f"uwbbench and {others[name].package}"
        raise PluginError(f"detector '{name}' comes with several packages ({packages}); name its file instead")
    if name in known:
        return known[name]
    if name in others:
        return registry.detector_file(name)
    raise ConfigError(f"no {folder.removesuffix('s')} named '{name}'.{nearest(name, [*known, *others])}")
