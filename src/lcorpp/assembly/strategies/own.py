"""The user's own strategies; what the user's parts of a robot return is checked."""

from __future__ import annotations

import inspect
import reprlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from lcorpp.decision import Robot, Strategy
from lcorpp.domains import Domain
from lcorpp.domains.own_reasoner import read_marginal
from lcorpp.errors import (
    DecisionError,
    LcorppError,
    ModelError,
    ObservationError,
    check_type,
    expected_one_of,
)
from lcorpp.planning.belief import check_belief
from lcorpp.protocols import Classifier, Planner, Reasoner
from lcorpp.user_code import UserFunction, load_file
from lcorpp.values import Array, Belief, Distribution, Label, Likelihood


def load_strategy(path: Path, name: str) -> Strategy:
    """Return the strategy of the user: ``NAME(robot)``, or an object NAME with `name` and ``robot(full)``.

    The function is called for each decision, with the robot that learns, reasons and plans, and returns the
    robot that decides. With a second parameter it is also given a random generator. What the robot's new
    classifiers, reasoner and planner return is checked.

    Raises:
        DecisionError: the file cannot be loaded, or has no such function or object.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp.assembly import load_strategy
        >>> _ = Path("mine.py").write_text("def same(robot): return robot")
        >>> load_strategy(Path("mine.py"), "same").name
        'same'
    """
    value = getattr(load_file(path, f"lcorpp_user_{path.stem}", DecisionError), name, None)
    if hasattr(value, "robot") and not isinstance(value, type):
        function = UserFunction(path, f"{name}.robot", DecisionError)
        name = getattr(value, "name", name)
        if not isinstance(name, str) or not name:
            raise DecisionError(f"{function.location}: the name of a strategy is {name!r}; expected a text")
    else:
        function = UserFunction(path, name, DecisionError)
    change = OwnStrategy(name, function)
    return Strategy(name, True, True, True, change=change, own=function, draws=_takes_generator(function))


def _takes_generator(function: UserFunction) -> bool:
    """Whether the user's function requires a second argument."""
    try:
        parameters = inspect.signature(function.function).parameters.values()
    except (TypeError, ValueError):  # a function without a signature, e.g. of C
        return False
    positional = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    return len([p for p in parameters if p.kind in positional and p.default is p.empty]) > 1


@dataclass(frozen=True, eq=False)
class OwnStrategy:
    """The user's function, with checks around those parts of its robot that are the user's."""

    name: str
    function: UserFunction

    def __call__(self, full: Robot, *generator: object) -> object:
        """Return the robot that decides.

        Raises:
            DecisionError: the function fails, its robot has classifiers of unknown senses, or the domain of
                `full` is not a `Domain`, which has a model.
        """
        changed = self.function(full, *generator)
        if not isinstance(changed, Robot):
            return changed
        domain = full.domain
        check_type(domain, Domain, f"the domain of the strategy {self.name!r}", DecisionError)
        assert isinstance(domain, Domain)
        return replace(
            changed,
            classifiers=self._check_classifiers(full.classifiers, changed.classifiers, domain),
            reasoner=_CheckedReasoner(changed.reasoner, domain, self)
            if _is_foreign(changed.reasoner)
            else changed.reasoner,
            planner=_CheckedPlanner(changed.planner, domain, self)
            if _is_foreign(changed.planner)
            else changed.planner,
        )

    def _check_classifiers(
        self, given: Mapping[str, Classifier], changed: Mapping[str, Classifier], domain: Domain
    ) -> Mapping[str, Classifier]:
        if changed is given:
            return given
        classes = {sense.name: sense.classes for sense in domain.senses}
        for sense in changed:
            if sense not in classes:
                raise DecisionError(
                    f"{self.function.location}: strategy {self.name!r} has a classifier of the sense"
                    f" {sense!r}; {expected_one_of(classes)}"
                )
        return {
            sense: _CheckedClassifier(part, sense, classes[sense], self) if _is_foreign(part) else part
            for sense, part in changed.items()
        }

    @contextmanager
    def locate_failures(self, what: str) -> Iterator[None]:
        """Name the user's file and line in lcorpp's errors that a method causes: it was called wrongly.

        An impossible observation keeps its type. `Strategy.locate_failures` names all other errors.
        """
        try:
            yield
        except LcorppError as error:
            kind = ObservationError if isinstance(error, ObservationError) else DecisionError
            with self.function.file.locate_failures(f"strategy {self.name!r}: {what}", kind):
                raise

    def make_error(self, method: object, what: str, value: object, expected: str) -> DecisionError:
        """Return the error that a method of the user's returned `value`; `what` names it."""
        location = self.function.file.locate(method, self.function.location)
        return DecisionError(
            f"{location}: strategy {self.name!r}: {what} returned {reprlib.repr(value)}; {expected}"
        )


def _is_foreign(part: object) -> bool:
    """Whether the type of a part is not lcorpp's own."""
    return type(part).__module__.partition(".")[0] != "lcorpp"


@dataclass(frozen=True, eq=False)
class _CheckedClassifier:
    """The user's classifier of a sense."""

    classifier: Classifier
    sense: str
    classes: tuple[str, ...]
    strategy: OwnStrategy

    def classify(self, signal: Array) -> Label | None:
        what = f"classify() of the sense {self.sense!r}"
        with self.strategy.locate_failures(what):
            label = self.classifier.classify(signal)
        if isinstance(label, Likelihood):
            known = set(label.values) == set(self.classes)
        else:
            known = label is None or (isinstance(label, str) and label in self.classes)
        if not known:
            raise self.strategy.make_error(
                self.classifier.classify,
                what,
                label,
                f"{expected_one_of(self.classes)}, a likelihood of each or None",
            )
        return label


@dataclass(frozen=True, eq=False)
class _CheckedReasoner:
    """The user's reasoner."""

    reasoner: Reasoner
    domain: Domain
    strategy: OwnStrategy

    def posterior(self, attribute: str | Sequence[str], evidence: Mapping[str, Label]) -> Distribution | None:
        with self.strategy.locate_failures("posterior()"):
            marginal = self.reasoner.posterior(attribute, evidence)
        if marginal is None:
            return None
        try:
            if attribute == self.domain.shared:
                return read_marginal(marginal, self.domain.values)
            if not isinstance(marginal, Distribution):
                raise ValueError("expected a Distribution or None")
        except ValueError as error:
            raise self.strategy.make_error(
                self.reasoner.posterior, "posterior()", marginal, str(error)
            ) from None
        return marginal


@dataclass(frozen=True, eq=False)
class _CheckedPlanner:
    """The user's planner."""

    planner: Planner
    domain: Domain
    strategy: OwnStrategy

    @property
    def start(self) -> Belief:
        return self._check_belief(type(self.planner), "start", self.planner.start)

    def action(self, belief: Belief) -> str:
        actions = self.domain.pomdp.actions
        with self.strategy.locate_failures("action()"):
            action = self.planner.action(belief)
        if not isinstance(action, str) or action not in actions:
            raise self.strategy.make_error(self.planner.action, "action()", action, expected_one_of(actions))
        return action

    def update(self, belief: Belief, action: str, observation: str) -> Belief:
        with self.strategy.locate_failures("update()"):
            after = self.planner.update(belief, action, observation)
        return self._check_belief(self.planner.update, "update()", after)

    def _check_belief(self, method: object, what: str, value: object) -> Belief:
        pomdp = self.domain.pomdp
        try:
            return check_belief(pomdp, value)  # type: ignore[arg-type]  # checks the type, too
        except ModelError as error:
            states = ", ".join(pomdp.states[:6]) + (", ..." if len(pomdp.states) > 6 else "")
            expected = (
                f"expected a belief, a probability for each of the {len(pomdp.states)} states ({states})"
            )
            raise self.strategy.make_error(method, what, value, f"{error}; {expected}") from None
