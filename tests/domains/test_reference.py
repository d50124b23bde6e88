"""docs/reference/domain-toml.md lists the keys that the readers of a domain know."""

import re
from pathlib import Path

import pytest

from lcorpp.domains import list_domains, load_domain
from lcorpp.domains.toml import TomlTable

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "domain-toml.md"


@pytest.fixture(scope="module")
def known_keys():
    """Section -> keys that the readers access in the shipped domains."""
    found: dict[str, set[str]] = {}
    reject = TomlTable.reject_unknown_keys

    def record(table: TomlTable) -> None:
        if len(table._path) == 1:
            found.setdefault(table._path[0].partition("[")[0], set()).update(table._accessed)
        reject(table)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(TomlTable, "reject_unknown_keys", record)
        for name in list_domains():
            load_domain(name)
    return found


@pytest.mark.parametrize("section", ["reasoning", "learning", "planning", "simulation"])
def test_the_page_lists_the_keys_of_a_section(known_keys, section):
    page = PAGE.read_text(encoding="utf-8")
    part = re.search(rf"^## \[{section}\]\n(.*?)(?=^## )", page, re.MULTILINE | re.DOTALL)[1]
    cells = re.findall(r"^\| (`.*?) \| ", part, re.MULTILINE)
    keys = {
        key.split(".")[1] if "." in key else key
        for cell in cells
        for key in re.findall(r"`\[?([\w.]+)\]?`", cell)
    }
    assert keys == known_keys[section]
