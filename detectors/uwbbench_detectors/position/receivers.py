"""Parameters that each receiver of a robot has of its own."""

from __future__ import annotations

from uwbbench.api import ConfigError, Radar, nearest


def of_receiver(value: float | dict[str, float], radar: Radar | None, name: str) -> float:
    """Value of a parameter for one receiver.

    Parameters
    ----------
    value : float or dict
        One for all, or by the names of receivers.
    radar : Radar or None
        Of the receiver; None where it is not known, and one for all is asked for.
    name : str
        Of the parameter, for the message.

    Raises
    ------
    ConfigError
        If the parameter does not name the receiver.
    """
    if not isinstance(value, dict):
        return value
    receiver = "" if radar is None else radar.receiver
    if receiver not in value:
        raise ConfigError(
            f"{name} has values for the receivers {', '.join(value)}; the capture's is '{receiver}'."
            f"{nearest(receiver, value)}"
        )
    return value[receiver]
