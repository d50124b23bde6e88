"""How often an audit names the form of the answers.

    OMP_NUM_THREADS=1 python benchmarks/trust/named_forms.py [--logs 50] [--people 2000] [--rows TEXT]
        [--seed 0] [--jobs 2] [--out TABLE.md]

LCORPP decides about the people of `answer_forms.py`, and each log is audited for the form of the answers.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from answer_forms import ROWS, People, draw_crowd, print_table
from joblib import Parallel, delayed

from lcorpp.audit.answer_forms import list_form_tests
from lcorpp.audit.estimates import choose_form
from lcorpp.audit.logged_people import AnsweredPerson, LoggedPeople
from lcorpp.decision import Robot, dt_control
from lcorpp.domains.dialogue import DomainDialogue
from lcorpp.trust.cases import Cases
from lcorpp.trust.sources.stated import StatedSources

HEADER = """| people | named |
|---|---|
"""

NAMED = (
    "worse with each question",
    "worse, mild",
    "better with each question",
    "the same answer again, .2",
    "two classes, .05 and .45",
    "noise .3",
    "as stated",
)
"""Rows of `answer_forms.ROWS`."""


def name_form(people: People, count: int, seed: Sequence[int]) -> str:
    """Return the form that is named in a log; "none" if independent answers are not refuted."""
    crowd = draw_crowd(people, count, seed)
    domain, dialogue = crowd.domain, DomainDialogue(crowd.domain)
    stated = StatedSources(crowd.reasoner, domain, domain.marginal(crowd.planner.start))
    attributes = stated.attributes
    labels, rates = zip(*(stated.compute_rates(attribute) for attribute in attributes), strict=True)
    contexts = dict[tuple[tuple[str, str], ...], int]()
    cases = Cases(len(attributes), dialogue.tables.shape[0] * dialogue.tables.shape[2])
    answered = list[AnsweredPerson]()
    robot = Robot(crowd.channels, crowd.reasoner, crowd.planner, domain)
    for instance, world in zip(crowd.instances, crowd.make_worlds(), strict=True):
        episode = dt_control(robot, instance, world)
        history = [(x.action, x.observation) for x in episode.steps if x.observation is not None]
        facts = tuple((attribute, str(episode.evidence[attribute])) for attribute in domain.observed)
        context = contexts.setdefault(facts, len(contexts))
        own = [names.index(str(episode.evidence[a])) for a, names in zip(attributes, labels, strict=True)]
        answered.append((context, own, dialogue.find_answers(history)))
        cases.add(*answered[-1])
    names = [dict(facts) for facts in contexts]
    log = LoggedPeople(
        domain, domain.program, dialogue, names, labels, rates, cases, "LCORPP", 0, {}, {}, answered
    )
    form = choose_form(list_form_tests(log, rates))
    return "none" if form is None else form.name


def main(
    logs: Annotated[int, typer.Option(min=1)] = 50,
    people: Annotated[int, typer.Option(min=100, help="People a log.")] = 2000,
    rows: Annotated[str, typer.Option(help="Rows of the table whose name contains this.")] = "",
    seed: Annotated[int, typer.Option(min=0)] = 0,
    jobs: Annotated[int, typer.Option(min=1)] = 1,
    out: Annotated[Path | None, typer.Option(dir_okay=False)] = None,
) -> None:
    """Audit logs of people and print how often each form is named."""

    def make_row(number: int, name: str) -> str:
        calls = (delayed(name_form)(ROWS[name], people, (seed, number, k)) for k in range(logs))
        found = list(Parallel(n_jobs=jobs)(calls))
        named = ", ".join(f"{form} {found.count(form)}" for form in dict.fromkeys(found))
        return f"| {name} | {named} |\n"

    print_table(HEADER, NAMED, rows, make_row, out)


if __name__ == "__main__":
    typer.run(main)
