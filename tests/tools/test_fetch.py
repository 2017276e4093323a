"""Downloads against a real local server."""

import functools
import hashlib
import http.server
import socket
import threading

import pytest

from uwbbench.api import CaptureError, Card, DatasetFile, PluginError
from uwbbench.api.registry import load_plugin
from uwbbench.config.source import cache_folder, data_roots, open_dataset
from uwbbench.tools.fetch import fetch

CONTENT = {"a.bin": b"first file", "b.bin": b"second file"}


class Server(http.server.ThreadingHTTPServer):
    def __init__(self, folder):
        self.asked: list[str] = []
        super().__init__(("127.0.0.1", 0), functools.partial(Handler, directory=str(folder)))


class Handler(http.server.SimpleHTTPRequestHandler):
    def do_GET(self):
        self.server.asked.append(self.path)
        super().do_GET()

    def log_message(self, *args):
        pass


@pytest.fixture
def server(tmp_path):
    folder = tmp_path / "served"
    folder.mkdir()
    for name, content in CONTENT.items():
        (folder / name).write_bytes(content)
    with Server(folder) as running:
        thread = threading.Thread(target=running.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield running
        running.shutdown()
        thread.join()


@pytest.fixture
def publish(monkeypatch, tmp_path):
    """Give the registered rail dataset another card, and an empty cache."""
    monkeypatch.setenv("UWBBENCH_CACHE", str(tmp_path / "cache"))

    def give(*files):
        card = Card("tiny", "MIT", "nobody", "https://example.org/tiny", folder="tiny", files=tuple(files))
        monkeypatch.setattr(load_plugin("datasets", "pulson440-rail"), "card", card)

    return give


def listed(server, name, content=None):
    content = CONTENT[name] if content is None else content
    url = f"http://127.0.0.1:{server.server_address[1]}/{name}"
    return DatasetFile(name, hashlib.sha256(content).hexdigest(), url)


def test_files_land_where_datasets_are_searched(server, publish):
    publish(*(listed(server, name) for name in CONTENT))
    folder = fetch("pulson440-rail")
    assert folder == cache_folder() / "tiny"
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == CONTENT
    assert open_dataset("pulson440-rail", {}, data_roots()).file("a.bin") == folder.resolve() / "a.bin"


def test_a_folder_can_be_chosen(server, publish, tmp_path):
    publish(listed(server, "a.bin"))
    assert fetch("pulson440-rail", tmp_path / "data") == tmp_path / "data" / "tiny"
    assert (tmp_path / "data" / "tiny" / "a.bin").read_bytes() == CONTENT["a.bin"]


def test_only_missing_or_changed_files_are_downloaded_again(server, publish):
    publish(*(listed(server, name) for name in CONTENT))
    folder = fetch("pulson440-rail")
    (folder / "b.bin").write_bytes(b"spoilt")
    server.asked.clear()
    fetch("pulson440-rail")
    assert server.asked == ["/b.bin"]
    assert (folder / "b.bin").read_bytes() == CONTENT["b.bin"]


def test_progress_is_told_and_nothing_printed(server, publish, capfd):
    publish(*(listed(server, name) for name in CONTENT))
    told = []
    fetch("pulson440-rail", progress=lambda file, done, total: told.append((file.path, done, total)))
    assert told == [("a.bin", 0, 2), ("b.bin", 1, 2)]
    assert capfd.readouterr() == ("", "")


def test_a_file_with_the_wrong_hash_is_not_kept(server, publish):
    publish(listed(server, "a.bin", b"what was published"))
    with pytest.raises(CaptureError, match=r"'a\.bin' of dataset 'pulson440-rail'.*not the published file.*not kept"):
        fetch("pulson440-rail")
    assert not list((cache_folder() / "tiny").iterdir())


def test_a_missing_file_names_the_answer_and_the_source(server, publish):
    publish(listed(server, "a.bin"), listed(server, "gone.bin", b"gone"))
    with pytest.raises(CaptureError, match=r"'gone\.bin'.*answered 404.*take it from https://example\.org/tiny"):
        fetch("pulson440-rail")
    assert [path.name for path in (cache_folder() / "tiny").iterdir()] == ["a.bin"]


def test_offline_is_one_clear_message(publish):
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        port = unused.getsockname()[1]
    publish(DatasetFile("a.bin", "0" * 64, f"http://127.0.0.1:{port}/a.bin"))
    with pytest.raises(CaptureError, match=r"'a\.bin'.*cannot be downloaded.*no connection to the server"):
        fetch("pulson440-rail")


def test_a_folder_that_cannot_be_made_is_one_clear_message(server, publish, tmp_path):
    publish(listed(server, "a.bin"))
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(CaptureError, match=r"'a\.bin'.*(File exists|Not a directory)"):
        fetch("pulson440-rail", tmp_path / "file")


def test_a_file_without_an_address_is_asked_for_by_hand(publish, tmp_path):
    publish(DatasetFile("a.bin", hashlib.sha256(CONTENT["a.bin"]).hexdigest(), ""))
    with pytest.raises(CaptureError, match=r"'a\.bin'.*no direct download address.*example\.org"):
        fetch("pulson440-rail", tmp_path)
    (tmp_path / "tiny").mkdir()
    (tmp_path / "tiny" / "a.bin").write_bytes(CONTENT["a.bin"])
    assert fetch("pulson440-rail", tmp_path) == tmp_path / "tiny"


def test_a_dataset_without_files_says_where_it_comes_from():
    with pytest.raises(CaptureError, match="'approach' has nothing to download: its source is built in"):
        fetch("approach")


def test_an_unknown_dataset_names_the_nearest():
    with pytest.raises(PluginError, match="Did you mean 'pulson440-rail'"):
        fetch("pulson440-rial")


@pytest.mark.data
@pytest.mark.parametrize("name", ["pulson440-rail", "pulson440-tree", "et4173-walk", "xethru-x4", "dw1000-apartment"])
def test_cards_hash_the_files_as_published(name, data_dir):
    adapter = load_plugin("datasets", name)
    assert adapter.card.files
    for file in adapter.card.files:
        content = (data_dir / adapter.card.folder / file.path).read_bytes()
        assert hashlib.sha256(content).hexdigest() == file.sha256
