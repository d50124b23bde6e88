"""Questions to a factor graph: which variables are kept, observed or weighted, and the plan for each kind.

A plan is an elimination order with the sums that depend on no evidence, or are computed for all values that
they observe; new evidence of the same kind repeats only the others. Its cost is known before it starts.

Source: Dechter, "Bucket elimination: a unifying framework for reasoning", Artificial Intelligence 113, 1999.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress

import numpy as np
import numpy.typing as npt

from lcorpp.errors import TooLargeError
from lcorpp.reasoning.evidence import Codes, EncodedEvidence
from lcorpp.reasoning.factors._tables import Network, Plan
from lcorpp.reasoning.factors.factor_graph import FactorGraph, make_network_graph
from lcorpp.reasoning.language.networks.bayesian_network import BayesianNetwork
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.questions import is_joint, list_question_terms, list_terms
from lcorpp.values import Array

MAX_BYTES = 2**31
"""Maximum memory of the sums of a plan, and of all plans that are kept."""

MAX_COST = 2e10
"""Maximum number of multiplications of a plan, about a minute."""

SECONDS = 3e-9
"""A multiplication takes about this long."""

MIN_MARGINALS = 4
"""At least this many questions are answered together, by a downward pass."""

MAX_PLANS = 100
"""Plans of at most this many kinds of evidence are cached."""


class TableNetwork:
    """The factors of a program, which answers questions by sums of their products.

    graph: the factors.
    """

    def __init__(self, graph: FactorGraph) -> None:
        self.graph = graph
        factors = graph.factors
        if not graph.has_worlds:
            factors = ()
        self._network = Network(
            [len(outcomes) or 1 for outcomes in graph.outcomes],  # none if there is no world
            [list(factor.scope) for factor in factors],
            [factor.table for factor in factors],
            [factor.child for factor in factors],
        )
        self._plans: dict[object, Plan] = {}
        self._simple_plans: dict[object, Plan | None] = {}

    def __repr__(self) -> str:
        return f"TableNetwork({self.graph!r})"

    def __reduce__(self) -> tuple[type[TableNetwork], tuple[FactorGraph]]:
        return TableNetwork, (self.graph,)

    def find_plan(
        self, kept: Sequence[int], observed: Sequence[int], weighted: Sequence[int], marginals: bool = False
    ) -> Plan:
        """Find the plan for a kind of question.

        Raises:
            TooLargeError: it takes more memory or time than the limits.
        """
        key = tuple(kept), tuple(observed), tuple(weighted), marginals
        plan = self._plans.get(key)
        if plan is None:
            plan = self._network.plan(list(kept), list(observed), list(weighted), marginals)
            if plan.memory > MAX_BYTES or plan.cost > MAX_COST:
                limits = f"expected at most {MAX_BYTES >> 20} MiB and {MAX_COST * SECONDS:.3g} s"
                raise TooLargeError(
                    f"{self.graph.program.source.file}: an exact answer {describe_cost(plan)}; {limits}"
                )
            in_use = sum([other.memory for other in self._plans.values()])
            if len(self._plans) >= MAX_PLANS or in_use + plan.memory > MAX_BYTES:
                self._plans.clear()
                self._simple_plans.clear()
            self._plans[key] = plan
        return plan

    def weigh(self, terms: Sequence[str], names: Sequence[str], evidence: EncodedEvidence) -> Array:
        """(B, outcomes of each term) Compute the joint weights of terms; only ratios in a row matter.

        Args:
            names: the observed terms, in the order of the evidence; an outcome is a value or, last, none.
        """
        graph = self.graph
        variables = [graph.variable_of[term] for term in terms]
        values = graph.program.values
        sizes = [len(values[graph.terms[v]]) + 1 for v in variables]
        n_rows = len(evidence.codes)
        result = np.zeros((n_rows, *sizes))
        if not graph.has_worlds:
            return result
        for rows, observed, codes, weighted, weights in self._split(names, evidence):
            kept = [v for v in variables if v not in observed]
            plan = self.find_plan(kept, observed, weighted)
            found, _ = plan.evaluate(codes, weights)
            index: list[Codes] = [rows.reshape(-1, *[1] * len(terms))]
            for axis, v in enumerate(variables):
                shape = [1] * (len(terms) + 1)
                outcomes = np.array(graph.outcomes[v], dtype=np.intp)
                if v in observed:
                    own, shape[0] = outcomes[codes[:, observed.index(v)]], len(rows)
                else:
                    own, shape[axis + 1] = outcomes, len(outcomes)
                index.append(own.reshape(shape))
            free = [1 if v in observed else len(graph.outcomes[v]) for v in variables]
            result[tuple(index)] = found.reshape(len(rows), *free)
        return result

    def find_simple_plan(self, question: str, names: tuple[str, ...]) -> Plan | None:
        """Find the plan for one term given values of others, with the codes of `EvidenceEncoder`.

        Returns:
            None if some of the values are impossible, or the evidence names the term.
        """
        key = question, names
        if key not in self._simple_plans:
            if len(self._simple_plans) >= MAX_PLANS:
                self._simple_plans.clear()
            self._simple_plans[key] = self._make_simple_plan(question, names)
        return self._simple_plans[key]

    def _make_simple_plan(self, question: str, names: tuple[str, ...]) -> Plan | None:
        graph = self.graph
        if is_joint(question) or question in names or not graph.has_worlds:
            return None
        variables = [graph.variable_of[name] for name in (question, *names)]
        if any(
            list(graph.outcomes[v]) != list(range(len(graph.program.values[graph.terms[v]])))
            for v in variables
        ):
            return None
        return self.find_plan(variables[:1], variables[1:], ())

    def weigh_questions(
        self, questions: Sequence[str], names: Sequence[str], evidence: EncodedEvidence
    ) -> dict[str, Array]:
        """Compute the weights of several questions, see `weigh_question`."""
        if _are_marginals(questions):
            with suppress(TooLargeError):  # each alone may need fewer tables
                found = self.weigh_all(names, evidence)
                return {question: found[question] for question in questions}
        return {question: self.weigh_question(question, names, evidence) for question in questions}

    def estimate_cost(self, questions: Sequence[str], given: Sequence[str]) -> float:
        """Estimate the multiplications that `weigh_questions` takes if all terms are observed.

        Raises:
            TooLargeError: one of the plans is too large.
        """
        variable_of = self.graph.variable_of
        observed = list(dict.fromkeys([variable_of[term] for term in given]))
        if _are_marginals(questions):
            return self.find_plan((), observed, (), True).cost
        cost = 0.0
        for question in questions or [""]:
            kept = [variable_of[term] for term in list_question_terms(question)]
            cost += self.find_plan(kept, [v for v in observed if v not in kept], ()).cost
        return cost

    def weigh_question(self, question: str, names: Sequence[str], evidence: EncodedEvidence) -> Array:
        """(B, values + 1) Compute the weights of the values of a question and, last, of having none."""
        if not is_joint(question):
            return self.weigh([question], names, evidence)
        weights = self.weigh(list_terms(question), names, evidence)
        n_rows = len(weights)
        inside = (slice(None), *[slice(-1)] * (weights.ndim - 1))
        values = weights[inside].reshape(n_rows, -1).copy()
        weights[inside] = 0.0
        return np.hstack([values, weights.reshape(n_rows, -1).sum(axis=1, keepdims=True)])

    def weigh_all(self, names: Sequence[str], evidence: EncodedEvidence) -> dict[str, Array]:
        """(B, outcomes) Compute the weights of each queried term of the graph, see `weigh`."""
        graph, n_rows = self.graph, len(evidence.codes)
        ends = np.cumsum([len(outcomes) for outcomes in graph.outcomes])
        values = graph.program.values
        result = {
            name: np.zeros((n_rows, len(values[graph.terms[v]]) + 1)) for name, v in graph.variable_of.items()
        }
        for rows, observed, codes, weighted, weights in (
            self._split(names, evidence) if graph.has_worlds else ()
        ):
            found, _ = self.find_plan((), observed, weighted, True).evaluate(codes, weights)
            for name, v in graph.variable_of.items():
                outcomes = graph.outcomes[v]
                result[name][rows[:, None], np.array(outcomes)] = found[:, ends[v] - len(outcomes) : ends[v]]
        return result

    def _split(
        self, names: Sequence[str], evidence: EncodedEvidence
    ) -> list[tuple[Codes, list[int], npt.NDArray[np.int64], list[int], Array]]:
        """Split rows of evidence by the terms that they observe; impossible rows are left out.

        Returns:
            For each kind the rows, the observed variables, their codes, the weighted ones, their weights.
        """
        graph = self.graph
        variables = [graph.variable_of[name] for name in names]
        codes = evidence.codes.astype(np.int64)
        weighted = [v for i, v in enumerate(variables) if i in evidence.weights]
        possible = np.ones(len(codes), dtype=np.bool_)
        hard: list[int] = []
        parts: list[Array] = []
        for i, v in enumerate(variables):
            outcomes = graph.outcomes[v]
            if i in evidence.weights:
                parts.append(evidence.weights[i][codes[:, i]][:, outcomes])
                continue
            hard.append(i)
            if outcomes[-1] != len(outcomes) - 1:  # not all of the outcomes before the last are possible
                code_of = np.full(outcomes[-1] + 3, -2, dtype=np.int64)
                code_of[outcomes] = np.arange(len(outcomes))
                code_of[-1] = -1  # no evidence
                codes[:, i] = code_of[np.minimum(codes[:, i], outcomes[-1] + 1)]
            else:
                codes[:, i] = np.where(codes[:, i] >= len(outcomes), -2, codes[:, i])
            possible &= codes[:, i] != -2
        weights = np.concatenate([np.zeros((len(codes), 0)), *parts], axis=1)
        own = codes[:, hard]
        rows = np.flatnonzero(possible)
        if len(codes) == 1:
            kinds = [(rows, own[0] >= 0)] if len(rows) else []
        else:
            masks, number = np.unique(own[rows] >= 0, axis=0, return_inverse=True)
            kinds = [(rows[number.ravel() == n], mask) for n, mask in enumerate(masks)]
        split = []
        for chosen, mask in kinds:
            columns = np.flatnonzero(mask)
            observed = [variables[hard[k]] for k in columns.tolist()]
            split.append(
                (
                    chosen,
                    observed,
                    np.ascontiguousarray(own[np.ix_(chosen, columns)]),
                    weighted,
                    np.ascontiguousarray(weights[chosen]),
                )
            )
        return split


def make_table_network(network: Program, do: Mapping[str, str]) -> TableNetwork:
    """Make the tables of a Bayesian network with interventions, term -> value."""
    assert isinstance(network, BayesianNetwork)
    return TableNetwork(make_network_graph(network, do))


def describe_cost(plan: Plan) -> str:
    """Describe what a plan costs: its largest table, memory and time."""
    memory, seconds = plan.memory / 2**20, plan.cost * SECONDS
    return (
        f"sums a table of {2**plan.width:.3g} entries, about {max(memory, 1):.3g} MiB and"
        f" {max(seconds, 0.01):.2g} s"
    )


def _are_marginals(questions: Sequence[str]) -> bool:
    """Whether a downward pass over all variables answers the questions."""
    return len(questions) >= MIN_MARGINALS and not any(map(is_joint, questions))
