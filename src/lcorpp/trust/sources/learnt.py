"""Predictions of the shared value by models that learn from people's answers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from operator import itemgetter
from typing import Any

import numpy as np

from lcorpp.errors import DecisionError
from lcorpp.protocols import DomainInterface
from lcorpp.trust.alternative import AlternativeSearch
from lcorpp.trust.answers import AnswerModel
from lcorpp.trust.latent_class_model import LatentClassModel
from lcorpp.values import Array, Label

KNOWLEDGE_PEOPLE = 20.0
"""Weight of the knowledge in the source "corrected" against the people of a context, in people."""

MAX_CONTEXTS = 4096
"""Maximum number of contexts that are learnt separately; further ones are learnt as one."""


class LearntSources:
    """The sources that learn from answers.

    learnt: a latent class model of all people. recent: of the latest people. corrected: the knowledge, which
    counts as some people in each context, and the people of the context. Several shared variables add these:
    independent: the learnt marginals of the variables, without their correlation; and for each variable the
    knowledge without it, with its learnt marginal instead.

    names: of the sources. learnt, recent: the models; the first may have an alternative.

    Args:
        stated_rates, memory: as of `LatentClassModel`.
    """

    def __init__(
        self, domain: DomainInterface, answers: AnswerModel, stated_rates: Sequence[Array], memory: float
    ) -> None:
        self.learnt = LatentClassModel(answers, stated_rates)
        self.recent = LatentClassModel(answers, stated_rates, memory=memory)
        self._search = AlternativeSearch(self.learnt)
        shared = domain.shared
        self._sizes: tuple[int, ...] = ()
        joint: tuple[str, ...] = ()
        if not isinstance(shared, str):
            self._sizes = tuple(len(set(names)) for names in zip(*domain.values, strict=True))
            joint = ("independent", *[f"knowledge without {name}" for name in shared])
        self.names = ("learnt", "recent", "corrected", *joint)
        self._contexts: dict[frozenset[tuple[str, Label]], int] = {}
        self._predictions: dict[tuple[int, ...], list[Array]] = {}  # since the last fit

    def index_context(self, facts: Mapping[str, Label]) -> int:
        """Return the index of a context; a new one is added."""
        key = frozenset(facts.items())
        context = self._contexts.get(key)
        if context is None:
            context = self._contexts[key] = min(len(self._contexts), MAX_CONTEXTS - 1)
            for model in (self.learnt, self.recent):
                if context == len(model.pi):
                    model.add_context(sorted(facts.items(), key=itemgetter(0)))
        return context

    def predict(self, context: int, labels: Sequence[int], knowledge: Array, expected: Array) -> Array:
        """Return (sources, W) P(value) of each source, with the person's class.

        Args:
            context, labels: as of `LatentClassModel.predict`.
            knowledge: (W,) P(value) by the knowledge, given facts and labels. expected: given the facts.
        """
        key = (context, *labels)
        found = self._predictions.get(key)
        if found is None:
            found = [model.predict(context, labels) for model in (self.learnt, self.recent)]
            found.append(self.learnt.predict(context, labels, prior=KNOWLEDGE_PEOPLE * expected))
            if context < MAX_CONTEXTS - 1:  # the last one is of many facts, with different `expected`
                self._predictions[key] = found
        rows = [*found]
        if self._sizes:
            known, own = knowledge.reshape(self._sizes), rows[0].reshape(self._sizes)
            axes = range(own.ndim)
            marginals = [own.sum(axis=tuple(b for b in axes if b != a), keepdims=True) for a in axes]
            independent = np.ones(())
            for marginal in marginals:
                independent = independent * marginal
            rows.append(independent.ravel())
            rows += [(known.sum(axis=a, keepdims=True) * marginals[a]).ravel() for a in axes]
        return np.array(rows)

    def add(self, context: int, labels: Sequence[int], answers: Sequence[int]) -> None:
        """Add a person, see `Cases.add`."""
        for model in (self.learnt, self.recent):
            model.add(context, labels, answers)

    def fit(self, iterations: int, *, search: int = 0) -> None:
        """Run EM on both models and the alternative; O is estimated from all people.

        Args:
            search: iterations of EM in a search for alternative estimates; 0: no search.
        """
        self._predictions.clear()
        self.learnt.fit(iterations)
        is_replaced = self._search.choose()
        if search:
            is_replaced |= self._search.search(search)
        if is_replaced:  # the recent people follow, in their own cases
            self.recent.estimates = self.learnt.estimates
        self.recent.prior_rates = list(self.learnt.rates)
        self.recent.fit(iterations, self.learnt.rows)

    def replace_rates(self, stated_rates: Sequence[Array]) -> bool:
        """Replace the stated rates, see `LatentClassModel.replace_rates`; return whether any differ."""
        self._predictions.clear()
        changed = [model.replace_rates(stated_rates) for model in (self.learnt, self.recent)]
        return any(changed)

    def state(self) -> dict[str, Any]:
        """Return the contexts, in their order, and both models as JSON."""
        contexts = [sorted(context, key=itemgetter(0)) for context in self._contexts]
        return {
            "contexts": contexts,
            "learnt": self.learnt.state(),
            "recent": self.recent.state(),
            "searches": self._search.n_searches,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a state, before the first context is added.

        Raises:
            DecisionError: there are already contexts.
        """
        if self._contexts:
            raise DecisionError("trust has already made predictions; expected a new one")
        for facts in state["contexts"]:
            self.index_context(dict(facts))
        self.learnt.restore(state["learnt"])
        self.recent.restore(state["recent"])
        self._search.n_searches = int(state["searches"])
