"""Write the folder of a new domain: domain.toml, knowledge.plog and interaction.py."""

from __future__ import annotations

import json
import os
import re
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path

from lcorpp.domains.domain import Domain
from lcorpp.domains.loading import load_domain
from lcorpp.domains.new_domain import TERMINAL, NewDomain
from lcorpp.errors import DomainError, FileError
from lcorpp.files import make_folder
from lcorpp.reasoning import parse_plog, table_text

MODEL_SOURCE = Path(__file__).parent / "new_interaction.py"
"""The model of new domains, of which the folder gets a copy with the numbers of the answers."""


def check_new_folder(folder: Path) -> None:
    """Check that a folder is missing or empty.

    Raises:
        DomainError: it is neither.
    """
    if folder.is_symlink() or folder.resolve() == Path.cwd():
        raise DomainError(f"{folder}: a link or the working folder; expected a new or an empty folder")
    if folder.exists() and not (folder.is_dir() and not any(folder.iterdir())):
        raise DomainError(f"{folder}: exists; expected a new or an empty folder")


def write_new_domain(folder: Path, new: NewDomain, *, tables: bool = False) -> Domain:
    """Write the folder of a domain completely or not at all, and return the domain.

    Args:
        tables: whether to write the knowledge as tables, knowledge.csv, instead of knowledge.plog.

    Raises:
        DomainError: the folder is not empty, or the answers lack a shared variable or a question.
        FileError: the folder cannot be written.
    """
    check_new_folder(folder)
    if not new.shared:
        raise DomainError("no shared variable is given; expected at least one")
    if not new.questions:
        raise DomainError("no question is given; expected at least one")
    knowledge = format_knowledge(new)
    own = {"knowledge.csv": format_tables(knowledge)} if tables else {"knowledge.plog": knowledge}
    write_folder(
        folder, {"domain.toml": format_toml(new, tables), **own, "interaction.py": format_model(new)}
    )
    return load_domain(folder)


def write_folder(folder: Path, texts: Mapping[str, str]) -> None:
    """Write the files of a folder, all or none; with a domain.toml, the domain is loaded before.

    Raises:
        DomainError: the folder is not empty, or the domain has an error.
        FileError: the folder cannot be written.
    """
    check_new_folder(folder)
    parent = make_folder(folder.absolute().parent)
    try:
        with tempfile.TemporaryDirectory(prefix=".lcorpp-", dir=parent, ignore_cleanup_errors=True) as name:
            complete = Path(name) / "domain"
            complete.mkdir()
            for file, text in texts.items():
                (complete / file).write_text(text, encoding="utf-8")
            if "domain.toml" in texts:
                load_domain(complete)
            shutil.rmtree(complete / "__pycache__", ignore_errors=True)
            if folder.exists():
                folder.rmdir()  # empty; a rename replaces empty folders on some systems only
            os.rename(complete, folder)
    except OSError as error:
        raise FileError(f"{folder}: cannot be written: {error.strerror or error}") from None


def format_tables(knowledge: str) -> str:
    """Return the text of knowledge.csv, given that of knowledge.plog."""
    head = (
        "# What is known about people: edit the numbers. A row is for values of the columns before it;\n"
        "# a blank cell there is for all others. For attributes that depend on another, add its column.\n\n"
    )
    return head + table_text(parse_plog(knowledge))


def format_toml(new: NewDomain, tables: bool = False) -> str:
    """Return the text of domain.toml."""
    shared = [variable.name for variable in new.shared]
    pattern = "_".join(f"{{{name}}}" for name in shared)
    lines = [
        f"name = {json.dumps(new.name, ensure_ascii=False)}",
        f"description = {json.dumps(f'What is the {join_words(shared)}?', ensure_ascii=False)}",
        "",
        "[reasoning]",
        'program = "knowledge.csv"         # what is known about people; edit it in a spreadsheet'
        if tables
        else 'program = "knowledge.plog"        # P-log: what is known about people; edit the numbers there',
        f"observed = {json.dumps([fact.name for fact in new.facts])}",
        f"shared = {json.dumps(shared)}",
        "",
    ]
    values = {variable.name: variable.values for variable in new.shared}
    for sense in new.senses:
        labels = ", ".join(f'{sense.label(value)} = "{value}"' for value in values[sense.of])
        lines += [
            "[[learning]]",
            f'name = "{sense.name}"',
            f'attribute = "{sense.name}"',
            f'of = "{sense.of}"',
            f"labels = {{ {labels} }}",
            'classifier = "channel"            # simulated at the rates of the knowledge',
            "",
        ]
    lines += [
        "[planning]",
        'model = "interaction.py:make_model"   # costs, rewards and reliabilities are there',
        f'states = "{pattern}"',
        f'terminal = "{TERMINAL}"',
        f'reports = "report_{pattern}"',
        "precision = 0.01                  # solving stops at this gap between the bounds,",
        "time_limit = 30                   # or after these seconds",
    ]
    return "\n".join(lines) + "\n"


def format_knowledge(new: NewDomain) -> str:
    """Return the text of knowledge.plog."""
    values = {variable.name: variable.values for variable in new.variables}
    labels = {s.name: tuple([s.label(value) for value in values[s.of]]) for s in new.senses}
    ranges = {**values, **labels}
    lines = [f"% What is known about people in the domain {new.name}: edit the numbers, add rules.", ""]
    lines += [f"{name}_values = {{{', '.join(names)}}}." for name, names in ranges.items()]
    lines += ["", *[f"{name} : {name}_values." for name in ranges]]
    lines += ["", *[f"random({name})." for name in ranges]]
    lines += ["", "% Values without a number share the rest equally."]
    lines += [f"pr({v.name}={value}) = {rate}." for v in new.variables for value, rate in v.rates]
    if len(new.variables) > 1:
        lines.append("% Rules such as these make them depend on each other:")
    for k, variable in enumerate(new.shared):
        for cause in (*new.facts, *new.shared[:k])[:1]:
            lines.append(
                f"% pr({variable.name}={variable.values[0]} | {cause.name}={cause.values[0]}) = 0.7."
            )
    for sense in new.senses:
        lines += [
            "",
            f"% How often {sense.name} is right; a trained classifier's matrix replaces these rules.",
        ]
        lines += [
            f"pr({sense.name}={sense.label(value)} | {sense.of}={value}) = {sense.reliability}."
            for value in values[sense.of]
        ]
    return "\n".join(lines) + "\n"


def format_model(new: NewDomain) -> str:
    """Return the text of interaction.py: the model of new domains with the numbers of the answers."""
    questions = "".join(
        f'    "{q.name}": ("{q.of}", {float(q.cost)!r}, {float(q.reliability)!r}),\n' for q in new.questions
    )
    text = MODEL_SOURCE.read_text(encoding="utf-8")
    text = re.sub(r"(?<=^QUESTIONS = \{\n).*?(?=^\})", questions, text, flags=re.DOTALL | re.MULTILINE)
    return re.sub(r"(?<=^RIGHT, WRONG = ).*", f"{new.right!r}, {new.wrong!r}", text, flags=re.MULTILINE)


def join_words(words: list[str]) -> str:
    """Return "a", "a and b" or "a, b and c"."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
