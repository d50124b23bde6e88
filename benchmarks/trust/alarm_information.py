"""How soon an alarm is possible at all: the information of a person about each fault of `alarm.py`.

    OMP_NUM_THREADS=1 python benchmarks/trust/alarm_information.py [--only classifier]

For each fault and noise the divergence D(truth || stated program) of a person's facts, label and answers in
nats, at the degree of noise that makes it smallest, and log(20) / D: the mean number of people until a test
that knows the fault and the noise has a likelihood ratio of 20. Decisions are those of LCORPP; all that are
more probable than 1e-7 are enumerated.
"""

from __future__ import annotations

from collections import defaultdict
from itertools import product
from typing import Annotated

import numpy as np
import typer
from alarm import NOISES, Answers, Fault, list_test_faults, make_domain, print_row, solve_planner

from lcorpp.domains import Domain
from lcorpp.domains.dialogue import DomainDialogue
from lcorpp.reasoning import Program, Reasoner
from lcorpp.trust import Hypotheses
from lcorpp.trust.answers import AnswerModel
from lcorpp.values import Array, Belief

MIN_PROBABILITY = 1e-7
History = tuple[tuple[str, str], ...]


def compute_divergence(fault: Fault, answers: Answers) -> float:
    """Return D in nats per person."""
    domain = make_domain(fault, answers)
    dialogue = DomainDialogue(domain)
    stated = AnswerModel.of_tables(dialogue.tables).noisy_log_likelihoods.transpose(
        1, 0, 2
    )  # (answers, N, V)
    tables = dialogue.tables.copy()
    tables[:, :, :2] = answers.change(tables[:, :, :2])
    model = AnswerModel.of_tables(tables)
    true = model.find_log_likelihoods(model.stated_rows)  # (answers, V)
    known, truth = (predict(domain, p) for p in (domain.program, domain.simulation.true_program))
    total, divergences = 0.0, np.zeros(stated.shape[1])
    for evidence in list_evidence(domain):
        own, right = known.predict(evidence)[0], truth.predict(evidence)[0]
        for history, p in list_histories(domain, evidence, right).items():
            heard = dialogue.find_answers(history)
            log_true = np.log(right @ np.exp(true[heard].sum(axis=0)))
            log_stated = np.log(np.exp(stated[heard].sum(axis=0)) @ own)
            divergences += p * (log_true - log_stated)
            total += p
    return float(divergences.min()) / total


def predict(domain: Domain, program: Program) -> Hypotheses:
    return Hypotheses([Reasoner(program)], np.eye(1), [""], [""], np.ones(1), domain)


def list_evidence(domain: Domain) -> list[dict[str, str]]:
    names = *domain.observed, *domain.label_attributes
    values = [domain.program.attributes[name].values for name in names]
    return [dict(zip(names, chosen, strict=True)) for chosen in product(*values)]


def list_histories(domain: Domain, evidence: dict[str, str], joint: Array) -> dict[History, float]:
    """Return each history of questions and answers with its probability, beside that of the evidence."""
    pomdp, planner = domain.pomdp, solve_planner(domain.pomdp)
    marginal = Reasoner(domain.program).posterior(domain.shared, evidence)
    assert marginal is not None
    found = defaultdict[History, float](float)
    start = joint[:, None] * domain.planning.initial_states  # (V, S)
    waiting: list[tuple[History, Belief, Array]] = [((), domain.prior(marginal), start)]
    while waiting:
        history, belief, states = waiting.pop()
        action = planner.action(belief)
        if domain.reported_value(action) is not None:
            found[history] += float(states.sum())
            continue
        a = pomdp.actions.index(action)
        for o, observation in enumerate(pomdp.observations):
            after = (states @ pomdp.transition.dense[a]) * domain.simulation.feedback_model[a, :, o]
            if after.sum() > MIN_PROBABILITY:
                updated = planner.update(belief, action, observation)
                waiting.append(((*history, (action, observation)), updated, after))
    return found


def main(only: Annotated[str, typer.Option(help="Part of the names of faults.")] = "") -> None:
    """Print a table of the faults."""
    print_row("fault", *(f"noise {noise}" for noise in NOISES), is_head=True)
    for name, fault in list_test_faults().items():
        if only in name:
            found = [compute_divergence(fault, Answers("", noise=noise)) for noise in NOISES]
            print_row(name, *(f"{d:.4f}, {np.log(20) / d:.0f}" for d in found))


if __name__ == "__main__":
    typer.run(main)
