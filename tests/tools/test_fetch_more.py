"""Folders that a host lists: downloads against a real local server that answers as GitHub does."""

import hashlib
import json

import pytest

from tests.tools.test_fetch import listed, server  # noqa: F401
from uwbbench.api import CaptureError, Card, ConfigError, DatasetFolder
from uwbbench.api.registry import load_plugin
from uwbbench.tools.fetch import fetch

SCAN = b"binary scans" * 1000


def git_sha1(content):
    return hashlib.sha1(b"blob %d\0" % len(content) + content, usedforsecurity=False).hexdigest()


def entry(server, name, content=SCAN, **changes):  # noqa: F811
    url = f"http://127.0.0.1:{server.server_address[1]}/{name}"
    facts = {"type": "file", "name": name, "size": len(content), "sha": git_sha1(content), "download_url": url}
    return facts | changes


@pytest.fixture
def trial(server, monkeypatch, tmp_path):  # noqa: F811
    """Serve a trial with a scan, a motion file and a pickle; ``trial(entries)`` answers with another list."""
    monkeypatch.setenv("UWBBENCH_CACHE", str(tmp_path / "cache"))
    served = tmp_path / "served"
    for name in ("scan.txt", "motion.csv", "data.pkl"):
        (served / name).write_bytes(SCAN)
    listing = f"http://127.0.0.1:{server.server_address[1]}/listing.json"
    folder = DatasetFolder("trial_3", listing, (".txt", ".csv"))
    own = listed(server, "a.bin")
    card = Card("tiny", "MIT", "nobody", "https://example.org/tiny", folder="tiny", files=(own,), more=(folder,))
    monkeypatch.setattr(load_plugin("datasets", "pulson440-rail"), "card", card)

    def answer(entries=None):
        entries = (
            [entry(server, name) for name in ("scan.txt", "motion.csv", "data.pkl")] if entries is None else entries
        )
        (served / "listing.json").write_text(json.dumps(entries))

    answer()
    return answer


def test_nothing_more_is_fetched_unless_it_is_asked_for(trial, tmp_path):
    fetch("pulson440-rail")
    assert [path.name for path in (tmp_path / "cache" / "tiny").iterdir()] == ["a.bin"]


@pytest.mark.parametrize("more", [["trial_3"], ["all"]])
def test_wanted_files_of_a_folder_come_with_their_hashes_recorded(more, trial, tmp_path):
    folder = fetch("pulson440-rail", more=more)
    assert sorted(path.name for path in (folder / "trial_3").iterdir()) == ["motion.csv", "scan.txt"]
    assert (folder / "trial_3" / "scan.txt").read_bytes() == SCAN
    recorded = json.loads((folder / "hashes.json").read_text())
    assert recorded == dict.fromkeys(["trial_3/motion.csv", "trial_3/scan.txt"], hashlib.sha256(SCAN).hexdigest())


def test_a_file_is_unverified_before_its_first_download_and_has_a_hash_after(trial):
    told = []
    for _ in range(2):
        fetch(
            "pulson440-rail",
            progress=lambda file, done, total: told.append((file.path, file.size, file.sha256)),
            more=["all"],
        )
    hashed = hashlib.sha256(SCAN).hexdigest()
    assert told[1:3] == [("trial_3/scan.txt", len(SCAN), ""), ("trial_3/motion.csv", len(SCAN), "")]
    assert told[4:6] == [("trial_3/scan.txt", len(SCAN), hashed), ("trial_3/motion.csv", len(SCAN), hashed)]


def test_what_is_there_and_fits_is_not_downloaded_again(trial, server):  # noqa: F811
    fetch("pulson440-rail", more=["all"])
    server.asked.clear()
    fetch("pulson440-rail", more=["all"])
    assert server.asked == ["/listing.json"]


def test_a_file_that_is_not_that_of_the_commit_is_not_kept(trial, server, tmp_path):  # noqa: F811
    trial([entry(server, "scan.txt", b"another content")])
    with pytest.raises(
        CaptureError, match=r"'trial_3/scan\.txt'.*not the file of that commit: 12000 bytes .* instead of 15"
    ):
        fetch("pulson440-rail", more=["trial_3"])
    assert not (tmp_path / "cache" / "tiny" / "trial_3" / "scan.txt").exists()
    assert not (tmp_path / "cache" / "tiny" / "hashes.json").exists()


def test_a_download_that_differs_from_the_recorded_one_is_refused(trial, server, tmp_path):  # noqa: F811
    folder = fetch("pulson440-rail", more=["all"])
    (folder / "trial_3" / "scan.txt").unlink()
    (tmp_path / "served" / "scan.txt").write_bytes(b"changed")
    with pytest.raises(CaptureError, match=r"'trial_3/scan\.txt'.*not the published file.*not kept"):
        fetch("pulson440-rail", more=["all"])


@pytest.mark.parametrize(
    ("entries", "what"),
    [
        ({"message": "API rate limit exceeded"}, "sent no list of files"),
        ([{"type": "file", "name": "scan.txt"}], "sent no list of files"),
        ([{"type": "file", "name": "../x.txt", "size": 1, "sha": "", "download_url": ""}], "file name .* not allowed"),
        ([{"type": "dir", "name": "scan.txt"}], r"lists no file that ends in \.txt, \.csv"),
    ],
)
def test_a_listing_that_is_none_is_one_clear_message(entries, what, trial):
    trial(entries)
    with pytest.raises(CaptureError, match=rf"'trial_3'.*{what}"):
        fetch("pulson440-rail", more=["trial_3"])


def test_a_listing_that_cannot_be_had_names_the_answer(trial, tmp_path):
    (tmp_path / "served" / "listing.json").unlink()
    with pytest.raises(CaptureError, match=r"answered 404.*See https://example\.org/tiny"):
        fetch("pulson440-rail", more=["trial_3"])


def test_an_unknown_folder_names_those_there_are(trial):
    with pytest.raises(ConfigError, match=r"has no 'trial_2'; known: trial_3, all.*Did you mean 'trial_3'"):
        fetch("pulson440-rail", more=["trial_2"])


def test_a_damaged_record_says_what_to_do(trial, tmp_path):
    folder = fetch("pulson440-rail", more=["all"])
    (folder / "hashes.json").write_text("{")
    with pytest.raises(CaptureError, match=r"hashes\.json: cannot be read.*delete it"):
        fetch("pulson440-rail", more=["all"])


def test_the_rail_names_its_other_trials_at_a_pinned_commit():
    more = load_plugin("datasets", "pulson440-rail").card.more
    assert [folder.name for folder in more] == ["trial_1", "trial_3", "trial_4", "trial_5", "trial_7"]
    assert all(folder.listing.rpartition("?ref=")[2].isalnum() for folder in more)
    assert all(len(folder.listing.rpartition("?ref=")[2]) == 40 for folder in more)
    assert all(".pkl" not in folder.suffixes for folder in more)
