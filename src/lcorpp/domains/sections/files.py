"""Files that `domain.toml` names: they lie in the domain folder."""

from __future__ import annotations

from pathlib import Path

from lcorpp.domains.toml import SHIPPED_FOLDER, TomlTable
from lcorpp.errors import DomainError
from lcorpp.input_files import is_inside
from lcorpp.user_code import split_function


def find_file(table: TomlTable, key: str, folder: Path, name: str | None = None) -> Path:
    """Return the path that a key names, in the domain folder; a `Path` in the changes of a domain as it is.

    Args:
        name: the value of the key, or a part of it; None reads it.

    Raises:
        DomainError: the path leads out of the folder, also by a link.
    """
    if name is None:
        if isinstance(table.value(key), Path):
            return Path(table.value(key))
        name = table.text(key)
    path = folder / name
    if folder.parent != SHIPPED_FOLDER and not is_inside(path, folder):
        raise DomainError(
            f"{table.location(key)}: {name!r} is outside of the domain folder; expected a file in it"
        )
    return path


def find_function(table: TomlTable, key: str, folder: Path) -> tuple[Path, str] | None:
    """Return the file and the function of ``FILE.py:NAME``; None if the value of a key is something else.

    Raises:
        DomainError: as `find_file`.
    """
    parts = split_function(table.text(key))
    return None if parts is None else (find_file(table, key, folder, str(parts[0])), parts[1])
