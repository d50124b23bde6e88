"""TOML files of any content end in one error before they are parsed."""

import pytest

from lcorpp.domains.toml import MAX_TOML_BYTES, read_toml
from lcorpp.errors import DomainError, FileError, ParseError
from lcorpp.toml_text import MAX_KEY_PARTS

DOTTED = ".".join(["a"] * 50_000)


def write(tmp_path, text):
    (tmp_path / "a.toml").write_text(text)
    return tmp_path / "a.toml"


@pytest.mark.parametrize(
    "text",
    [
        f"{DOTTED} = 1",
        f"[{DOTTED}]",
        f"[[{DOTTED}]]",
        f"b = {{ {DOTTED} = 1 }}",
        "'a' . \"b\" ." * 1000 + "c = 1",
        'c = """\n"""\n' + DOTTED,
    ],
)
def test_long_keys_are_located(tmp_path, text):
    with pytest.raises(ParseError, match=f"a key of more than {MAX_KEY_PARTS} parts") as caught:
        read_toml(write(tmp_path, text))
    assert caught.value.line == 1 + text[:20].count("\n")


def test_dots_elsewhere_are_no_keys(tmp_path):
    dots = "a.b" * 100
    key = ".".join(["a"] * MAX_KEY_PARTS)
    text = f"{key} = 1\n# {dots}\nx = \"{dots}\"\ny = '{dots}'\nz = '''\n{dots}\n{dots}'''\n"
    text += f'w = """\n{dots}\\"""{dots}"""\nn = [{", ".join(["1.5"] * 100)}]\n'
    assert set(read_toml(write(tmp_path, text))) == {"a", "x", "y", "z", "w", "n"}


def test_nesting_and_size(tmp_path):
    with pytest.raises(DomainError, match=r"a\.toml: cannot be read"):
        read_toml(write(tmp_path, "a = " + "[" * 100_000))
    with pytest.raises(FileError, match="it is larger than 4 MB"):
        read_toml(write(tmp_path, "#" * (MAX_TOML_BYTES + 1)))


@pytest.mark.parametrize("number", ["9223372036854775808", "1" + "0" * 400, "0x" + "f" * 10_000])
def test_integers_have_64_bits(tmp_path, number):
    with pytest.raises(DomainError, match=r"a\.toml: an integer of \d+ bits; TOML has 64"):
        read_toml(write(tmp_path, f"a = [1, {{ b = {number} }}]"))


def test_a_wrong_value_is_shortened(tmp_path):
    with pytest.raises(DomainError) as caught:
        read_toml(write(tmp_path, f"a = {list(range(1000))}")).text("a")
    assert len(str(caught.value)) < 500
