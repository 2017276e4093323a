"""The recurrent network: its compiled loops, what it is trained towards, and its segments."""

from pathlib import Path

import numpy as np
import pytest

from uwbbench.api import ConfigError, Example, Obstacle, Trajectory, Truth
from uwbbench_detectors.segments.lstm import Lstm, LstmParams, targets

FRAMES, FEATURES, FIRST = 12, 5, 6
GOLDEN = np.load(Path(__file__).parent / "torch.npz")
"""Of a network each way, or one: its arrays, ``features`` (12, 50, 5), and ``probability`` (12, 44) by torch 2.13.0."""
ARRAYS = ("scaling", "inputs", "recurrent", "bias", "outputs", "offset")


def arrays_of(way):
    return {name: GOLDEN[f"{way}_{name}"] for name in ARRAYS}


@pytest.fixture
def make_lstm(make_radar):
    def made(way="one", **params):
        weights = arrays_of(way)
        hidden = weights["outputs"].shape[1]
        stage = Lstm(LstmParams(weights=None, bidirectional=way == "both", hidden=hidden, **params))
        stage.load(weights)
        stage.open(make_radar())
        return stage

    return made


@pytest.fixture
def golden_block(make_block):
    samples = np.random.default_rng(4).normal(size=(FRAMES, 50))
    return make_block(samples, first_path=np.full(FRAMES, FIRST + 0.2), features=GOLDEN["features"])


@pytest.mark.parametrize("way", ["one", "both"])
def test_probabilities_are_those_that_torch_gave(make_lstm, golden_block, way):
    found = make_lstm(way).probabilities(golden_block)
    np.testing.assert_allclose(found, GOLDEN[f"{way}_probability"], rtol=0, atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("way", ["one", "both"])
def test_probabilities_are_those_of_torch(make_radar, golden_block, way):
    torch = pytest.importorskip("torch")
    from uwbbench_detectors.segments.lstm_training import arrays_of as taken_from
    from uwbbench_detectors.segments.lstm_training import forward, network_of

    params = LstmParams(weights=None, bidirectional=way == "both")
    torch.manual_seed(7)
    network = network_of(torch, params, FEATURES)
    scaling = np.stack([np.full(FEATURES, 0.1), np.full(FEATURES, 1.5)]).astype(np.float32)
    stage = Lstm(params)
    stage.load(taken_from(network, scaling))
    stage.open(make_radar())
    seen = (GOLDEN["features"][:, FIRST : FIRST + params.taps] - scaling[0]) / scaling[1]
    with torch.no_grad():
        expected = torch.sigmoid(forward(network, torch.from_numpy(seen.astype(np.float32)))).numpy()
    np.testing.assert_allclose(stage.probabilities(golden_block), expected, rtol=0, atol=1e-5)


def test_segments_are_runs_of_probable_taps(make_lstm, golden_block):
    stage = make_lstm("both", threshold=0.5)
    found, probable = stage.step(golden_block).detections, stage.probabilities(golden_block) > 0.5
    covered = np.zeros((FRAMES, 50), bool)
    for frame, start, stop, tap in zip(found.frame, found["start_tap"], found["stop_tap"], found["tap"], strict=True):
        covered[frame, int(start + 0.5) : int(stop + 0.5)] = True
        inside = golden_block.frames.amplitude[frame, int(start + 0.5) : int(stop + 0.5)]
        assert golden_block.frames.amplitude[frame, int(tap)] == inside.max()
    np.testing.assert_array_equal(covered[:, FIRST:], probable)
    assert len(found)
    assert (found["probability"] > 0.5).all()


def test_frames_of_zeros_have_no_segment(make_lstm, golden_block):
    empty = golden_block.replace(frames=golden_block.frames.with_preamble(np.zeros((FRAMES, 50), complex)))
    assert not len(make_lstm("both", threshold=0.0).step(empty).detections)


def test_any_cut_of_the_frames_gives_the_same_probabilities(make_lstm, golden_block):
    whole = make_lstm("both").probabilities(golden_block)
    parts = [make_lstm("both").probabilities(golden_block.cut(row, row + 1)) for row in range(FRAMES)]
    np.testing.assert_array_equal(whole, np.concatenate(parts))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda arrays: arrays.pop("bias"), "'bias' is missing"),
        (lambda arrays: arrays.update(inputs=arrays["inputs"][:, :, 1:]), "'inputs' is float32"),
        (lambda arrays: arrays.update(recurrent=np.full_like(arrays["recurrent"], np.nan)), "not finite"),
        (lambda arrays: arrays.update(scaling=-np.abs(arrays["scaling"])), "not positive"),
        (lambda arrays: arrays.update(offset=arrays["offset"].astype(float)), "'offset' is float64"),
    ],
)
def test_weights_that_are_not_as_learned_are_refused(change, message):
    arrays = arrays_of("one")
    change(arrays)
    with pytest.raises(ConfigError, match=message):
        Lstm(LstmParams(weights=None, hidden=arrays_of("one")["outputs"].shape[1])).load(arrays)


def test_another_number_of_features_is_refused(make_lstm, golden_block):
    with pytest.raises(ConfigError, match="from 5 features of each tap, and is given 4"):
        make_lstm().step(golden_block.replace(features=golden_block.features[..., :4]))


@pytest.fixture
def example(make_radar, make_block):
    """A post at 3 m and a wall at 4.5 m, before a radar without a baseline."""
    radar = make_radar()
    position_m = np.zeros((FRAMES, 3))
    trajectory = Trajectory(np.arange(FRAMES) / 48, position_m, np.zeros(FRAMES))
    objects = (
        Obstacle("post", "metal", np.array([[3.0, 0.0]])),
        Obstacle("wall", "brick", np.array([[4.5, 0.0]]), structure=True),
    )
    rng = np.random.default_rng(1)
    samples = 0.01 * (rng.normal(size=(FRAMES, 50)) + 1j * rng.normal(size=(FRAMES, 50)))
    samples[:, FIRST + 20] += 1.0
    samples[3] = 0
    block = make_block(
        samples,
        first_path=np.full(FRAMES, float(FIRST)),
        features=np.log10(np.abs(samples) + 1e-4)[..., None],
    )
    return Example(block, Truth(objects), trajectory, radar, "made up")


def test_taps_within_a_tap_and_a_half_of_an_echo_are_its_own_and_those_of_walls_say_nothing(example):
    true, counts = targets(example, 44)
    assert np.flatnonzero(true[0]).tolist() == [19, 20, 21]  # 3 m and back in taps of 15 cm
    assert np.flatnonzero(~counts[0]).tolist() == [29, 30, 31]
    assert not true[3].any()


@pytest.mark.slow
def test_learning_finds_the_echo_and_the_same_weights_twice(example, make_radar):
    pytest.importorskip("torch")
    params = LstmParams(weights=None, hidden=8, epochs=200, frame_step=1)
    one, other = (Lstm(params).fit([example], seed=3, validation=[]) for _ in range(2))
    for name, array in one.items():
        np.testing.assert_array_equal(array, other[name])
    stage = Lstm(params)
    stage.load(one)
    stage.open(make_radar())
    assert stage.assess([example])["tap_f1"] > 0.4  # by chance one tap in ten


@pytest.mark.slow
def test_labels_that_have_nothing_to_do_with_the_frames_teach_nothing(example, make_radar):
    pytest.importorskip("torch")
    rng = np.random.default_rng(8)

    def anywhere():
        outline = np.stack([[[range_m, 0.0]] for range_m in rng.uniform(0.5, 6, FRAMES)])
        truth = Truth((Obstacle("post", "metal", outline),))
        return Example(example.block, truth, example.trajectory, example.radar, "shuffled")

    params = LstmParams(weights=None, hidden=8, epochs=60, frame_step=1)
    stage = Lstm(params)
    stage.load(stage.fit([anywhere() for _ in range(4)], seed=3, validation=[]))
    stage.open(make_radar())
    assert stage.assess([anywhere()])["tap_f1"] < 0.3  # 7 % of the taps are an echo's


def test_examples_without_an_echo_are_refused(example):
    pytest.importorskip("torch")
    nothing = Example(example.block, Truth(()), example.trajectory, example.radar, "empty")
    with pytest.raises(ConfigError, match="nothing to learn"):
        Lstm(LstmParams(weights=None)).fit([nothing], seed=0, validation=[])


def test_training_without_torch_says_what_to_install(example, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "torch", None)
    with pytest.raises(ConfigError, match=r"pip install 'uwbbench\[train\]'"):
        Lstm(LstmParams(weights=None)).fit([example], seed=0, validation=[])
