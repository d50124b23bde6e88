"""A domain: translates between the names of classifiers, reasoner and planner."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lcorpp.domains.reasoners import make_reasoner
from lcorpp.domains.sections.learning import Sense
from lcorpp.domains.sections.noisy_channels import is_joint
from lcorpp.domains.sections.planning import PlanningSection
from lcorpp.domains.sections.reasoning import ReasoningSection
from lcorpp.domains.sections.simulation import SimulationSection
from lcorpp.domains.start_beliefs import StartBeliefs, list_start_beliefs
from lcorpp.errors import DomainError, expected_one_of
from lcorpp.notebook import html_table, join_some
from lcorpp.planning import Pomdp, SparseTables
from lcorpp.protocols import Reasoner
from lcorpp.reasoning import Program
from lcorpp.values import (
    JEFFREYS,
    Array,
    Belief,
    ConfusionMatrix,
    Distribution,
    Indices,
    Label,
    Likelihood,
    SharedValue,
    format_value,
)

if TYPE_CHECKING:
    from lcorpp.planning import GenerativeModel

TERMINAL_TOLERANCE = 1e-9
"""Rounding error of the probability 1 of the terminal states."""


@dataclass(frozen=True, eq=False, repr=False)
class Domain:
    """Contents of a domain folder, checked as a whole by `load_domain`.

    name, description: for reports. folder: its path.
    preset: name of the chosen preset, or names with commas; None without one.
    reasoning, planning, simulation: the sections of its `domain.toml`.
    senses: the sections `[[learning]]`, none for a robot without classifiers. baselines: those that only the
        strategies of their names use.

    Examples:
        >>> from lcorpp import load_domain
        >>> domain = load_domain("intention")
        >>> domain.observed, domain.values
        (('time', 'location'), ('interested', 'not_interested'))
        >>> domain.evidence({"time": "morning"}, {"motion": "interested"})
        {'time': 'morning', 'classifier': 'one'}
    """

    name: str
    description: str
    folder: Path
    preset: str | None
    reasoning: ReasoningSection
    senses: tuple[Sense, ...]
    planning: PlanningSection
    simulation: SimulationSection
    baselines: tuple[Sense, ...] = ()

    def __repr__(self) -> str:
        preset = f", preset {self.preset!r}" if self.preset else ""
        shared, kind = self.reasoning.shared, "POMDP" if isinstance(self.model, Pomdp) else "simulated model"
        values = ", ".join(map(str, self.values)) if len(shared) == 1 else f"{len(self.values)} values"
        senses = f"; senses {', '.join(sense.name for sense in self.senses)}" if self.senses else ""
        return (
            f"Domain({self.name!r}{preset}: observes {', '.join(self.observed) or 'nothing'}{senses}; shares"
            f" {', '.join(shared)} ({values}); {kind} with {self.model_size})"
        )

    def _repr_html_(self) -> str:
        values = join_some([format_value(value) for value in self.values])
        rows = [
            ("observed facts", ", ".join(self.observed)),
            *[(f"sense {sense.name}", f"classes {', '.join(sense.classes)}") for sense in self.senses],
            ("shared", f"{', '.join(self.reasoning.shared)}: {values}"),
            *[(part, join_some(getattr(self.model, part))) for part in ("states", "actions", "observations")],
        ]
        return html_table(("part", "contents"), rows, caption=f"Domain {self.name}. {self.description}")

    @property
    def program(self) -> Program:
        """The P-log program of what the robot knows: theta."""
        return self.reasoning.program

    @property
    def observed(self) -> tuple[str, ...]:
        """The attributes that the robot observes as facts."""
        return self.reasoning.observed

    @property
    def shared(self) -> str | tuple[str, ...]:
        """The attribute shared by reasoner and planner, or the tuple of several."""
        return self.reasoning.subject

    @property
    def values(self) -> tuple[SharedValue, ...]:
        """The values of the shared attribute, in the order of their declaration; of several, all tuples."""
        return self.reasoning.values

    @property
    def all_senses(self) -> tuple[Sense, ...]:
        """The senses of the robot, then the baselines."""
        return *self.senses, *self.baselines

    @property
    def label_attributes(self) -> tuple[str, ...]:
        """The attribute of each sense: in the program, the label of its classifier."""
        return tuple(sense.attribute for sense in self.senses)

    @property
    def shared_label_attributes(self) -> tuple[str, ...]:
        """Those of the senses that classify a shared variable: their rates need no other knowledge."""
        return tuple(sense.attribute for sense in self.senses if sense.of in self.reasoning.shared)

    def find_related_senses(self, program: Program) -> tuple[str, ...]:
        """Return two senses whose labels a program relates to each other, given the shared value; () if none.

        E.g. because both see the same motion.
        """
        from lcorpp.reasoning import Reasoner  # imports the grounder and the compiler

        joint = [sense for sense in self.senses if is_joint(program, sense)]
        shared = self.reasoning.shared
        for first, second in combinations(joint, 2):
            names = (*shared, first.attribute, second.attribute)
            table = np.array(list(map(float, Reasoner(program).exact(names).values())))
            sizes = [len(program.attributes[name].values) for name in names[-2:]]
            both = table.reshape(-1, *sizes)
            apart = both.sum(axis=2)[:, :, None] * both.sum(axis=1)[:, None]
            if not np.allclose(both * both.sum(axis=(1, 2))[:, None, None], apart, atol=1e-9):
                return first.name, second.name
        return ()

    @property
    def model(self) -> Pomdp | GenerativeModel:
        """The planner's model: M."""
        return self.planning.model

    @property
    def model_size(self) -> str:
        """The numbers of states, actions and observations in words; a simulated model has no states."""
        model = self.model
        actions, observations = f"{len(model.actions)} actions", f"{len(model.observations)} observations"
        if isinstance(model, Pomdp):
            return f"{len(model.states)} states, {actions}, {observations}"
        return f"{actions}, {observations if model.observations else 'numbers as observations'}"

    @property
    def pomdp(self) -> Pomdp:
        """The planner's model with its tables.

        Raises:
            DomainError: the model is generative.
        """
        return self.planning.pomdp

    @property
    def people_transition(self) -> SparseTables:
        """P(s' | s, a) of simulated people."""
        own = self.simulation.transition
        return self.pomdp.transition if own is None else own

    @property
    def positive(self) -> str | None:
        """The positive class of decisions: that of the senses of the only shared variable; None without."""
        positives = (sense.positive for sense in self.senses if sense.of == self.shared and sense.positive)
        return next(positives, None)

    def find_sense(self, name: str) -> Sense:
        """Return a sense by its name.

        Raises:
            DomainError: the domain has no such sense.
        """
        for sense in self.all_senses:
            if sense.name == name:
                return sense
        names = [sense.name for sense in self.all_senses]
        expected = expected_one_of(names) if names else "the domain has no [learning]"
        raise DomainError(f"{self.folder}/domain.toml: no sense {name!r}; {expected}")

    def evidence(self, context: Mapping[str, str], labels: Mapping[str, Label]) -> Mapping[str, Label]:
        """The reasoner's evidence: the observed facts and the labels of the predicted classes.

        Args:
            context: observed attribute -> value.
            labels: sense -> its classifier's output: a class, or a likelihood over all classes, which becomes
                a likelihood over their labels, as `soft_program` expects.

        Returns:
            Attribute -> value; the attribute of each sense -> label, or -> likelihood over its labels.

        Raises:
            DomainError: an unknown fact, sense or class, or a likelihood over other classes.
        """
        values_of = self.reasoning.observed_values
        for name, value in context.items():
            known = values_of.get(name)
            if known is None:
                raise DomainError(
                    f"{name!r} is not observed in {self.name}; {expected_one_of(self.observed)}"
                )
            if value not in known:
                raise DomainError(f"{name} cannot be {value!r}; {expected_one_of(known)}")
        evidence: dict[str, Label] = dict(context)
        for name, predicted in labels.items():
            sense = self.find_sense(name)
            label_of = sense.label_of
            if isinstance(predicted, Likelihood):
                if set(predicted.values) != set(label_of):
                    raise DomainError(
                        f"a likelihood over {', '.join(predicted.values)}; expected the classes"
                        f" {', '.join(label_of)}"
                    )
                evidence[sense.attribute] = predicted.rename(label_of)
            elif predicted in label_of:
                evidence[sense.attribute] = label_of[predicted]
            else:
                raise DomainError(f"unknown class {predicted!r}; {expected_one_of(label_of)}")
        return evidence

    def label_marginal(self, evidence: Mapping[str, Label]) -> Distribution | None:
        """The marginal of the shared variables by the labels in the evidence alone.

        A label gives its class probability 1; a likelihood is normalised, i.e. combined with a uniform prior.
        Several senses about one variable are averaged, as their error rates belong to the knowledge.
        Variables without a label are uniform, and variables are independent.

        Returns:
            None if no label is about a shared variable.
        """
        estimates: dict[str, list[Array]] = {name: [] for name in self.reasoning.shared}
        for sense in self.all_senses:
            label = evidence.get(sense.attribute)
            if label is None or sense.of not in estimates:
                continue
            if isinstance(label, Likelihood):
                weight_of = dict(label)
                weights = np.array([weight_of[sense.label_of[value]] for value in sense.classes])
            else:
                weights = np.array([float(sense.label_of[value] == label) for value in sense.classes])
            estimates[sense.of].append(weights / weights.sum())
        if not any(estimates.values()):
            return None
        joint = np.ones(1)
        for name, own in estimates.items():
            size = len(self.program.attributes[name].values)
            marginal = np.mean(own, axis=0) if own else np.full(size, 1 / size)
            joint = np.outer(joint, marginal).ravel()
        return Distribution(self.values, joint)

    def class_of(self, sense: str, value: SharedValue) -> str:
        """The class that a sense should predict for a person of this shared value.

        Raises:
            DomainError: the sense does not classify a shared variable, and has no `report_labels`.
        """
        found, values = self.find_sense(sense), self.reasoning.split(value)
        if found.report_labels is None:
            raise DomainError(
                f"{self.folder}/domain.toml: the sense {sense!r} classifies {found.of}, which is not shared;"
                f" a report names {', '.join(values)}"
            )
        variable, class_of = found.report_labels
        return class_of[values[variable]]

    def prior(self, marginal: Distribution) -> Belief:
        """(S,) the planner's belief with the reasoner's marginal; other variables at their initial values.

        Args:
            marginal: over `values`, in their order.
        """
        return marginal.probabilities @ self.planning.initial_states

    def start_beliefs(self) -> Array:
        """(N, S) beliefs to solve the model for, see `list_start_beliefs`."""
        return self.list_starts().beliefs

    def list_starts(self) -> StartBeliefs:
        """The beliefs to solve the model for, and whether they are all priors of hard evidence."""
        return list_start_beliefs(self.reasoning, self.senses, self.planning)

    def marginal(self, belief: Belief) -> Distribution:
        """The distribution of the shared variables under a belief (S,), given that it is not terminal.

        The distribution is uniform if the terminal state has probability 1.
        """
        mass = belief @ self.planning.state_values
        total = mass.sum()
        return Distribution(self.values, mass / total if total > 0 else np.full(len(mass), 1 / len(mass)))

    def marginalise(self, joint: Distribution, attribute: str) -> Distribution:
        """The marginal of one shared variable, from a distribution of all."""
        shared = self.reasoning.shared
        if len(shared) == 1:
            return joint
        values = self.program.attributes[attribute].values
        shape = [len(self.program.attributes[name].values) for name in shared]
        others = tuple(axis for axis, name in enumerate(shared) if name != attribute)
        return Distribution(values, joint.probabilities.reshape(shape).sum(axis=others))

    def reported_value(self, action: str) -> SharedValue | None:
        """The shared value that an action reports, None if it is not a report."""
        return self.planning.reports.get(action)

    @cached_property
    def report_indices(self) -> Indices:
        """(A,) the index of the value that each action reports; the number of values for no report."""
        values = [self.reported_value(action) for action in self.model.actions]
        return np.array([len(self.values) if v is None else self.values.index(v) for v in values], np.intp)

    def report_action(self, value: SharedValue) -> str:
        """The first action that reports `value`.

        Raises:
            DomainError: no action reports it.
        """
        for action, reported in self.planning.reports.items():
            if reported == value:
                return action
        known = list(map(format_value, self.planning.reports.values()))
        raise DomainError(f"no action reports {format_value(value)!r}; {expected_one_of(known)}")

    def is_terminal(self, belief: Belief) -> bool:
        """Whether the terminal states have probability 1 under a belief (S,)."""
        terminal = self.planning.terminal
        if len(terminal) == 1:  # usual, and faster
            return bool(belief[terminal[0]] > 1 - TERMINAL_TOLERANCE)
        return bool(sum([belief[s] for s in terminal]) > 1 - TERMINAL_TOLERANCE)

    def program_for(
        self,
        confusions: Mapping[str, ConfusionMatrix],
        smoothing: Fraction = JEFFREYS,
        *,
        soft: Iterable[str] = (),
    ) -> Program:
        """The P-log program with the rules of some senses replaced by their confusion matrices.

        Args:
            confusions: sense -> matrix, whose classes are those of the sense.
            smoothing: pseudo-count, see `ConfusionMatrix.rates`.
            soft: senses with soft evidence, see `soft_program`; their matrices are not used.
        """
        rules = {name: (confusion, smoothing) for name, confusion in confusions.items()}
        for name in soft:
            classes = self.find_sense(name).classes
            rules[name] = ConfusionMatrix(classes, np.eye(len(classes))), Fraction(0)
        program = self.program
        if not rules:
            return program
        from lcorpp.reasoning import with_classifier  # only classifiers with rates of their own need it

        for name, (matrix, count) in rules.items():
            s = self.find_sense(name)
            program = with_classifier(program, s.attribute, s.of, matrix, s.label_of, smoothing=count)
        return program

    def make_reasoner(self, program: Program) -> Reasoner:
        """The reasoner of decisions: the domain's own, or that of a program.

        Args:
            program: with the rules of the robot's classifiers, see `program_for`.

        Raises:
            DomainError, ProgramError: as of `domains.reasoners.make_reasoner`.
        """
        return make_reasoner(self.reasoning, self.senses, program)

    def check_program_decides(self, what: str) -> None:
        """Raise `DomainError` if the domain has a reasoner of its own, which `what` cannot use."""
        own = self.reasoning.own_reasoners
        if own is not None:
            raise DomainError(
                f"{what} needs the rules of the program, but the reasoner {own} decides in {self.folder};"
                " expected a domain without [reasoning] reasoner"
            )

    def soft_program(self, senses: Iterable[str] | None = None) -> Program:
        """The P-log program for soft evidence: the label of each sense equals what it classifies.

        The likelihood in each person's evidence then expresses the classifier's uncertainty.

        Args:
            senses: those with soft evidence, by default all; the others keep their rules.
        """
        return self.program_for({}, soft=[s.name for s in self.senses] if senses is None else senses)
