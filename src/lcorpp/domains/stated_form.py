"""A domain whose `[planning.answers]` states a form of answers: planner and people have its memory."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lcorpp.domains.dialogue import DomainDialogue
from lcorpp.domains.domain import Domain
from lcorpp.domains.form_model import FormModel
from lcorpp.domains.sections.answers import StatedAnswers
from lcorpp.errors import DomainError, TooLargeError
from lcorpp.values import Array

MAX_STATES = 5000
"""Maximum number of states of the model with the memory."""


def state_form(domain: Domain, answers: StatedAnswers, location: str) -> Domain:
    """Return the domain whose states have the memory of a form, so that everything plans with it, and people
    answer so.

    Args:
        location: of the section, for messages.

    Raises:
        DomainError: the questions cannot be followed, or the model becomes too large; or people answer
            differently where the planner makes no difference.
    """
    planning, simulation = domain.planning, domain.simulation
    try:
        dialogue = DomainDialogue(domain)
        model = FormModel(domain, dialogue, answers.form, max_states=MAX_STATES)
    except (DomainError, TooLargeError) as error:
        raise DomainError(f"{location}: {error}") from None
    shares = np.array(answers.shares)
    pomdp = model.make_model(answers.make_tables(dialogue.tables))
    pomdp = replace(pomdp, start=model.place(domain.pomdp.start, shares))
    feedback, transition = pomdp.observation.dense, None
    if not np.array_equal(simulation.feedback_model, domain.pomdp.observation.dense):
        tables = answers.make_tables(_find_tables(dialogue, simulation.feedback_model, location))
        feedback = model.make_observation(tables, simulation.feedback_model)
        own = model.make_model(tables).transition
        transition = None if np.allclose(own.dense, pomdp.transition.dense) else own
    places = model.states[:, 0]
    lifted = replace(
        planning,
        model=pomdp,
        initial_states=np.array([model.place(row, shares) for row in planning.initial_states]),
        state_values=planning.state_values[places],
        terminal=tuple(np.flatnonzero(np.isin(places, planning.terminal)).tolist()),
        problem=None,
    )
    return replace(
        domain,
        planning=lifted,
        simulation=replace(simulation, feedback_model=feedback, transition=transition),
    )


def _find_tables(dialogue: DomainDialogue, feedback: Array, location: str) -> Array:
    """Return (K, V, O) how people answer each kind of question, from (A, S, O)."""
    tables = dialogue.find_tables(feedback)
    for (action, situation), kind in dialogue.kind_of.items():
        if not np.allclose(feedback[action, list(situation)], tables[kind]):
            raise DomainError(
                f"{location}: people answer differently in situations which the planner's model does not"
                " distinguish; expected a [simulation] without `feedback`"
            )
    return tables
