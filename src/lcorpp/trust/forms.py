"""Forms of answers: how an answer depends on what the same person was asked and answered before."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np

from lcorpp.protocols import Memory
from lcorpp.trust.answers import AnswerModel, NoiseGroup
from lcorpp.values import Array

UNRELIABLE = 0.7
"""Most probable noise a priori of the people who answer less reliably."""


class AnswerForm(ABC):
    """How P(answer | value, question) depends on the person's earlier questions and answers.

    A small memory of the conversation determines which of several copies of a question's rows applies. With
    K kinds of questions, copy c of kind k has the index k * `n_copies` + c. All else, rows for each copy and
    their estimates, is that of `AnswerModel`.

    With C classes of people, each copy has rows for each class: copy c and class l of kind k have the index
    (k * `n_copies` + c) * C + l. A person's class is hidden and does not change.

    name: of the form. n_copies: of each kind. groups: of copies, or classes of people, that share a noise.
    n_classes: C. keeps_memory: whether a person's memory persists until the next conversation.
    """

    keeps_memory = False

    def __init__(
        self, name: str, n_copies: int, groups: tuple[NoiseGroup, ...], *, n_classes: int = 1
    ) -> None:
        self.name, self.n_copies, self.groups, self.n_classes = name, n_copies, groups, n_classes

    @abstractmethod
    def begin(self, n_kinds: int) -> Memory:
        """Return the memory before the first question."""

    @abstractmethod
    def find_copy(self, memory: Memory, kind: int) -> int:
        """Return the copy of a kind's rows by which the next question is answered."""

    @abstractmethod
    def advance(self, memory: Memory, kind: int, observation: int) -> Memory:
        """Return the memory after an answer."""

    @abstractmethod
    def find_group(self, copy: int) -> int:
        """Return the index of the group of a copy."""

    def has_mean_end(self, copy: int) -> bool:
        """Return whether the row of a copy at noise 1 is the mean of its kind's rows over the values."""
        return True

    def find_ends(self, tables: Array) -> Array:
        """Return (K', V, O) the rows at noise 1, from the rows of the kinds (K, V, O)."""
        return self.expand(np.broadcast_to(tables.mean(axis=1, keepdims=True), tables.shape))

    def expand(self, tables: Array) -> Array:
        """Return (K', V, O) the rows of all copies, from those of the kinds (K, V, O)."""
        return np.repeat(tables, self.n_copies, axis=0)

    def list_memories(
        self, answers: Sequence[int], n_kinds: int, n_observations: int, *, start: Memory | None = None
    ) -> list[Memory]:
        """Return the memory before each answer k * O + o, in the order of the answers, and after all.

        Args:
            start: the first memory; None for that before the first question.
        """
        memories = [self.begin(n_kinds) if start is None else start]
        for answer in answers:
            memories.append(self.advance(memories[-1], *divmod(answer, n_observations)))
        return memories

    def find_cells(
        self, answers: Sequence[int], n_kinds: int, n_observations: int, *, start: Memory | None = None
    ) -> list[int]:
        """Return k' * O + o for each answer k * O + o, in the order in which they were given.

        Args:
            start: as of `list_memories`.
        """
        cells = list[int]()
        *before, _ = self.list_memories(answers, n_kinds, n_observations, start=start)
        for memory, answer in zip(before, answers, strict=True):
            kind, observation = divmod(answer, n_observations)
            copy = self.find_copy(memory, kind)
            cells.append((kind * self.n_copies + copy) * n_observations + observation)
        return cells

    def make_answers(self, tables: Array) -> AnswerModel:
        """Return the model of answers, as the stated tables (K, V, O) of the kinds give it."""
        classes = range(self.n_classes)
        groups = [self.find_group(copy) + c for copy in range(self.n_copies) for c in classes]
        return AnswerModel.of_tables(
            np.repeat(self.expand(tables), self.n_classes, axis=0),
            ends=np.repeat(self.find_ends(tables), self.n_classes, axis=0),
            group_of=np.tile(groups, len(tables)),
            groups=self.groups,
            n_classes=self.n_classes,
        )


class ByNumber(AnswerForm):
    """The noise depends on how many questions the person has answered: they tire, or get used to the robot.

    Args:
        n_copies: the last copy is for all later questions. The most probable noise of a copy a priori is the
            estimate of the copy before.
    """

    def __init__(self, n_copies: int = 4) -> None:
        following = (NoiseGroup(follows=copy) for copy in range(n_copies - 1))
        super().__init__("number", n_copies, (NoiseGroup(), *following))

    def begin(self, n_kinds: int) -> Memory:
        """Return the number of answers, at most `n_copies`."""
        return (0,)

    def find_copy(self, memory: Memory, kind: int) -> int:
        """Return the number of answers before."""
        return min(memory[0], self.n_copies - 1)

    def advance(self, memory: Memory, kind: int, observation: int) -> Memory:
        """Count the answer, up to one more than the copies: the count determines which copy applied last."""
        return (min(memory[0] + 1, self.n_copies),)

    def find_group(self, copy: int) -> int:
        """Return the copy."""
        return copy


class Repeated(AnswerForm):
    """The same question again has the answer of before, with some probability; otherwise a new draw.

    Copy 0 is for a new question, copy 1 + o for one with the last answer o. At noise 1 of the second group,
    that answer is certain.
    """

    keeps_memory = True

    def __init__(self, n_observations: int) -> None:
        super().__init__("repeated", 1 + n_observations, (NoiseGroup(), NoiseGroup()))

    def begin(self, n_kinds: int) -> Memory:
        """Return 0 for each kind: not asked."""
        return (0,) * n_kinds

    def find_copy(self, memory: Memory, kind: int) -> int:
        """Return 1 + the last answer to the kind, or 0."""
        return memory[kind]

    def advance(self, memory: Memory, kind: int, observation: int) -> Memory:
        """Remember the answer."""
        return (*memory[:kind], 1 + observation, *memory[kind + 1 :])

    def find_group(self, copy: int) -> int:
        """Return 0 for new questions, 1 for repeated ones."""
        return min(copy, 1)

    def has_mean_end(self, copy: int) -> bool:
        """Return whether the copy is for a new question."""
        return copy == 0

    def find_ends(self, tables: Array) -> Array:
        """Return (K', V, O) mean rows for new questions, and certain answers for repeated ones."""
        ends = super().find_ends(tables).reshape(len(tables), self.n_copies, *tables.shape[1:]).copy()
        ends[:, 1:] = np.eye(self.n_copies - 1)[None, :, None]
        return ends.reshape(-1, *tables.shape[1:])


class ByClass(AnswerForm):
    """The noise depends on the person: of two classes of people, one answers less reliably."""

    def __init__(self) -> None:
        super().__init__("class", 1, (NoiseGroup(), NoiseGroup(start=UNRELIABLE)), n_classes=2)

    def begin(self, n_kinds: int) -> Memory:
        """Return nothing: a person's class does not change."""
        return ()

    def find_copy(self, memory: Memory, kind: int) -> int:
        """Return the only copy."""
        return 0

    def advance(self, memory: Memory, kind: int, observation: int) -> Memory:
        """Return nothing."""
        return ()

    def find_group(self, copy: int) -> int:
        """Return the group of the first class; that of the second one follows."""
        return 0
