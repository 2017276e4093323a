"""Files with the secret seeds of a private half."""

import stat
from pathlib import Path

import pytest

from uwbbench.api import ConfigError, StoreError
from uwbbench.config.seeds import read_seeds, write_seeds


def test_a_new_seed_file_is_its_owners_alone(tmp_path: Path) -> None:
    path = tmp_path / "seeds"
    written = write_seeds(path)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert read_seeds(path) == written


def test_two_seed_files_differ_and_so_do_the_seeds_of_two_datasets(tmp_path: Path) -> None:
    one, other = write_seeds(tmp_path / "one"), write_seeds(tmp_path / "other")
    assert len({one.of("a"), one.of("b"), other.of("a")}) == 3
    assert one.sha256 != other.sha256


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620, 0o601])
def test_a_seed_file_that_others_may_read_is_refused(tmp_path: Path, mode: int) -> None:
    path = tmp_path / "seeds"
    write_seeds(path)
    path.chmod(mode)
    with pytest.raises(ConfigError, match=rf"seeds: others may read this seed file \(mode {mode:04o}\)"):
        read_seeds(path)


def test_seeds_are_never_replaced(tmp_path: Path) -> None:
    before = write_seeds(tmp_path / "seeds")
    with pytest.raises(StoreError, match="already exists"):
        write_seeds(tmp_path / "seeds")
    assert read_seeds(tmp_path / "seeds") == before


@pytest.mark.parametrize("content", ["", "42", "0" * 63 + "g", "1" * 65])
def test_a_file_that_holds_something_else_is_refused(tmp_path: Path, content: str) -> None:
    path = tmp_path / "seeds"
    path.touch(0o600)
    path.write_text(content)
    with pytest.raises(ConfigError, match="64 hexadecimal digits"):
        read_seeds(path)


def test_a_file_that_is_not_there_is_said_to_be_missing(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="seeds: the seed file cannot be read: No such file"):
        read_seeds(tmp_path / "seeds")


def test_seeds_are_in_no_text_about_them(tmp_path: Path) -> None:
    seeds = write_seeds(tmp_path / "seeds")
    assert seeds.number.hex() not in repr(seeds)
    assert str(seeds.number) not in repr(seeds)
