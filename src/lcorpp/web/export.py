"""The page as one file without a server: markup, style, modules and model inline."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from lcorpp.errors import FileError
from lcorpp.files import read_text
from lcorpp.web.model import write_model

IMPORT = re.compile(r'^import \{([^}]*)\} from "(\.[^"]*)";\n', re.MULTILINE)
EXPORT = re.compile(r"^export (?=(?:async )?(?:function|class|const) (\w+))", re.MULTILINE)
MODULE_SYNTAX = re.compile(r"^\s*(?:import|export)\b.*$", re.MULTILINE)
STYLE = '<link rel="stylesheet" href="style.css">'
SCRIPT = '<script type="module" src="main.js"></script>'
"""The lines of index.html that name the files which are put in their place."""


def bundle_page(folder: Path, model: Mapping[str, Any]) -> str:
    """Return the page as one file, which makes no request.

    Browsers do not load modules from `file://`, so they become functions in one script. The policy of the
    page permits exactly this style and this script, by their hashes.

    Args:
        folder: the page's files: index.html, style.css, main.js and the modules that it imports.
        model: see `make_exported_model`.

    Raises:
        FileError: a file is missing, or index.html does not name the style and the script.
    """
    page, style = read_text(folder / "index.html"), read_text(folder / "style.css")
    script = f"globalThis.LCORPP_MODEL = {write_model(model)};\n{bundle_modules(folder / 'main.js')}"
    if any(text in script for text in ("</script", "<!--")) or "</style" in style:
        raise FileError(f"{folder}: a script or the style contains its own end tag, or a script <!--")
    policy = (
        f"default-src 'none'; script-src '{_hash(script)}'; style-src '{_hash(style)}'; img-src data:;"
        " base-uri 'none'; form-action 'none'"
    )
    parts = {
        "<head>": f'<head>\n<meta http-equiv="Content-Security-Policy" content="{policy}">',
        STYLE: f"<style>{style}</style>",
        SCRIPT: "",
        "</body>": f"<script>{script}</script>\n</body>",
    }
    for line, replacement in parts.items():
        if page.count(line) != 1:
            raise FileError(f"{folder / 'index.html'}: expected {line} once, found {page.count(line)}")
        page = page.replace(line, replacement)
    return page


def bundle_modules(main: Path) -> str:
    """Return a module and those that it imports as one script of functions that return exports.

    Modules import names from each other, and export functions, classes and constants at the beginning of a
    line.

    Raises:
        FileError: a file is missing, modules import each other, or import or export in another way.
    """
    numbers, texts, begun = dict[Path, int](), list[str](), list[Path]()

    def add(path: Path) -> int:
        if path in begun:
            circle = " -> ".join(own.name for own in [*begun[begun.index(path) :], path])
            raise FileError(f"{path}: modules import each other: {circle}")
        if path not in numbers:
            begun.append(path)
            texts.append(_wrap_module(path, add))
            numbers[path] = len(texts) - 1
            begun.pop()
        return numbers[path]

    add(main.resolve())
    functions = [f"const module{i} = (() => {{\n{text}}})();\n" for i, text in enumerate(texts)]
    return f'"use strict";\n{"".join(functions)}'


def _wrap_module(path: Path, add: Callable[[Path], int]) -> str:
    """Return the body of a module's function, which takes its imports from the constants of other modules.

    Args:
        add: adds a module that this one imports, and returns its number.
    """
    text = read_text(path)
    lines = []
    for names, target in IMPORT.findall(text):
        number = add((path.parent / target).resolve())
        lines.append(f"const {{{names.replace(' as ', ': ')}}} = module{number};\n")
    body = EXPORT.sub("", IMPORT.sub("", text))
    if other := MODULE_SYNTAX.search(body):
        raise FileError(
            f'{path}: {other[0].strip()!r}; expected `import {{name}} from "./file.js";` or `export` and a'
            " function, class or const"
        )
    return f"{''.join(lines)}{body}\nreturn {{{', '.join(EXPORT.findall(text))}}};\n"


def _hash(text: str) -> str:
    digest = hashlib.sha256(text.encode()).digest()
    return f"sha256-{base64.b64encode(digest).decode()}"
