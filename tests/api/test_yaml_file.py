"""The YAML loader: YAML 1.2 values, a line for every key, and nothing but plain values."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uwbbench.api import ConfigError
from uwbbench.api.yaml_file import YamlFile, parse_value, parse_yaml, read_yaml


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("on", "on"), ("off", "off"), ("yes", "yes"), ("no", "no"), ("y", "y"), ("10:30", "10:30"), ("1_000", "1_000"),
        ("2024-01-01", "2024-01-01"), ("true", True), ("False", False), ("null", None), ("~", None), ("", None),
        ("1e-3", 1e-3), ("1E3", 1000.0), (".5", 0.5), ("5.", 5.0), ("-0.25", -0.25), ("499.2e6", 499.2e6),
        ("12", 12), ("-3", -3), ("010", 10), ("08", 8), ("0o17", 15), ("0x1F", 31), ("'12'", "12"), ("1.2.3", "1.2.3"),
        ("=", "="), ("<<", "<<"), ("!!str 5", "5"), (".inf", float("inf")), ("-.inf", -float("inf")),
    ],
)  # fmt: skip
def test_values_follow_yaml_1_2(text, value):
    found = parse_yaml(f"key: {text}", "file").data["key"]
    assert found == value
    assert type(found) is type(value)


@settings(max_examples=50)
@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_number_that_python_prints_is_read_back(number):
    assert parse_value(repr(number)) == number


def test_keys_of_channels_are_numbers_and_other_keys_are_text():
    assert parse_yaml("{5: a, on: b, 1.5: c, true: d, ~: e}", "file").data == {
        5: "a", "on": "b", "1.5": "c", "true": "d", "~": "e",
    }  # fmt: skip


def test_a_key_given_twice_is_named_with_its_line():
    with pytest.raises(ConfigError, match=r"f\.yaml:4: key 'a\.b' is given twice"):
        parse_yaml("a:\n  b: 1\n  c: 2\n  b: 3\n", "f.yaml")


def test_every_key_knows_its_line():
    found = parse_yaml("a: 1\nb:\n  - c: 2\n    d: 3\n  - e\n", "f")
    assert found.place(("b", 0, "d")) == "f:4: b[0].d"
    assert found.place(("b", 1)) == "f:5: b[1]"
    assert found.place(("b", 0, "missing", 3)) == "f:3: b[0].missing[3]"
    assert found.place(()) == "f"


def test_aliases_stand_for_what_they_name():
    assert parse_yaml("a: &x [1, 2]\nb: *x\n", "f").data == {"a": [1, 2], "b": [1, 2]}


def test_aliases_that_multiply_are_stopped():
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 10)]
    with pytest.raises(ConfigError, match="aliases multiply"):
        parse_yaml("\n".join(lines), "bomb.yaml")


@pytest.mark.parametrize("text", ["a: &x [*x]", "a: &x {b: *x}"])
def test_an_alias_that_holds_itself_is_refused(text):
    with pytest.raises(ConfigError, match=r"^loop\.yaml"):
        parse_yaml(text, "loop.yaml")


def test_nesting_too_deep_is_refused():
    with pytest.raises(ConfigError, match=r"^deep\.yaml"):
        parse_yaml("a: " + "[" * 700 + "]" * 700, "deep.yaml")


@pytest.mark.parametrize("text", ["- 1\n- 2\n", "just text", "5"])
def test_a_file_that_is_no_mapping_is_refused(text):
    with pytest.raises(ConfigError, match=r"^f\.yaml: expected keys and values"):
        parse_yaml(text, "f.yaml")


def test_an_empty_file_has_no_keys():
    assert parse_yaml("", "f").data == {}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a:\n\t- 1\n", r"f\.yaml:2: not valid YAML"),
        ("a: [1, 2\nb: 3", r"f\.yaml:\d: not valid YAML"),
        ("a: b: c", r"f\.yaml:1: not valid YAML"),
        ("a: *nobody", r"f\.yaml:1: not valid YAML.*nobody"),
        ("a: 1\n---\nb: 2", r"f\.yaml:\d: not valid YAML"),
        ("a: \x01", r"f\.yaml: not valid YAML"),
        ("[a, b]: 1", r"f\.yaml:1: a key must be a single word"),
        ("a: 1\nb: !!timestamp 2024-01-01", r"f\.yaml:2: tag .*timestamp' is not allowed"),
        ("b: !!binary aGk=", r"f\.yaml:1: tag .*binary' is not allowed"),
        ("b: !!python/name:os.system ''", r"f\.yaml:1: tag .*os.system' is not allowed"),
        ("b: !!bool maybe", r"f\.yaml:1: 'maybe' is not a valid bool"),
        ("b: !!int many", r"f\.yaml:1: 'many' is not a valid int"),
        ("b: " + "9" * 5000, r"f\.yaml:1: .* is not a valid int"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(text, message):
    with pytest.raises(ConfigError, match=message):
        parse_yaml(text, "f.yaml")


@settings(max_examples=200)
@given(st.text(alphabet="ab:-[]{}&*!|>'\"%@`#,? \n\t01.~é\x00", max_size=40))
def test_any_text_is_read_or_refused_with_one_message(text):
    try:
        assert isinstance(parse_yaml(text, "f.yaml"), YamlFile)
    except ConfigError as error:
        assert str(error).startswith("f.yaml")  # noqa: PT017 - most texts are valid


def test_a_missing_file_a_folder_and_bytes_that_are_no_text_are_refused_by_name(tmp_path):
    (tmp_path / "bytes.yaml").write_bytes(b"a: \xff")
    for name in ("none.yaml", ".", "bytes.yaml"):
        with pytest.raises(ConfigError, match=r"cannot be read|UTF-8"):
            read_yaml(tmp_path / name)


def test_a_file_that_is_too_long_is_refused_before_it_is_parsed(tmp_path):
    (tmp_path / "long.yaml").write_text("a: [" + "x, " * 400_000 + "]")
    with pytest.raises(ConfigError, match=r"long\.yaml: is longer than 256 KiB"):
        read_yaml(tmp_path / "long.yaml")


def test_a_device_is_not_read(tmp_path):
    (tmp_path / "endless.yaml").symlink_to("/dev/zero")
    with pytest.raises(ConfigError, match=r"endless\.yaml: cannot be read: is no file"):
        read_yaml(tmp_path / "endless.yaml")


@pytest.mark.parametrize("number", ["0x" + "f" * 100_000, "9" * 100_000, "-" + "9" * 5000])
def test_a_number_of_thousands_of_digits_is_one_short_message(number):
    with pytest.raises(ConfigError, match=r"^f\.yaml:1: '.*\.\.\.' is not a valid int") as caught:
        parse_yaml(f"seed: {number}", "f.yaml")
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize("value", ["x" * 100_000, "'" + "x y " * 30_000 + "'", "[" + "a, " * 3_000 + "]"])
def test_a_message_repeats_at_most_200_characters_of_a_value(value):
    from uwbbench.api import Params, checked

    class Some(Params):
        length_m: float

    source = parse_yaml(f"length_m: {value}", "f.yaml")
    with pytest.raises(ConfigError, match=r"^f\.yaml:1: length_m: ") as caught:
        checked(Some, source.data, source)
    assert len(str(caught.value)) < 300


def test_an_unknown_key_of_any_length_is_one_short_message():
    from uwbbench.api import Params, checked

    source = parse_yaml(f"{'k' * 1000}: 1", "f.yaml")
    with pytest.raises(ConfigError, match="unknown key") as caught:
        checked(Params, source.data, source)
    assert len(str(caught.value)) < 800
