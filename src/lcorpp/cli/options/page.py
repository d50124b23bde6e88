"""The options that `lcorpp play` and `lcorpp export` share: the robot of the page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from lcorpp.cli import console
from lcorpp.cli.options import common as options
from lcorpp.cli.options.senses import choose_classifiers, reject_given

if TYPE_CHECKING:
    from lcorpp.assembly.options import ClassifierOptions
    from lcorpp.domains import Domain
    from lcorpp.planning import SolverOptions
    from lcorpp.web.robot import PlayRobot


def choose_page_classifiers(
    domain: Domain, *, classifiers: list[str] | None, learners: list[str] | None, **training: Any
) -> dict[str, ClassifierOptions]:
    """Return the options of the classifier of each sense, None for those whose labels the page asks for.

    Args:
        training: options of `choose_training`.

    Raises:
        DomainError: as `choose_classifiers`. DataError: an unknown learner, or options that it does not take.
    """
    from lcorpp.assembly.classifier_training import make_untrained
    from lcorpp.assembly.options import READ_AS_IT_IS, TrainingOptions
    from lcorpp.assembly.track_robot import LEARNER, find_track_senses

    tracked = {sense.name for sense in find_track_senses(domain)}
    if not tracked:
        reason = f"{domain.name} has no sense of tracks that a pointer could give"
        reject_given(reason, classifier=classifiers, learner=learners, **training)
        return {sense.name: None for sense in domain.senses}
    by_default = not classifiers and not learners
    chosen: dict[str, ClassifierOptions] = {sense.name: None for sense in domain.senses} | choose_classifiers(
        domain,
        [sense for sense in domain.senses if sense.name in tracked],
        classifiers=classifiers or [],
        learners=[LEARNER] if by_default else learners or [],
        data=[],
        reading=READ_AS_IT_IS,
        training=options.choose_training(**training),
        by_channel=True,
    )
    for own in chosen.values():
        if isinstance(own, TrainingOptions):
            make_untrained(own)  # rejects a learner and its options before the work
    return chosen


def set_up(
    domain: Domain,
    chosen: dict[str, ClassifierOptions],
    solver: SolverOptions,
    *,
    seed: int,
    jobs: int | None,
    no_cache: bool,
) -> PlayRobot:
    """Train or load the classifiers and solve the POMDP, with progress."""
    from lcorpp.planning.policy_cache import find_cache_folder
    from lcorpp.web.setup import set_up_robot

    return set_up_robot(
        domain,
        chosen,
        solver,
        cache=None if no_cache else find_cache_folder(),
        progress=console.show_progress,
        seed=seed,
        jobs=console.count_processes(jobs),
    )
