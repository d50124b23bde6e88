"""Folds of cross-validation, and training and test data: stratified by class, with whole groups.

A group is in one fold. A case of several people has a group such as "ann + bob"; the training data exclude it
while ann is in the test data.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from sklearn.model_selection import StratifiedGroupKFold, StratifiedKFold

from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError
from lcorpp.learning.data.dataset import check_trainable, count_groups
from lcorpp.values import GROUP_SEPARATOR, Array, Dataset, Flags, Indices

FOLDS = 5
"""Folds of cross-validation by default."""

MAX_LEAVE_ONE_OUT = 10
"""Maximum number of people for which leave-one-person-out is the default."""

MAX_SPLIT_FOLDS = 20
"""Maximum number of folds that `split` forms; the test data are whole folds."""


class FastStratifiedGroupKFold(StratifiedGroupKFold):  # type: ignore[misc]
    """The same folds in a quarter of the time: all folds are tried for a group at once."""

    def _find_best_fold(self, y_counts_per_fold: Array, y_cnt: Indices, group_y_counts: Array) -> int:
        """Return the fold with which the classes are distributed most evenly; of equal ones the smallest."""
        tried = np.repeat(y_counts_per_fold[None], self.n_splits, axis=0)
        tried[range(self.n_splits), range(self.n_splits)] += group_y_counts
        spreads = (tried / y_cnt).std(axis=1).mean(axis=1).tolist()
        best, least, fewest = 0, np.inf, np.inf
        for fold, (spread, size) in enumerate(zip(spreads, y_counts_per_fold.sum(axis=1), strict=True)):
            is_equal = abs(spread - least) <= 1e-8 + 1e-5 * least  # as `np.isclose`
            if spread < least or (is_equal and size < fewest):
                best, least, fewest = fold, spread, size
        return best


def choose_folds(dataset: Dataset) -> int:
    """Return the default number of folds: `FOLDS`, or one fold for each group of few people.

    The latter is leave-one-person-out cross-validation.
    """
    return len(set(dataset.groups)) if has_few_people(dataset) else FOLDS


def has_few_people(dataset: Dataset) -> bool:
    """Return whether there are 3 to `MAX_LEAVE_ONE_OUT` groups of several cases, each class in two."""
    n = len(set(dataset.groups))
    is_few = 3 <= n <= MAX_LEAVE_ONE_OUT and n < len(dataset)
    return is_few and min(count_groups(dataset.labels, dataset.groups).values()) > 1


def find_training_cases(held_out: Flags, groups: Sequence[str]) -> Flags:
    """(cases,) the training data of a fold: cases outside of it (cases,) that share no person with it."""
    out = {group for group, is_out in zip(groups, held_out, strict=True) if is_out}
    people = {name for group in out for name in _split(group)}
    is_other = np.array([people.isdisjoint(_split(group)) for group in groups], dtype=bool)
    return is_other & ~held_out


def count_people(groups: Sequence[str]) -> int:
    """Return the number of people in some groups, of whom several may be in one."""
    return len({name for group in set(groups) for name in _split(group)})


def _split(group: str) -> list[str]:
    """Return the people of a group."""
    return group.split(GROUP_SEPARATOR)


def assign_folds(labels: Sequence[str], groups: Sequence[str] | None, folds: int, seed: int) -> Indices:
    """(cases,) the fold of each case; the folds are stratified, and keep groups whole if there are some.

    As many folds as groups have one group each.

    Raises:
        DataError: there are fewer than two folds, or the seed is out of range.
    """
    if folds < 2:
        raise DataError(f"cross-validation needs at least 2 folds, not {folds}")
    if not 0 <= seed < 2**32:
        raise DataError(f"the seed must lie between 0 and {2**32 - 1}, not {seed}")
    if groups is not None and folds == len(set(groups)):
        return np.unique(np.array(groups), return_inverse=True)[1]
    kind = StratifiedKFold if groups is None else FastStratifiedGroupKFold
    splitter = kind(folds, shuffle=True, random_state=seed)
    fold_of = np.empty(len(labels), dtype=np.intp)
    for fold, (_, test) in enumerate(splitter.split(labels, labels, groups)):
        fold_of[test] = fold
    return fold_of


def drop_single_groups(groups: Sequence[str]) -> Sequence[str] | None:
    """Return None if each case is a group of its own: the plain folds are as good, and much faster."""
    return None if len(set(groups)) == len(groups) else groups


def assign_training_folds(dataset: Dataset, folds: int, seed: int) -> Indices:
    """(cases,) the fold in which each case is held out, after checking that all folds can be trained.

    Raises:
        DataError: `dataset` is not trainable, see `check_trainable`, the other folds of one lack a class, or
            as `assign_folds`.
    """
    is_each_alone = folds == len(set(dataset.groups)) and folds < len(dataset)
    check_trainable(dataset, folds=min(folds, 2) if is_each_alone else folds)
    fold_of, labels = assign_folds(dataset.labels, dataset.groups, folds, seed), np.array(dataset.labels)
    for fold in range(folds):
        training = find_training_cases(fold_of == fold, dataset.groups)
        missing = sorted(set(dataset.labels) - set(labels[training].tolist()))
        if missing:  # possible if a group has cases of several classes, or people of several groups
            held_out = f"fold {fold + 1} of {folds}"
            if is_each_alone:
                group = next(g for g, own in zip(dataset.groups, fold_of, strict=True) if own == fold)
                held_out = f"the cases of {group}, and of others with these people,"
            raise DataError(f"without {held_out} there is no case of {', '.join(missing)} to learn")
    return fold_of


@check_arguments
def split(dataset: Dataset, *, test: float = 0.3, seed: int) -> tuple[Dataset, Dataset]:
    """Split into training and test data, stratified by class; all cases of a group go to one side.

    Cases of several people of whom one is on the other side are left out of the training data.

    Args:
        test: test share of the cases of each class, approximated by whole groups: the share is rounded to a
            number of folds, at most `MAX_SPLIT_FOLDS` and the groups of the rarest class.

    Returns:
        (training, test), each with its rows in their original order.

    Raises:
        DataError: `test` is not between 0 and 1, a side lacks a class, or the seed is out of range.

    Examples:
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import split
        >>> speeds, people = [[0.1 * n] for n in range(20)], [f"person {n // 2}" for n in range(20)]
        >>> data = Dataset(speeds, 10 * ["stands"] + 10 * ["walks"], people)
        >>> training, test = split(data, test=0.2, seed=0)
        >>> len(training), len(test), set(training.groups) & set(test.groups)
        (16, 4, set())
    """
    if not 0 < test < 1:
        raise DataError(f"the test share must lie between 0 and 1, not {test}")
    counts = count_groups(dataset.labels, dataset.groups)
    number = min(MAX_SPLIT_FOLDS, *counts.values()) if counts else 0
    if number < 2:
        rare = [name for name, count in counts.items() if count < 2]
        raise DataError(
            f"a test share of {test} leaves the test data without {', '.join(rare) or 'cases'}; expected each"
            " class in at least two groups"
        )
    share = Fraction(test).limit_denominator(number)
    share = min(max(share, Fraction(1, number)), 1 - Fraction(1, number))
    groups = drop_single_groups(dataset.groups)
    in_test = assign_folds(dataset.labels, groups, share.denominator, seed) < share.numerator
    in_training = find_training_cases(in_test, dataset.groups)
    sides = dataset.take(np.flatnonzero(in_training)), dataset.take(np.flatnonzero(in_test))
    for name, side in zip(("training", "test"), sides, strict=True):
        missing = sorted(set(dataset.labels) - set(side.labels))
        if missing:
            raise DataError(f"a test share of {test} leaves the {name} data without {', '.join(missing)}")
    return sides
