"""`lcorpp new`: write a domain folder from six answers."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import console
from lcorpp.errors import DecisionError, DomainError

if TYPE_CHECKING:
    from lcorpp.domains.new_domain import NewDomain

RIGHT, WRONG = 20.0, -20.0
"""Rewards of a report by default."""


def new(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="The folder, new or empty.")],
    name: Annotated[
        str | None, typer.Option(help="Name of the domain; by default that of the folder.")
    ] = None,
    fact: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE,...",
            help="An observed attribute with its values, time=morning,evening, also with probabilities,"
            " time=morning:0.3,evening; repeatable.",
        ),
    ] = None,
    shared: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE,...", help="A variable that the robot decides, wish=tea,coffee; repeatable."
        ),
    ] = None,
    sense: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[:VARIABLE][:RELIABILITY]",
            help="A classifier of a variable, gaze or gaze:wish:0.8; repeatable, none by default.",
        ),
    ] = None,
    question: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[:VARIABLE][:COST[:RELIABILITY]]",
            help="A question that the robot can ask, ask:1:0.85; without a variable one for each; repeatable,"
            " ask by default.",
        ),
    ] = None,
    right: Annotated[
        float | None, typer.Option(help=f"Reward of a right report; {RIGHT:g} by default.")
    ] = None,
    wrong: Annotated[
        float | None, typer.Option(help=f"Reward of a wrong report; {WRONG:g} by default.")
    ] = None,
    tables: Annotated[
        bool, typer.Option("--tables", help="Write the knowledge as tables, knowledge.csv, instead of P-log.")
    ] = False,
) -> None:
    """Write a domain to be edited, from answers or from options.

    `lcorpp check` and `lcorpp run` accept it as it is. Without options it asks six questions.
    """
    from lcorpp.domains.new_folder import check_new_folder, write_new_domain

    check_new_folder(folder)
    given = (name, fact, shared, sense, question, right, wrong)
    if any(value is not None and value != [] for value in given):
        if not shared:
            raise DomainError("--shared is missing; expected --shared NAME=VALUE,VALUE,...")
        own = folder.absolute().name if name is None else name
        rewards = RIGHT if right is None else right, WRONG if wrong is None else wrong
        answers = build(own, fact or [], shared, sense or [], question or [], *rewards)
    else:
        if sys.stdin is None or not sys.stdin.isatty():
            raise DomainError(
                "lcorpp new asks six questions, which needs a terminal; or give --shared NAME=VALUE,VALUE,..."
            )
        answers = ask_answers(folder.absolute().name, console.ask)
    domain = write_new_domain(folder, answers, tables=tables)
    pomdp = domain.pomdp
    sizes = f"{len(pomdp.states)} states, {len(pomdp.actions)} actions"
    values = f"{len(domain.values)} values to decide among"
    console.out.print(f"{folder}: {values}; {sizes}, {len(pomdp.observations)} observations")
    for asked in answers.questions:
        understood = f"understood rightly with probability {asked.reliability}"
        console.out.print(f"question {asked.name}, of {asked.of}: costs {asked.cost}, {understood}")
    knowledge = "knowledge.csv" if tables else "knowledge.plog"
    joined = f"which domain.toml joins (lcorpp check {folder})"
    console.out.print(f"edit its {knowledge} and interaction.py, {joined}; then: lcorpp run {folder}")


def build(
    name: str,
    facts: list[str],
    shared: list[str],
    senses: list[str],
    questions: list[str],
    right: float = RIGHT,
    wrong: float = WRONG,
) -> NewDomain:
    """Return the domain that texts describe, those of the options.

    Raises:
        DomainError: a text is wrong.
    """
    from lcorpp.domains.new_domain import NewDomain, parse_questions, parse_senses, parse_variable

    variables = tuple(map(parse_variable, shared))
    asked = questions or (["ask"] if shared else [])
    return NewDomain(
        name,
        tuple(map(parse_variable, facts)),
        variables,
        tuple([part for text in senses for part in parse_senses(text, variables)]),
        tuple([part for text in asked for part in parse_questions(text, variables)]),
        right,
        wrong,
    )


def ask_answers(folder_name: str, ask: Callable[[str], str]) -> NewDomain:
    """Ask the six questions; a wrong answer is asked again.

    Args:
        folder_name: the default name. ask: shows a question and returns the typed line, as `input` does.

    Raises:
        DecisionError: the input ended.
    """
    texts: list[list[str]] = [[], [], [], []]  # the answers to questions 2 to 5
    name, right, wrong = folder_name, RIGHT, WRONG
    for number, text in enumerate(
        (
            f"Name of the domain [{folder_name}]",
            "Facts that the robot observes, e.g. time=morning,evening kind=regular,guest; empty for none",
            "What it decides, e.g. wish=tea,coffee, or several variables: wish=tea,coffee room=lab,hall",
            "Senses that classify these, e.g. gaze:wish:0.8 (right with .8); empty for none",
            "Questions it can ask, e.g. ask:1:0.85 (cost, reliability) [ask:1:0.85]",
            f"Rewards of a right and of a wrong report [{RIGHT:g} {WRONG:g}]",
        ),
        start=1,
    ):
        while True:
            try:
                typed = ask(f"{number}. {text}: ").strip()
            except EOFError:
                raise DecisionError(f"the input ended at question {number}") from None
            try:
                if number == 1:
                    name = typed or folder_name
                elif number < 6:
                    if number == 3 and not typed:
                        raise DomainError("expected at least one variable")
                    texts[number - 2] = re.sub(r"\s*,\s*", ",", typed).split()
                elif typed:
                    right, wrong = _parse_rewards(typed)
                facts, shared, senses, questions = texts
                answers = build(name, facts, shared, senses, questions, right, wrong)
                break
            except DomainError as error:
                console.out.print(str(error), style="yellow")
    return answers


def _parse_rewards(text: str) -> tuple[float, float]:
    try:
        right, wrong = map(float, text.split())
    except ValueError:
        raise DomainError(f"{text!r}: expected two numbers") from None
    return right, wrong
