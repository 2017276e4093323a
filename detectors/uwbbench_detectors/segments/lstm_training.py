"""How the recurrent network learns: by torch, which is imported here alone."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uwbbench.api import ConfigError, Example, Weights
from uwbbench_detectors.segments.lstm import LstmParams, first_taps, targets

BATCH = 96
RATES = (3e-3, 1e-3)
"""Learning rate of the first and of the last pass."""


def learn(params: LstmParams, examples: Iterable[Example], validation: Iterable[Example], seed: int) -> Weights:
    """Weights of the pass with the smallest loss on the validation captures.

    Adam (Kingma and Ba 2015) on the cross-entropy of each tap; taps of echoes weigh as the root of the others' number
    over theirs, taps of walls nothing. One thread, so that the same seed gives the same weights on one machine.

    Parameters
    ----------
    params : LstmParams
    examples, validation : iterable of Example
    seed : int

    Raises
    ------
    ConfigError
        If torch is not installed, or no example has an echo.
    """
    try:
        import torch
    except ImportError:
        raise ConfigError(
            "a recurrent network is trained with torch, which is not installed: pip install 'uwbbench[train]'"
        ) from None
    features, true, counts = _stacked(examples, params)
    if not true.any():
        raise ConfigError("no obstacle's echo is among the examples: there is nothing to learn")
    flat = features.reshape(-1, features.shape[2])
    scaling = np.stack([flat.mean(axis=0), np.maximum(flat.std(axis=0), 1e-6)]).astype(np.float32)
    positive = float(np.sqrt((counts & ~true).sum() / true.sum()))
    threads = torch.get_num_threads()
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        torch.set_num_threads(1)
        try:
            network = _trained(torch, params, (features, true, counts), _stacked(validation, params), scaling, positive)
        finally:
            torch.set_num_threads(threads)
    return arrays_of(network, scaling)


def network_of(torch: Any, params: LstmParams, features: int) -> Any:
    """Untrained network, as a torch module of two layers: ``0`` the memory, ``1`` what is made of its state.

    Parameters
    ----------
    torch : module
    params : LstmParams
    features : int
        Features of a tap.
    """
    memory = torch.nn.LSTM(features, params.hidden, batch_first=True, bidirectional=params.bidirectional)
    return torch.nn.ModuleList([memory, torch.nn.Linear(params.hidden * (1 + params.bidirectional), 1)])


def forward(network: Any, features: Any) -> Any:
    """Logit (frames, taps) of each tap, of standardised features (frames, taps, features)."""
    memory, output = network
    return output(memory(features)[0])[..., 0]


def arrays_of(network: Any, scaling: NDArray[np.float32]) -> Weights:
    """Weights of a network as arrays, laid out as the compiled loops read them.

    Parameters
    ----------
    network : torch module
        Of :func:`network_of`.
    scaling : (2, features) array
    """
    held = {name: value.detach().numpy() for name, value in network[0].named_parameters()}
    ways = ["", "_reverse"] if network[0].bidirectional else [""]

    def stacked(*names: str) -> NDArray[np.float32]:
        return np.stack([sum((held[f"{name}_l0{way}"].T for name in names), np.float32(0)) for way in ways])

    return {
        "scaling": scaling,
        "inputs": stacked("weight_ih"),
        "recurrent": stacked("weight_hh"),
        "bias": stacked("bias_ih", "bias_hh"),
        "outputs": network[1].weight.detach().numpy().reshape(len(ways), -1).copy(),
        "offset": network[1].bias.detach().numpy().copy(),
    }


Frames = tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.bool_]]
"""Features (frames, taps, features), which taps are an obstacle's, and which count (frames, taps)."""


def _stacked(examples: Iterable[Example], params: LstmParams) -> Frames:
    """Every n-th frame of the examples."""
    features: list[NDArray[np.float32]] = []
    true, counts = [np.zeros((0, params.taps), bool)], [np.zeros((0, params.taps), bool)]
    for example in examples:
        block = example.block
        at = np.minimum(first_taps(block)[:, None] + np.arange(params.taps), block.frames.taps - 1)
        rows = np.arange(len(at))[:, None]
        features.append(block.part("features")[rows, at][:: params.frame_step].astype(np.float32))
        one, other = targets(example, params.taps)
        true.append(one[:: params.frame_step])
        counts.append(other[:: params.frame_step])
    joined = np.concatenate(features) if features else np.zeros((0, params.taps, 1), np.float32)
    return joined, np.concatenate(true), np.concatenate(counts)


def _trained(
    torch: Any, params: LstmParams, training: Frames, validation: Frames, scaling: NDArray[np.float32], positive: float
) -> Any:
    """Network of the best pass."""
    network = network_of(torch, params, training[0].shape[2])
    optimiser = torch.optim.Adam(network.parameters(), RATES[0])
    rates = np.geomspace(*RATES, params.epochs)
    known = [_tensors(torch, side, scaling) for side in (training, validation)]
    best, kept, waited = np.inf, network.state_dict(), 0
    for rate in rates:
        optimiser.param_groups[0]["lr"] = float(rate)
        for batch in torch.randperm(len(known[0][0])).split(BATCH):
            optimiser.zero_grad()
            loss = _loss(torch, network, [part[batch] for part in known[0]], positive)
            loss.backward()
            torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
            optimiser.step()
        if not len(validation[0]):
            continue
        with torch.no_grad():
            there = float(_loss(torch, network, known[1], positive))
        waited += 1
        if there < best:
            best, kept, waited = there, {name: value.clone() for name, value in network.state_dict().items()}, 0
        if waited >= params.patience:
            break
    if len(validation[0]):
        network.load_state_dict(kept)
    return network


def _tensors(torch: Any, side: Frames, scaling: NDArray[np.float32]) -> list[Any]:
    features, true, counts = side
    if not len(features):
        return []
    scaled = (features - scaling[0]) / scaling[1]
    return [torch.from_numpy(part.astype(np.float32)) for part in (scaled, true, counts)]


def _loss(torch: Any, network: Any, parts: list[Any], positive: float) -> Any:
    features, true, counts = parts
    loss = torch.nn.functional.binary_cross_entropy_with_logits(
        forward(network, features), true, reduction="none", pos_weight=torch.tensor(positive)
    )
    return (loss * counts).sum() / counts.sum()
