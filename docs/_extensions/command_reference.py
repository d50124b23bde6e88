"""The reference of commands, from Typer.

    ```{command} solve
    ```

is replaced by help, usage, arguments and options of `lcorpp solve`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import typer
from blocks import expand_blocks

from lcorpp.cli.app import app as lcorpp_app

DOCS = Path(__file__).parents[1]
_FACTS = re.compile(r"(\s*\[(?:default: |required|-?[\d.]+<|x[<>])[^\[\]]*\])+$")
_CODE = re.compile(
    r"(`[^`]*`|(?<![\w-])--?[a-z][\w-]*|[A-Z]\w*\.py:[A-Z]+|(?<!\w)[\w./-]*\.(?:md|py|toml|npz|html|json|plog)\b)"
)


def list_commands() -> list[str]:
    """Return the names of all commands, those of groups as `data make`."""
    root = typer.main.get_command(lcorpp_app)
    return [name for name, command in _walk(root, "") if not hasattr(command, "commands")]


def _walk(command: Any, name: str) -> Iterator[tuple[str, Any]]:
    yield name, command
    for part in getattr(command, "commands", ()):
        yield from _walk(command.commands[part], f"{name} {part}".strip())


def describe_command(name: str) -> str:
    """Return Markdown about a command: help, usage, arguments and options; "lcorpp" itself has options, too.

    Raises:
        KeyError: there is no such command.
    """
    command, context = _find(name)
    title = "lcorpp" if name == "lcorpp" else f"lcorpp {name}"
    usage = " ".join(command.collect_usage_pieces(context))
    parts = [] if name == "lcorpp" else [_format_text(command.help)]
    parts += [f"```sh\n{title} {usage}\n```", f"```{{program}} {title}\n```"]
    parts += [_describe_parameter(signature, text) for signature, text in list_parameters(name)]
    return "\n\n".join(parts) + "\n"


def list_parameters(name: str) -> list[tuple[str, str]]:
    """Return signature and help of each argument and option of a command, without --help."""
    command, context = _find(name)
    records = [parameter.get_help_record(context) for parameter in command.get_params(context)]
    return [record for record in records if record and "--help" not in record[0]]


def _find(name: str) -> tuple[Any, Any]:
    command = typer.main.get_command(lcorpp_app)
    context = command.context_class(command, info_name="lcorpp")
    for part in [] if name == "lcorpp" else name.split():
        command = command.commands[part]
        context = command.context_class(command, info_name=part, parent=context)
    return command, context


def _describe_parameter(signature: str, text: str) -> str:
    text, facts = _split_facts(text)
    shown = "".join(f" *{_format_text(fact)}.*" for fact in facts)
    return f"````{{option}} {signature.replace(' / ', ', ')}\n{_format_text(text)}{shown}\n````"


def _split_facts(text: str) -> tuple[str, list[str]]:
    """Split the default and the range, in brackets, from the end of a help text."""
    tail = _FACTS.search(text)
    if not tail:
        return text, []
    facts = re.split(r"; |\]\s*\[", tail[0].strip(" []"))
    named = (fact if re.match("default|required", fact) else f"range: {fact}" for fact in facts)
    return text[: tail.start()], [fact[0].upper() + fact[1:] for fact in named]


def _format_text(text: str) -> str:
    """Return a help text as Markdown: options and files as code, pages as links, nothing else marked."""

    def mark(part: str) -> str:
        part = part.strip("`")
        page = part.removeprefix("docs/")
        return f"[{part}](/{page})" if page != part and (DOCS / page).exists() else f"`{part}`"

    parts = _CODE.split(text.replace("\b", ""))
    return "".join(
        mark(part) if k % 2 else re.sub(r"([\\*_<>|\[\]$])", r"\\\1", part) for k, part in enumerate(parts)
    )


def _read_page(app: Any, docname: str, source: list[str]) -> None:
    def expand(name: str, _options: Mapping[str, str]) -> str:
        return describe_command(name)

    source[0] = expand_blocks(source[0], "command", expand)


def setup(app: Any) -> dict[str, Any]:
    """Connect to Sphinx."""
    app.connect("source-read", _read_page)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
