"""Compilation, step 2: a program as a transition system over bits, whose steps decide one component each.

Later steps need to know of earlier ones only which bodies of their rules are satisfied, so the state has bits
for bodies, not for terms. Example, decided in the order a, b, c, x:

    x :- a, b=false.      x :- c.

The component x is a *child* of the steps a, b and c, its *parents* (as in a Bayesian network; their *ranks*
are 0, 1 and 2). Its *rule template* needs two bits, each in a *slot*: slot 0 for "a body of x=true is
satisfied" and slot 1 for "a=true, so the first body is pending". The second body needs no bit for itself, as
one step decides it.
The builder gives each slot a bit of the state for as long as it is needed, as in register allocation:

    step  effect of the outcome on the state                   bits in use afterwards
    a     a=true sets bit 1                                    1 (slot 1)
    b     b=false sets bit 2 if bit 1 is set                   2 (slot 0)
    c     c=true sets bit 2                                    2 (slot 0)
    x     x=true if bit 2 is set, otherwise x has no value     none

So a step of the decision diagram has two states (nodes), although there are eight outcomes of a, b and c.
Components whose rules are equal up to the names of terms share a template; steps with the same template,
bits and children share a `Transition`. A constraint is a child without a step of its own: if its body is
satisfied, the world is impossible.

The steps form a tree (`elimination_tree`). Where it branches, each branch continues with those bits that its
own steps read; other branches may use the same bits otherwise.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from threading import Lock
from typing import TYPE_CHECKING

from lcorpp.errors import TooLargeError
from lcorpp.reasoning.grounding.ground_program import Clause, GroundProgram
from lcorpp.reasoning.grounding.simplification import simplify
from lcorpp.reasoning.transitions.elimination_tree import (
    MAX_FRONTIER,
    EliminationTree,
    build_elimination_tree,
)
from lcorpp.reasoning.transitions.local_distribution import (
    AcyclicTermDistribution,
    LocalDistribution,
    Outcome,
    ProbabilityCache,
)
from lcorpp.reasoning.transitions.relevance import DerivedComponent, separate_irrelevant_rules
from lcorpp.reasoning.transitions.rule_templates import (
    NO_SLOT,
    Child,
    Parent,
    RuleTemplate,
    describe_structure,
)
from lcorpp.reasoning.transitions.transition import Transition

if TYPE_CHECKING:  # few programs are recursive
    from lcorpp.reasoning.transitions.closure import Closure
    from lcorpp.reasoning.transitions.linear_recursion import LinearRecursion
    from lcorpp.reasoning.transitions.order_search import OrderSearch
    from lcorpp.reasoning.transitions.recursion_frontier import Claim, RecursionFrontier

MAX_BITS = 20_000
"""Maximum number of bits of a state."""


@dataclass(slots=True, eq=False)
class TransitionSystem:
    """A program as a tree of steps over states of bits; the initial state of each root is 0.

    program: the ground program, without its clauses.
    tree: the steps.
    transitions: step -> the outcomes of its terms and their effect on the state.
    consistent: False if a constraint without body shows that there is no world.
    term_numbers: queried term as text -> its number in `program`.
    facts: term -> its value in every world, for terms without a step.
    derived: the components that `derive_values` completes if a world is listed, as not all terms have a step.
    probabilities: those computed so far by local distributions.
    reorder: searches for a better order with some work, see `order_search`; returns the system with it, None
        if there is none, and a logarithm to base 2, the estimated number of states.
    outcomes: those found so far by the compiled transitions, the labels of the arcs of decision diagrams.
    expansion: is locked while a thread adds outcomes.
    """

    program: GroundProgram
    tree: EliminationTree
    transitions: list[Transition]
    consistent: bool
    term_numbers: dict[str, int]
    facts: Mapping[int, int]
    derived: Sequence[DerivedComponent]
    probabilities: ProbabilityCache
    reorder: Callable[[float], tuple[TransitionSystem | None, float]]
    outcomes: list[Outcome] = field(default_factory=list)
    expansion: Lock = field(default_factory=Lock)

    def __repr__(self) -> str:
        return (
            f"TransitionSystem({self.program.source.file}: {len(self.program.names)} terms,"
            f" {len(self.transitions)} steps)"
        )


def build_transition_system(
    program: GroundProgram, queried: Iterable[str] = (), max_frontier: int = MAX_FRONTIER
) -> TransitionSystem:
    """Simplify a ground program, order its components and build the transitions.

    Args:
        queried: the terms whose outcomes queries read.
        max_frontier: recursive components with a larger frontier are decided as a whole, see
            `linear_recursion`; with 0 all are, so that no step guesses.
    """
    program, term_numbers = program.number_terms(set(queried))
    clauses, outcomes = simplify(program)
    needed = set(term_numbers.values())
    clauses, facts, irrelevant = separate_irrelevant_rules(program, clauses, needed)
    program = replace(program, clauses=[])  # the transitions contain what they need of the clauses

    search: OrderSearch | None = None

    def build(max_work: float = 0.0) -> TransitionSystem | None:
        own = program, clauses, outcomes, needed
        tree = build_elimination_tree(*own, max_frontier, search, max_work)
        if tree is None:
            return None
        builder = _TransitionBuilder(program, clauses, outcomes, tree, needed)
        transitions, consistent = builder.build(), builder.consistent
        n_words = (builder.n_bits + 63) // 64
        for transition in transitions:
            transition.n_words = n_words
        return TransitionSystem(
            program, tree, transitions, consistent, term_numbers, facts, [*builder.derived, *irrelevant],
            builder.probabilities, reorder,
        )  # fmt: skip

    def reorder(max_work: float) -> tuple[TransitionSystem | None, float]:
        nonlocal search
        if search is None:
            from lcorpp.reasoning.transitions.order_search import OrderSearch  # few programs need it

            search = OrderSearch()
        better = build(max_work)
        return better, search.log_states

    system = build()
    assert system is not None
    return system


class _TransitionBuilder:
    """Builds the transitions of all steps.

    Args:
        clauses: the simplified clauses.
        outcomes: the mask of the possible outcomes of each term.
        tree: the steps.
        queried: the terms whose outcomes queries read.

    consistent, derived, probabilities: as in `TransitionSystem`.
    n_bits: the largest number of bits of a state so far, at least 1.
    """

    def __init__(
        self,
        program: GroundProgram,
        clauses: Sequence[Clause],
        outcomes: Sequence[int],
        tree: EliminationTree,
        queried: set[int],
    ) -> None:
        self._program, self._outcomes, self._tree, self._queried = program, outcomes, tree, queried
        order = tree.order
        self._step_of = [0] * len(outcomes)  # term -> the step that decides it
        for step, terms in enumerate(order):
            for term in terms:
                self._step_of[term] = step
        # term -> its index in a component of several terms
        self._index_of = {term: i for terms in order if len(terms) > 1 for i, term in enumerate(terms)}
        self._template_of: dict[object, RuleTemplate] = {}  # description of the structure -> template
        self._children: list[list[Child]] = [[] for _ in order]  # of each step
        # step -> the bits of constraints and recursions of which it decides the last body
        self._final_bits: defaultdict[int, list[list[int]]] = defaultdict(list)
        self._outcomes_of: dict[RuleTemplate, dict[tuple[int, ...], list[Outcome]]] = {}
        self.probabilities: ProbabilityCache = {}
        self.n_bits = 1
        self._own_clauses: list[list[Clause]] = [[] for _ in order]
        recursive = {term for recursion in tree.recursions for term in recursion.terms}
        constraints: dict[int, list[Clause]] = {}  # the last step of the body -> clauses
        for clause in clauses:
            if clause.term < 0:  # a constraint has no head
                last = max([self._step_of[literal[0]] for literal in clause.body], default=-1)
                constraints.setdefault(last, []).append(clause)
            elif clause.term not in recursive:
                self._own_clauses[self._step_of[clause.term]].append(clause)
        self.consistent = -1 not in constraints
        members = [*zip(order, self._own_clauses, strict=True), *[((), own) for own in constraints.values()]]
        count_by_size = Counter([len(own) for _, own in members])
        added = [self._add_child(terms, own, count_by_size[len(own)] > 1) for terms, own in members]
        self._components = added[: len(order)]  # step -> (template, bits)
        self._guesses = {term: guess for own in tree.recursions for term, guess in own.guesses.items()}
        self.derived: list[DerivedComponent] = [(own.terms, own.clauses) for own in tree.recursions]
        self._frontiers_at: defaultdict[int, list[RecursionFrontier]] = defaultdict(list)  # by step
        for recursion in tree.recursions:
            self._add_recursion(recursion)

    def _add_child(
        self, terms: tuple[int, ...], clauses: Sequence[Clause], has_equal_sized: bool
    ) -> tuple[RuleTemplate, list[int]]:
        """Find or create the template of a component, and add the component to the children of its parents.

        Args:
            terms: the terms of the component; none for constraints.
            clauses: the clauses of the component, or constraints with the same last step.
            has_equal_sized: whether another component has the same number of clauses; only then can the
                template be shared.

        Returns:
            The template, and the bits of its slots, see `Child`.
        """
        structure: list[object] | None = None
        needed: Collection[int]  # the terms of the bodies that earlier steps decide, by first occurrence
        term = terms[0] if terms else -1
        if has_equal_sized and len(terms) < 2 and term not in self._program.do:
            structure, needed = describe_structure(self._program, term, clauses, self._outcomes)
        else:
            inner = set(terms)
            needed = dict.fromkeys([x[0] for clause in clauses for x in clause.body if x[0] not in inner])
        step_of_needed = [self._step_of[term] for term in needed]
        if len(needed) > 1:
            steps = sorted(set(step_of_needed))  # rank -> step
            rank_of = {step: rank for rank, step in enumerate(steps)}
            ranks = tuple([rank_of[step] for step in step_of_needed])
        else:  # usual in chains, and faster
            steps, ranks = step_of_needed, (0,) * len(needed)
        if structure is not None:
            structure += ranks
            if self._index_of:
                structure += [self._index_of.get(term, 0) for term in needed]
        key = tuple(structure) if structure is not None else None
        template = self._template_of.get(key)
        if template is None:
            places = {
                term: (rank, self._index_of.get(term, 0)) for term, rank in zip(needed, ranks, strict=True)
            }
            template = RuleTemplate.from_clauses(terms, clauses, places, self._outcomes)
            if key is not None:
                self._template_of[key] = template
        else:
            template.is_shared = True
        bits = [0] * template.n_slots
        if not terms and steps:
            self._final_bits[max(steps)].append(bits)
        for parent in template.parents:
            self._children[steps[parent.rank]].append((template, parent, bits))
        return template, bits

    def _add_recursion(self, recursion: LinearRecursion) -> None:
        """Add a recursion to the children of its inputs (its rules) and of its guesses (their claims)."""
        from lcorpp.reasoning.transitions.recursion_frontier import RecursionFrontier

        template, bits = self._add_child(recursion.terms, recursion.clauses, False)
        steps = sorted({self._step_of[term] for term in recursion.scope if term not in recursion.guesses})
        claims: list[Claim] = []
        for term, guess in recursion.guesses.items():
            step = self._step_of[term]
            parent = Parent(len(template.parents))
            for mask, value, is_derived in guess.claims:
                slot = template.add_slot()
                parent.allocates.append(slot)
                parent.releases.append(slot)
                parent.updates.append((((0, mask),), NO_SLOT, slot))
                bits.append(0)
                claims.append((step, slot, (term, value), is_derived))
            self._children[step].append((template, parent, bits))
        frontier = RecursionFrontier(self._program, template, bits, steps, claims)
        for parent in template.parents:
            parent.releases += frontier.finished.get(parent.rank, ())
        for step in frontier.steps:
            self._frontiers_at[step].append(frontier)
        self._final_bits[max(frontier.steps)] += bits, frontier.bits

    def build(self) -> list[Transition]:
        """Allocate the bits step by step and build the transitions."""
        live_before = [0] * len(self._components)  # step -> mask of the bits in use before it
        transition_of: dict[object, Transition] = {}
        transitions: list[Transition] = []
        for step, ((template, own_bits), children) in enumerate(
            zip(self._components, self._children, strict=True)
        ):
            is_shareable, live = template.is_shared, live_before[step]
            for other, parent, bits in children:
                is_shareable = is_shareable and other.is_shared
                for slot in parent.allocates:
                    bits[slot] = ~live & (live + 1)  # the lowest bit that is not in use
                    live |= bits[slot]
            self.n_bits = max(self.n_bits, live.bit_length())
            if self.n_bits > MAX_BITS:
                raise TooLargeError(f"{self._program.source.file}: states of more than {MAX_BITS} bits")
            closures: list[Closure] = []
            for frontier in self._frontiers_at.get(step, ()):
                closure, live = frontier.advance(step, live)
                closures.append(closure)
                self.n_bits = max(self.n_bits, live.bit_length())
            # all bodies of the component are decided, so only bits for "satisfied" are left
            input_mask = sum(own_bits)
            # a bit is free again only now, as the transition reads it together with those allocated above
            live ^= input_mask + sum([bits[slot] for _, parent, bits in children for slot in parent.releases])
            following = self._tree.children[step]
            live_masks = (live,) if len(following) == 1 else self._split_live_bits(step, live)
            for child, mask in zip(following, live_masks, strict=True):
                live_before[child] = mask
            key = None
            if is_shareable:
                parts: list[object] = [template, live_masks, *own_bits]
                for _, parent, bits in children:
                    parts.append(parent)
                    parts += [bits[slot] for slot in parent.slots]
                key = tuple(parts)
            transition = transition_of.get(key)
            if transition is None:
                terms = self._tree.order[step]
                distribution = self._build_distribution(template, own_bits, step, terms)
                transition = Transition(len(terms), distribution, input_mask, children, live_masks, closures)
                if key is not None:
                    transition_of[key] = transition
            else:
                transition.is_shared = True
            transitions.append(transition)
            for _, parent, bits in children:  # only now: the transition reads these bits for the last time
                for slot in parent.releases:
                    bits[slot] = 0
        return transitions

    def _split_live_bits(self, step: int, live: int) -> tuple[int, ...]:
        """Return the mask of the bits that the steps of each branch after a step read."""
        branches = self._tree.list_branches(step)
        masks = [0] * len(branches)
        largest = max(range(len(branches)), key=lambda i: len(branches[i]), default=-1)
        for i, branch in enumerate(branches):
            for reader in branch if i != largest else ():  # the largest reads the rest
                for bits in (self._components[reader][1], *self._final_bits.get(reader, ())):
                    masks[i] |= sum(bits) & live
        if branches:
            masks[largest] = live ^ sum(masks)
        return tuple(masks)

    def _build_distribution(
        self, template: RuleTemplate, bits: list[int], step: int, terms: tuple[int, ...]
    ) -> LocalDistribution:
        if len(terms) == 1 and terms[0] in self._guesses:
            return self._guesses[terms[0]]
        if not template.recursive:
            cache = self._outcomes_of.setdefault(template, {})
            return AcyclicTermDistribution(self._program, template, bits, cache, self.probabilities)
        from lcorpp.reasoning.transitions.recursive_components import build_component
        from lcorpp.reasoning.transitions.stratified import Stratified

        clauses = [
            (bits[group.satisfied_slot], group.clause, group.own_literals) for group in template.clause_groups
        ]
        # a single term always counts, as others share its distribution
        read = set(template.terms) if len(terms) == 1 else self._queried.copy()
        for _, parent, _ in self._children[step] if len(terms) > 1 else ():
            read.update([template.terms[i] for conditions, _, _ in parent.updates for i, _ in conditions])
        component = build_component(self._program, template.terms, clauses, self.probabilities, read)
        if isinstance(component, Stratified) and len(terms) > 1:
            self.derived.append((terms, self._own_clauses[step]))
        return component
