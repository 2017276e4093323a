"""Values of a scene that depend on its channel: ``{by_channel: {5: 1.0, 9: 0.2, other: 0.2}}``, as in detectors."""

from __future__ import annotations

from typing import Any

from uwbbench.api import ConfigError, YamlFile

_KEY = "by_channel"


def for_channel(value: Any, channel: Any, source: YamlFile, at: tuple[str | int, ...] = ()) -> Any:
    """Parsed YAML with the value of one channel in place of each table of values by channel.

    Parameters
    ----------
    value : Any
        A file's mapping, or a part of it.
    channel : Any
        Channel of the scene, as its file says.
    source : YamlFile
        The file, for messages.
    at : tuple of str and int
        Keys that lead to ``value`` in it.

    Raises
    ------
    ConfigError
        If a table is none, or lacks the channel and has no ``other``.
    """
    if isinstance(value, list):
        return [for_channel(item, channel, source, (*at, index)) for index, item in enumerate(value)]
    if not isinstance(value, dict):
        return value
    if _KEY not in value:
        return {key: for_channel(item, channel, source, (*at, key)) for key, item in value.items()}
    table = value[_KEY]
    if len(value) > 1 or not isinstance(table, dict) or not table or not all(_names_channel(key) for key in table):
        raise ConfigError(f"{source.place(at)}: by_channel expects channel numbers and 'other' as keys")
    named = {str(key): choice for key, choice in table.items()}
    chosen = str(channel) if str(channel) in named else "other"
    if chosen not in named:
        raise ConfigError(
            f"{source.place(at)}: by_channel has values for {', '.join(named)}, not for channel {channel}"
        )
    return for_channel(named[chosen], channel, source, at)


def _names_channel(key: Any) -> bool:
    return key == "other" or str(key).isdecimal()
