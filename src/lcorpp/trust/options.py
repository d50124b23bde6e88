"""Options of trust."""

from __future__ import annotations

from dataclasses import dataclass

from lcorpp.errors import DecisionError


@dataclass(frozen=True)
class TrustOptions:
    """Options of trust.

    share: alpha, the probability that another source becomes the best one between two people.
    memory: of the source "recent", in people.
    ask_every: k: the first person, and every k-th one while the stated observation model is not credible, is
        asked until there are `ask_answers` answers; 0: none at all.
    min_asked: anybody is asked so while fewer than this times sqrt(n) of n people have given that many. A
        robot to which answers seem useless by chance would hardly ask, and learn slowly that they are not.
    max_asked: the same factor while alternative estimates are credible.
    ask_budget: cost of asking to learn, in reward units a person, over the first 100 people; of n people the
        total is at most this times min(n, 10 sqrt(n)), unless somebody leaves questions without an answer.
        All such questions of these people count, also those that the policy needed.
    refits: the learnt models are fitted again when the number of people has grown by 1 / `refits`.
    iterations: of EM at each fit; each begins at the estimates of the one before.
    max_stated_loss: plans are for the stated observation model while its log posterior is at most this much
        lower than that of the estimates, and than that of each fixed noise.

    Examples:
        >>> from lcorpp.trust import TrustOptions
        >>> TrustOptions(share=0.01, ask_every=0).memory  # people; without questions that are asked to learn
        100.0
        >>> TrustOptions(share=1)
        Traceback (most recent call last):
            ...
        lcorpp.errors.DecisionError: `share` of trust is 1; expected from 0 to below 1
    """

    share: float = 0.005
    memory: float = 100.0
    ask_every: int = 20
    ask_answers: int = 3
    min_asked: float = 1.5
    max_asked: float = 10.0
    ask_budget: float = 1.0
    refits: int = 50
    iterations: int = 2
    max_stated_loss: float = 3.0

    def __post_init__(self) -> None:
        limits = {
            "share": (0 <= self.share < 1, "from 0 to below 1"),
            "memory": (self.memory > 0, "positive"),
            "ask_every": (self.ask_every >= 0, "at least 0"),
            "ask_answers": (self.ask_answers >= 1, "at least 1"),
            "min_asked": (self.min_asked >= 0, "at least 0"),
            "max_asked": (self.max_asked >= 0, "at least 0"),
            "ask_budget": (self.ask_budget >= 0, "at least 0"),
            "refits": (self.refits >= 1, "at least 1"),
            "iterations": (self.iterations >= 1, "at least 1"),
            "max_stated_loss": (self.max_stated_loss >= 0, "at least 0"),
        }
        for name, (is_valid, expected) in limits.items():
            if not is_valid:
                raise DecisionError(f"`{name}` of trust is {getattr(self, name)!r}; expected {expected}")


DEFAULT_OPTIONS = TrustOptions()
