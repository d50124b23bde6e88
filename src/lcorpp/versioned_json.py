"""JSON objects that begin with the name of their format and its version."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from lcorpp.errors import DataError


@dataclass(frozen=True)
class JsonFormat:
    """A format of JSON objects.

    name: e.g. "lcorpp circuit". version: that is written. older: versions that are read, too.
    """

    name: str
    version: int
    older: tuple[int, ...] = ()

    @property
    def header(self) -> dict[str, Any]:
        """The first fields of each object."""
        return {"format": self.name, "version": self.version}

    def read(self, text: str | bytes) -> dict[str, Any]:
        """Return the object of this format; its other fields are not checked.

        Raises:
            DataError: the text is not JSON, not an object, or of another format or version.
        """
        try:
            content = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise DataError(f"it is damaged, not JSON: {error}") from None
        if not isinstance(content, dict) or "format" not in content:
            raise DataError(
                f'it is damaged or of another kind; expected an object with "format": "{self.name}"'
            )
        if content["format"] != self.name:
            raise DataError(f"its format is {content['format']!r}; expected {self.name!r}")
        version = content.get("version")
        if version not in (*self.older, self.version):
            known = ", ".join(map(str, (*self.older, self.version)))
            versions = "versions" if self.older else "version"
            raise DataError(f"its version is {version!r}; this lcorpp reads {versions} {known}")
        return content
