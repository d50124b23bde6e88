"""LCORPP+trust where people's answers depend on more than their value.

    OMP_NUM_THREADS=1 python benchmarks/trust/answer_forms.py [--streams 16] [--people 2000] [--rows TEXT]
        [--seed 0] [--jobs 2] [--out TABLE.md]

People are those of the domain `intention`, and the planner's model states a noise of .1 (.2 for `greet`).
Each strategy meets the same people with the same draws. A margin is the mean return of LCORPP+trust minus
that of the best of P, R+P, L+P and LCORPP, which is not known in advance; ± is the standard error over the
streams.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from grid import KNOWLEDGE
from joblib import Parallel, delayed

from lcorpp.assembly.strategies.trust_setup import set_up_trust
from lcorpp.decision import Robot, dt_control, strategies
from lcorpp.domains import Domain
from lcorpp.files import write_atomically
from lcorpp.planning import Planner
from lcorpp.reasoning import Reasoner
from lcorpp.simulation import NoisyChannel
from lcorpp.simulation.people import Population
from lcorpp.simulation.table_dynamics import SimulationModel
from lcorpp.simulation.world import SimulatedWorld
from lcorpp.values import Array, Instance
from worlds import BASELINES, STATED_RATES, World, make_channels, make_domain, solve_precisely

FIRST = (20, 50, 100)
"""Numbers of first people whose mean margins are listed."""

HEADER = """| people | best of four | margin | lowest stream | first 20 | 50 | 100 | last fifth | form used |
|---|---|---|---|---|---|---|---|---|
"""

OTHER = {"pos": "neg", "neg": "pos"}


@dataclass(frozen=True)
class People:
    """How people answer.

    wrong: the rate of wrong answers to the first, second, ... question, the last for all later ones; empty as
    stated. classes: two equally frequent rates instead. identities: the rate by identity instead.
    repeats: whether the same question again has the answer of before. regulars: number of people who come
    again and always answer the same; 0: everybody comes once. ids: whether the robot recognises them.
    """

    wrong: tuple[float, ...] = ()
    classes: tuple[float, float] | None = None
    identities: Mapping[str, float] | None = None
    repeats: bool = False
    regulars: int = 0
    ids: bool = False
    knowledge: str = "right"
    rates: tuple[float, float] = STATED_RATES


ROWS = {
    "worse with each question": People((0.15, 0.25, 0.35, 0.45)),
    "worse, swapped knowledge": People((0.15, 0.25, 0.35, 0.45), knowledge="swapped"),
    "worse, mild": People((0.25, 0.3, 0.35, 0.4, 0.45)),
    "better with each question": People((0.4, 0.3, 0.2, 0.1)),
    "the same answer again, .2": People((0.2,), repeats=True),
    "the same answer again, .3": People((0.3,), repeats=True),
    "20 people who come again": People((0.3,), regulars=20),
    "20 people, recognised": People((0.3,), regulars=20, ids=True),
    "200 people, recognised": People((0.3,), regulars=200, ids=True),
    "two classes, .05 and .45": People(classes=(0.05, 0.45)),
    "noise by identity": People(identities={"student": 0.1, "professor": 0.45, "visitor": 0.3}),
    "as stated": People(),
    "as stated, better classifier": People(rates=(0.9, 0.1)),
    "noise .3": People((0.3,)),
    "noise .42": People((0.42,)),
    "noise .1, lying classifier": People((0.1,), rates=(0.29, 0.76)),
    "noise .42, lying classifier": People((0.42,), rates=(0.29, 0.76)),
}


class AnsweringWorld(SimulatedWorld):
    """A person whose answers have one of the forms; `answered`: action -> the first answer to it."""

    def __init__(
        self,
        model: SimulationModel,
        person: Mapping[str, str],
        rng: np.random.Generator,
        wrong: Sequence[float],
        answered: dict[str, str] | None,
    ) -> None:
        super().__init__(model, person, rng)
        self._wrong, self._answered, self._n = wrong, answered, 0
        self._right = "pos" if person["intention"] == "interested" else "neg"

    def act(self, action: str) -> str:
        """Return the answer; a turn that failed has none."""
        answer = super().act(action)
        if answer == "none" or not self._wrong:
            return answer
        is_wrong = self._rng.random() < self._wrong[min(self._n, len(self._wrong) - 1)]
        self._n += 1
        answer = OTHER[self._right] if is_wrong else self._right
        return answer if self._answered is None else self._answered.setdefault(action, answer)


@dataclass(frozen=True)
class Stream:
    """returns: strategy -> (people,). form: in use at the end."""

    returns: Mapping[str, Array]
    form: str


def prepare(people: People) -> Domain:
    """Return the domain, in which people answer as stated."""
    domain = make_domain(World(KNOWLEDGE[people.knowledge], 0.2, people.rates, STATED_RATES))
    heard = domain.pomdp.observation.dense.copy()
    return replace(domain, simulation=replace(domain.simulation, feedback_model=heard))


@dataclass(frozen=True)
class Crowd:
    """Simulated people in the order in which the robot meets them, and what it observes of each.

    domain, planner, reasoner, channels: of the robot. instances: what it observes of each.
    persons: their values. places: index of the person, the same for one who comes again.
    """

    people: People
    seed: Sequence[int]
    domain: Domain
    planner: Planner
    reasoner: Reasoner
    channels: Mapping[str, NoisyChannel]
    instances: Sequence[Instance]
    persons: Sequence[Mapping[str, str]]
    places: Sequence[int]
    class_of: Sequence[int]

    def make_worlds(self) -> Iterator[AnsweringWorld]:
        """Yield each person anew; those who come again keep their answers until the last one."""
        people, model = self.people, SimulationModel(self.domain)
        remembered = [dict[str, str]() for _ in self.class_of]
        for i, (place, person) in enumerate(zip(self.places, self.persons, strict=True)):
            wrong: Sequence[float] = people.wrong
            if people.classes is not None:
                wrong = (people.classes[self.class_of[place]],)
            if people.identities is not None:
                wrong = (people.identities[person["identity"]],)
            answered = remembered[place] if people.regulars else dict[str, str]() if people.repeats else None
            yield AnsweringWorld(model, person, np.random.default_rng([*self.seed, i]), wrong, answered)


def draw_crowd(people: People, count: int, seed: Sequence[int]) -> Crowd:
    """Draw people, and what a robot observes of them."""
    domain, rng = prepare(people), np.random.default_rng(seed)
    planner, reasoner = solve_precisely(domain), Reasoner(domain.program)
    crowd = Population(domain).sample(people.regulars or count, rng)
    places = rng.integers(0, len(crowd), count).tolist() if people.regulars else list(range(count))
    met, channels = [crowd[place] for place in places], make_channels(domain)
    signals = {name: channel.simulate(met, rng) for name, channel in channels.items()}
    instances = [
        Instance(
            {sense: each[i] for sense, each in signals.items()},
            {attribute: person[attribute] for attribute in domain.observed},
        )
        for i, person in enumerate(met)
    ]
    class_of = rng.integers(0, 2, len(crowd)).tolist()
    return Crowd(people, seed, domain, planner, reasoner, channels, instances, met, places, class_of)


def run_stream(people: People, count: int, seed: Sequence[int]) -> Stream:
    """Let all strategies decide about the same people."""
    crowd = draw_crowd(people, count, seed)
    domain, planner, reasoner = crowd.domain, crowd.planner, crowd.reasoner
    trust = set_up_trust(domain, reasoner, planner)
    full = Robot(crowd.channels, reasoner, planner, domain)
    robots: dict[str, Callable[[], Robot]] = {
        row.name: partial(row.robot, full) for row in strategies(BASELINES)
    }
    robots["trust"] = lambda: replace(full, reasoner=trust, planner=trust.make_planner())
    returns = {}
    for name, make_robot in robots.items():
        own = np.empty(count)
        for i, (instance, world) in enumerate(zip(crowd.instances, crowd.make_worlds(), strict=True)):
            who = str(crowd.places[i]) if people.ids else None
            robot = make_robot()
            if name == "trust" and who is not None:
                known = trust.recognise(who)
                robot = replace(full, reasoner=known, planner=known.make_planner())
            episode = dt_control(robot, instance, world)
            if name == "trust":
                trust.learn(episode.evidence, episode.steps, who)
            own[i] = world.return_
        returns[name] = own
    return Stream(returns, trust.form)


def describe(name: str, streams: Sequence[Stream]) -> str:
    """Return a row of the table."""
    means = {row: np.mean([own.returns[row].mean() for own in streams]) for row in BASELINES}
    best = max(means, key=lambda row: means[row])
    margins = np.array([own.returns["trust"] - own.returns[best] for own in streams])
    by_stream = margins.mean(axis=1)
    error = by_stream.std(ddof=1) / len(streams) ** 0.5 if len(streams) > 1 else np.nan
    first = " | ".join(f"{margins[:, :n].mean():+.1f}" for n in FIRST)
    late = margins[:, -(margins.shape[1] // 5) :].mean()
    forms = [own.form for own in streams]
    used = ", ".join(f"{form} {forms.count(form)}" for form in dict.fromkeys(forms))
    return (
        f"| {name} | {best} {means[best]:.1f} | {by_stream.mean():+.2f} ± {error:.2f}"
        f" | {by_stream.min():+.2f} | {first} | {late:+.2f} | {used} |\n"
    )


def print_table(
    header: str, names: Iterable[str], text: str, make_row: Callable[[int, str], str], out: Path | None
) -> None:
    """Print the rows whose name contains a text as they are measured, and write them to a file.

    make_row: of the number and the name of a row.
    """
    print(header, end="")
    lines = [header]
    for number, name in enumerate(names):
        if text in name:
            lines.append(make_row(number, name))
            print(lines[-1], end="", flush=True)
    if out is not None:
        write_atomically(out, "".join(lines))


def main(
    streams: Annotated[int, typer.Option(min=1)] = 16,
    people: Annotated[int, typer.Option(min=100, help="People a stream.")] = 2000,
    rows: Annotated[str, typer.Option(help="Rows of the table whose name contains this.")] = "",
    seed: Annotated[int, typer.Option(min=0)] = 0,
    jobs: Annotated[int, typer.Option(min=1)] = 1,
    out: Annotated[Path | None, typer.Option(dir_okay=False)] = None,
) -> None:
    """Simulate streams of people and print a table."""

    def make_row(number: int, name: str) -> str:
        calls = (delayed(run_stream)(ROWS[name], people, (seed, number, k)) for k in range(streams))
        return describe(name, list(Parallel(n_jobs=jobs)(calls)))

    print_table(HEADER, ROWS, rows, make_row, out)


if __name__ == "__main__":
    typer.run(main)
