"""The user's Python files: errors name the file and the user's own line."""

import pickle
import sys
from pathlib import Path

import pytest

from lcorpp.errors import DataError, DomainError
from lcorpp.user_code import UserFile, UserFunction, load_file, split_function


def test_a_file_becomes_a_module(tmp_path):
    file = tmp_path / "own.py"
    file.write_text("VALUE = 3\n")
    assert load_file(file, "own_of_a_test", DomainError).VALUE == 3
    assert "own_of_a_test" not in sys.modules
    module = load_file(file, "own_of_a_test", DomainError, importable=True)
    assert sys.modules.pop("own_of_a_test") is module


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x = 1\ny = x +\n", r"own\.py:2: cannot be loaded: SyntaxError"),
        ("import json\njson.loads('{')\n", r"own\.py:2: cannot be loaded: JSONDecodeError"),
        ("raise SystemExit(3)\n", r"own\.py:1: cannot be loaded: SystemExit: 3"),
    ],
)
def test_an_error_names_the_users_line(tmp_path, text, words):
    (tmp_path / "own.py").write_text(text)
    with pytest.raises(DataError, match=words):
        load_file(tmp_path / "own.py", "own_of_a_test", DataError, importable=True)
    assert "own_of_a_test" not in sys.modules


def test_a_missing_file(tmp_path):
    with pytest.raises(DomainError, match=r"none\.py: there is no such file"):
        load_file(tmp_path / "none.py", "none", DomainError)


def test_the_deepest_line_of_the_users_file(tmp_path):
    file = tmp_path / "own.py"
    file.write_text("def outer(f):\n    return inner(f)\n\ndef inner(f):\n    return f()\n")
    module = load_file(file, "own_of_a_test", DomainError)
    with pytest.raises(ZeroDivisionError) as caught:
        module.outer(lambda: 1 / 0)
    message = UserFile.of("own.py", module).describe_failure(caught.value, "outer() failed")
    assert message == "own.py:5: outer() failed: ZeroDivisionError: division by zero"


def test_a_function_of_a_file(tmp_path):
    (tmp_path / "own.py").write_text("\ndef half(x, *, of=1):\n    return of / x\nVALUE = 3\n")
    half = UserFunction(tmp_path / "own.py", "half", DataError)
    assert (half(4, of=2), half.location) == (0.5, f"{tmp_path / 'own.py'}:2")
    again = pickle.loads(pickle.dumps(half))
    assert again(2) == 0.5
    with pytest.raises(DataError, match=r"own\.py:3: half\(\) failed: ZeroDivisionError: "):
        again(0)
    with pytest.raises(DataError, match=r"own\.py has no function 'VALUE'; expected one of half"):
        UserFunction(tmp_path / "own.py", "VALUE", DataError)


def test_functions_that_a_file_imports_are_not_offered(tmp_path):
    file = tmp_path / "own.py"
    file.write_text(
        "from pathlib import Path\nfrom math import sqrt\nclass Own: pass\ndef half(x): return x\n"
    )
    with pytest.raises(DataError, match=r"no function 'double'; expected one of Own, half$"):
        UserFunction(file, "double", DataError)
    file.write_text("from math import sqrt\n")
    with pytest.raises(DataError, match=r"no function 'double'; it defines no function$"):
        UserFunction(file, "double", DataError)


def test_names_of_functions():
    assert split_function("a/own.py:solve") == (Path("a/own.py"), "solve")
    assert [split_function(text) for text in ("sarsop", "own.py", "own.py:", "module:solve", ":x")] == [
        None
    ] * 5
