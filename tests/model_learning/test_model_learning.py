"""Models from episodes: the expectation step against enumeration, and known models that are found again."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from lcorpp import load_domain
from lcorpp.errors import DataError, DomainError, ModelError
from lcorpp.model_learning import Episodes, Step, format_report, learn_model, read_episodes, write_model
from lcorpp.model_learning.baum_welch import Parameters, expect
from lcorpp.model_learning.draws import average_models
from lcorpp.model_learning.spaces import Space
from lcorpp.model_learning.structure import MOVES, RESTARTS, STAYS, Structure, _draw_rows, tie_rows
from lcorpp.planning import read_pomdp, simulate, solve


def make_people(count: int, seed: int, accuracy: float = 0.85) -> Episodes:
    """Return episodes about tea or milk: some questions, then a report at random."""
    rng, episodes = np.random.default_rng(seed), []
    for _ in range(count):
        wish, steps = rng.choice(["tea", "milk"], p=[0.7, 0.3]), []
        for _ in range(rng.integers(1, 4)):
            heard = wish if rng.random() < accuracy else {"tea": "milk", "milk": "tea"}[wish]
            steps.append(Step("ask", f"hear_{heard}", -1.0))
        report = rng.choice(["tea", "milk"])
        steps.append(Step(f"bring_{report}", "none", 10.0 if report == wish else -10.0))
        episodes.append(steps)
    return Episodes.of(episodes, [True] * count)


def draw_parameters(rng, states, actions, observations, rewards):
    def rows(*shape):
        return rng.dirichlet(np.ones(shape[-1]), size=shape[:-1])

    return Parameters(
        rng.dirichlet(np.ones(states)),
        rows(actions, states, states + 1),
        rows(actions, states + 1, observations),
        rows(actions, states, rewards),
    )


@pytest.mark.parametrize("ended", [True, False])
def test_expected_counts_are_those_of_all_paths(ended):
    """Each path of states is weighed by its probability."""
    rng = np.random.default_rng(5)
    K, A = 3, 2
    own = draw_parameters(rng, K, A, 2, 2)
    steps = [Step("ab"[rng.integers(A)], "xy"[rng.integers(2)], float(rng.integers(2))) for _ in range(4)]
    steps[:2] = [Step("a", "x", 0.0), Step("b", "y", 1.0)]  # all names occur
    episodes = Episodes.of([steps], [ended])
    counts = [np.zeros_like(t) for t in (own.start, own.transition, own.observation, own.reward)]
    total = 0.0
    for path in product(range(K), repeat=4):
        for last in [K] if ended else range(K):
            states, weight = (*path, last), own.start[path[0]]
            cells = list(zip(episodes.actions, episodes.observations, episodes.rewards, strict=True))
            for (a, o, r), s, after in zip(cells, states[:-1], states[1:], strict=True):
                weight *= own.reward[a, s, r] * own.transition[a, s, after] * own.observation[a, after, o]
            total += weight
            counts[0][path[0]] += weight
            for (a, o, r), s, after in zip(cells, states[:-1], states[1:], strict=True):
                counts[1][a, s, after] += weight
                counts[2][a, after, o] += weight
                counts[3][a, s, r] += weight
    found = expect(episodes, own)
    assert found.log_likelihoods == pytest.approx([np.log(total)], abs=1e-12)
    tables = (found.counts.start, found.counts.transition, found.counts.observation, found.counts.reward)
    for table, wanted in zip(tables, counts, strict=True):
        assert table == pytest.approx(wanted / total, abs=1e-12)


def test_drawn_paths_have_the_expected_counts():
    rng = np.random.default_rng(3)
    own = draw_parameters(rng, 3, 2, 2, 2)
    steps = [Step("a", "x", 0.0), Step("b", "y", 1.0), Step("a", "y", 0.0)]
    episodes = Episodes.of([steps] * 20_000, [True] * 20_000)
    wanted, found = expect(episodes, own).counts, expect(episodes, own, np.random.default_rng(1)).counts
    # the standard error of a share of .5 in 20,000 is .0035
    assert found.transition / 20_000 == pytest.approx(wanted.transition / 20_000, abs=0.02)
    assert found.observation / 20_000 == pytest.approx(wanted.observation / 20_000, abs=0.02)
    assert found.reward / 20_000 == pytest.approx(wanted.reward / 20_000, abs=0.02)


def test_an_impossible_episode_has_no_likelihood():
    own = Parameters(np.ones(1), np.array([[[1.0, 0.0]]]), np.ones((1, 2, 1)), np.ones((1, 1, 1)))
    found = expect(Episodes.of([[Step("a", "x", 0.0)]], [True]), own)  # the model never ends
    assert found.log_likelihoods.tolist() == [-np.inf]
    assert found.counts.transition.sum() == 0


def test_rows_are_tied_unless_the_data_tell_them_apart():
    alike, other = [80.0, 20.0], [20.0, 80.0]
    assert tie_rows(np.array([alike, [40.0, 10.0], other, [1.0, 0.0]]), penalty=3.0).tolist() == [0, 0, 1, 0]


def test_the_model_of_a_question_is_found():
    learnt = learn_model(make_people(400, seed=1), reports="bring_{wish}", discount=0.95)
    assert learnt.states == ("milk", "tea")
    pomdp, ask = learnt.pomdp, learnt.pomdp.action_index("ask")
    hear_tea = pomdp.observations.index("hear_tea")
    assert pomdp.start[:2] == pytest.approx([0.3, 0.7], abs=0.05)
    assert pomdp.observation[ask][1, hear_tea] == pytest.approx(0.85, abs=0.05)
    assert pomdp.observation[ask][0, hear_tea] == pytest.approx(0.15, abs=0.07)
    assert pomdp.reward[pomdp.action_index("bring_tea"), :2] == pytest.approx([-10, 10], abs=0.1)
    assert learnt.model.structure.effects[ask] == STAYS


def test_numbers_are_means_of_draws_unless_states_change_places():
    learnt = learn_model(make_people(60, seed=2), reports="bring_{wish}", draws=30)
    own = learnt.model.parameters
    mean = np.mean([each.observation for each in learnt.draws], axis=0)
    np.testing.assert_allclose(own.observation, mean)
    exchanged = [
        Parameters(
            each.start[::-1],
            each.transition[:, ::-1][:, :, [1, 0, 2]],
            each.observation[:, [1, 0, 2]],
            each.reward[:, ::-1],
        )
        for each in learnt.draws[::2]
    ]
    model = replace(
        learnt.model, structure=replace(learnt.model.structure, values=np.zeros(2, dtype=np.intp))
    )
    same = average_models(learnt.episodes, model, learnt.draws[1::2])
    assert same is not model
    assert average_models(learnt.episodes, model, [*exchanged, *learnt.draws[1::2]]) is model


def test_states_have_no_names_without_reports():
    learnt = learn_model(make_people(400, seed=1))
    assert learnt.states == ("s1", "s2")
    ask, hear_tea = learnt.pomdp.action_index("ask"), learnt.pomdp.observations.index("hear_tea")
    assert sorted(learnt.pomdp.observation[ask][:2, hear_tea]) == pytest.approx([0.15, 0.85], abs=0.07)


def test_a_learnt_policy_earns_what_the_true_one_does():
    """The domain of the paper from 400 episodes of random actions, of which all states are hidden."""
    pomdp, rng, episodes = load_domain("intention").pomdp, np.random.default_rng(4), []
    for _ in range(400):
        state, steps = int(rng.choice(5, p=pomdp.start)), []
        while state != 4:
            action = int(rng.integers(5))
            reward = float(pomdp.reward[action, state])
            state = int(rng.choice(5, p=pomdp.transition[action][state]))
            seen = int(rng.choice(3, p=pomdp.observation[action][state]))
            steps.append(Step(pomdp.actions[action], pomdp.observations[seen], reward))
        episodes.append(steps)
    data = Episodes.of(episodes, [True] * 400)
    learnt = learn_model(data, reports="report_{intention}", discount=pomdp.discount, draws=1)
    order = [pomdp.actions.index(name) for name in learnt.pomdp.actions]
    columns = [pomdp.observations.index(name) for name in learnt.pomdp.observations]
    world = type(pomdp)(
        pomdp.states,
        learnt.pomdp.actions,
        learnt.pomdp.observations,
        np.array([pomdp.transition[a] for a in order]),
        np.array([pomdp.observation[a][:, columns] for a in order]),
        pomdp.reward[order],
        pomdp.discount,
        pomdp.start,
    )
    best = solve(pomdp).lower
    earned = simulate(learnt.pomdp, solve(learnt.pomdp).policy, world=world, trials=20_000, seed=0).mean
    assert earned > 0.95 * best


def test_what_no_step_shows_is_not_identifiable():
    """Only people who want tea are smiled at."""
    tea, milk = Step("ask", "hear_tea", -1.0), Step("ask", "hear_milk", -1.0)
    smile = Step("smile", "happy", 0.0)
    people = [
        [tea, tea, smile, Step("bring_tea", "none", 10.0)],
        [tea, tea, smile, Step("bring_milk", "none", -10.0)],
        [milk, milk, Step("bring_milk", "none", 10.0)],
        [milk, milk, Step("bring_tea", "none", -10.0)],
    ]
    report = format_report(learn_model(Episodes.of(people * 10, [True] * 40), reports="bring_{wish}"))
    assert "- observations in tea: happy 1.00" in report
    assert "- observations in milk: not identifiable from these data" in report


def test_reports_that_always_earn_the_same_name_no_states():
    people = [[Step("bring_tea", "none", 5.0)], [Step("bring_milk", "none", 5.0)]]
    with pytest.raises(DataError, match="all reports earned 5, so that nothing relates them to the states"):
        learn_model(Episodes.of(people, [True] * 2), reports="bring_{wish}")


def test_numbers_of_a_report_cover_the_truth():
    """An interval of 95 %, 40 times; 33 or fewer would have a probability below .001 (binomial)."""
    covered = 0
    for seed in range(40):
        people = make_people(150, seed=100 + seed)
        learnt = learn_model(people, reports="bring_{wish}", max_states=3, seed=seed)
        ask, tea = learnt.pomdp.action_index("ask"), learnt.pomdp.observations.index("hear_tea")
        low, high = learnt.find_interval(lambda own, ask=ask, tea=tea: own.observation[ask, 1, tea])
        covered += low <= 0.85 <= high
    assert covered > 33


def test_a_folder_is_a_domain_that_runs(tmp_path):
    learnt = learn_model(make_people(200, seed=2), reports="bring_{wish}")
    write_model(tmp_path / "drinks", learnt)
    domain = load_domain(tmp_path / "drinks")
    assert domain.values == ("milk", "tea")
    assert domain.pomdp.states == learnt.pomdp.states
    assert domain.pomdp.reward == pytest.approx(learnt.pomdp.reward)
    assert "hear_tea 0." in (tmp_path / "drinks" / "report.md").read_text()
    with pytest.raises(DomainError, match="expected a new or an empty folder"):
        write_model(tmp_path / "drinks", learnt)


def test_a_folder_without_reports_has_the_model(tmp_path):
    learnt = learn_model(make_people(100, seed=2))
    write_model(tmp_path / "model", learnt)
    assert sorted(path.name for path in (tmp_path / "model").iterdir()) == ["interaction.pomdp", "report.md"]
    assert read_pomdp(tmp_path / "model" / "interaction.pomdp").reward == pytest.approx(learnt.pomdp.reward)


def test_states_that_a_value_lacks_are_copies_that_nothing_reaches(tmp_path):
    """Tea has a second state after "warm", milk has none."""
    learnt = learn_model(make_people(200, seed=2), reports="bring_{wish}", max_states=2, draws=2)
    own, states = learnt.model.parameters, [0, 1, 1]
    transition = own.transition[:, states][:, :, [0, 1, 1, 2]].copy()
    transition[:, :, 2] = 0.0
    ask = learnt.episodes.action_names.index("ask")
    transition[ask] = [[1, 0, 0, 0], [0, 0.4, 0.6, 0], [0, 0, 1, 0]]
    observation = own.observation[:, [*states, 2]].copy()
    observation[ask, 2] = [1, 0, 0]  # the second state of tea sounds like milk
    parameters = Parameters(np.append(own.start, 0.0), transition, observation, own.reward[:, states].copy())
    structure = Structure.free(learnt.space, np.array(states), np.full(3, MOVES), 3)
    model = replace(learnt.model, parameters=parameters, structure=structure)
    grown = replace(learnt, model=model, states=("milk_1", "tea_1", "tea_2"), draws=(parameters,))
    write_model(tmp_path / "drinks", grown)
    domain = load_domain(tmp_path / "drinks")
    assert domain.pomdp.states == ("milk_1", "milk_2", "tea_1", "tea_2", "over")
    assert domain.pomdp.start.tolist() == pytest.approx([own.start[0], 0, own.start[1], 0, 0])
    for table in domain.pomdp.transition:
        assert table[[0, 2, 3, 4], 1].max() == 0
    assert solve(domain.pomdp).lower == pytest.approx(solve(grown.pomdp).lower, abs=0.01)
    report = (tmp_path / "drinks" / "report.md").read_text()
    assert "- from tea_1 to tea_2 0.60 [0.60, 0.60], tea_1 0.40 [0.40, 0.40]" in report


def test_values_of_reports_do_not_change():
    """People whose wish is drawn again after each question: without reports so, with them not."""
    rng, episodes = np.random.default_rng(0), []
    for _ in range(300):
        steps = []
        for _ in range(3):
            wish = rng.choice(["tea", "milk"])
            steps.append(Step("ask", f"hear_{wish}", 1.0 if wish == "tea" else -1.0))
        report = rng.choice(["tea", "milk"])
        steps.append(Step(f"bring_{report}", "none", 10.0 if report == wish else -10.0))
        episodes.append(steps)
    data = Episodes.of(episodes, [True] * 300)
    ask = data.action_names.index("ask")
    assert learn_model(data, draws=1).model.structure.effects[ask] != STAYS
    learnt = learn_model(data, reports="bring_{wish}", draws=1).model
    assert RESTARTS not in learnt.structure.effects
    for a, k in np.ndindex(learnt.parameters.transition.shape[:2]):
        other = learnt.structure.values != learnt.structure.values[k]
        assert learnt.parameters.transition[a, k, :-1][other].sum() == 0


RUN = "from lcorpp.cli.main import main; main()"
HEADER = "episode,action,observation,reward\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "episode,action\n1,ask\n",
            r":2: no reward; expected the columns episode, action, observation, reward",
        ),
        (HEADER + "1,ask,,-1\n", r":2: no observation; expected"),
        (HEADER + "1,ask,yes,high\n", r":2: the reward is high; expected a finite number"),
        (HEADER + "1,ask,yes,inf\n", r":2: the reward is inf; expected a finite number"),
        (HEADER + "1,ask,yes,-1\n2,ask,no,-1\n1,end,no,0\n", r":4: episode 1 goes on after another one"),
        (
            "episode,action,observation,reward,end\n1,a,x,0,1\n1,a,x,0,0\n",
            r":3: episode 1 goes on after its end",
        ),
        (
            "episode,action,observation,reward,end\n1,a,x,0,maybe\n",
            r":2: end is maybe; expected 1, true, yes",
        ),
        (HEADER, r": there are no episodes"),
        (HEADER + "".join(f"{i},a,x,{i}\n" for i in range(60)), r"60 different rewards; expected at most 50"),
    ],
)
def test_wrong_tables_are_refused(tmp_path, text, message):
    path = tmp_path / "steps.csv"
    path.write_text(text)
    with pytest.raises(DataError, match=message):
        read_episodes(path)


def test_ends_are_stated_or_follow_from_the_actions(tmp_path):
    path = tmp_path / "steps.csv"
    path.write_text(HEADER + "1,ask,yes,-1\n1,leave,none,1\n2,ask,no,-1\n")
    assert read_episodes(path).ended.tolist() == [True, False]
    path.write_text("episode,action,observation,reward,end\n1,ask,yes,-1,1\n2,ask,no,-1,0\n")
    assert read_episodes(path).ended.tolist() == [True, False]


@pytest.mark.parametrize(
    ("pattern", "message"),
    [
        ("report", r"expected variables in braces, each once, as in report_\{intention\}"),
        ("bring_{a}_{a}", r"each once"),
        ("take_{wish}", r"0 actions fit to the reports 'take_\{wish\}'; expected at least two"),
    ],
)
def test_wrong_patterns_are_refused(pattern, message):
    with pytest.raises(DataError, match=message):
        learn_model(make_people(5, seed=0), reports=pattern)


def test_each_combination_needs_a_report():
    names = ("bring_tea_lab", "bring_milk_hall", "bring_tea_hall")
    episodes = Episodes.of([[Step(name, "none", float(i))] for i, name in enumerate(names)], [True] * 3)
    with pytest.raises(DataError, match="no report of milk, lab; expected one for each combination"):
        Space.of_reports(episodes, "bring_{item}_{room}")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"discount": 1.0}, "the discount is 1.0; expected"),
        ({"max_states": 1, "reports": "bring_{wish}"}, "max_states is 1; expected at least 2"),
        ({"draws": 0}, "draws is 0; expected at least 1"),
    ],
)
def test_wrong_options_are_refused(options, message):
    with pytest.raises(ModelError, match=message):
        learn_model(make_people(5, seed=0), **options)


def test_the_command(lcorpp, tmp_path):
    lines, people = [HEADER.strip()], make_people(100, seed=3)
    for i in range(len(people)):
        for t in range(people.begins[i], people.begins[i + 1]):
            action = people.action_names[people.actions[t]]
            seen = people.observation_names[people.observations[t]]
            lines.append(f"{i},{action},{seen},{people.reward_values[people.rewards[t]]}")
    (tmp_path / "steps.csv").write_text("\n".join(lines) + "\n")
    folder = tmp_path / "drinks"
    arguments = ("model", tmp_path / "steps.csv", "-o", folder, "--reports", "bring_{wish}")
    ended = lcorpp(*arguments)
    assert ended.code == 0, ended.err
    assert "2 states: milk, tea" in ended.out
    assert load_domain(folder).values == ("milk", "tea")
    again = lcorpp(*arguments)
    assert again.code == 2
    assert "expected a new or an empty folder" in again.err


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("bring_tea", "bring_Tea", "the value of wish 'Tea': expected a lower-case letter"),
        ("ask,", "ask them,", "the name 'ask them' cannot be written into a .pomdp file"),
    ],
)
def test_names_are_checked_before_learning(lcorpp, tmp_path, monkeypatch, old, new, message):
    monkeypatch.setattr("lcorpp.model_learning.learnt_model.learn", None)  # learning would fail
    rows = "1,ask,hear_tea,-1\n1,bring_tea,none,10\n2,ask,hear_tea,-1\n2,bring_milk,none,-10\n"
    (tmp_path / "steps.csv").write_text(HEADER + rows.replace(old, new))
    ended = lcorpp("model", tmp_path / "steps.csv", "-o", tmp_path / "out", "--reports", "bring_{wish}")
    assert ended.code == 2
    assert message in ended.err
    assert not (tmp_path / "out").exists()


FACTS = """episode,wish,time,action,observation,reward
1,tea,day,ask,hear_tea,-1
1,,day,bring_tea,none,10
2,,,ask,hear_tea,-1
2,,night,bring_milk,none,-10
"""


def test_facts_of_episodes_are_read(tmp_path):
    (tmp_path / "steps.csv").write_text(FACTS)
    episodes = read_episodes(tmp_path / "steps.csv", ["wish", "time"])
    assert episodes.facts == ({"wish": "tea", "time": "day"}, {"time": "night"})
    assert not any(read_episodes(tmp_path / "steps.csv").facts)


@pytest.mark.parametrize(
    ("facts", "change", "message"),
    [
        (
            ["time"],
            ("1,,day,", "1,,night,"),
            ":3: time is night, and day before in episode 1; expected one value",
        ),
        (["place"], ("", ""), "no cell of the column place; expected it, as it is one of the facts"),
        (["wish"], ("1,tea", "1,wine"), ":2: wish is wine; expected one of milk, tea, as in the reports"),
    ],
)
def test_wrong_facts_are_refused(tmp_path, facts, change, message):
    (tmp_path / "steps.csv").write_text(FACTS.replace(*change))
    with pytest.raises(DataError, match=message):
        learn_model(read_episodes(tmp_path / "steps.csv", facts), reports="bring_{wish}")


def test_facts_need_reports(tmp_path):
    (tmp_path / "steps.csv").write_text(FACTS)
    with pytest.raises(DataError, match="facts, hidden attributes and an order need reports"):
        learn_model(read_episodes(tmp_path / "steps.csv", ["time"]))


def test_evidence_is_part_of_the_start():
    """Counts are those of each episode alone, whose start is weighed by its evidence."""
    rng, people = np.random.default_rng(3), make_people(6, seed=5)
    sizes = len(people.action_names), len(people.observation_names), len(people.reward_values)
    own, values = draw_parameters(rng, 3, *sizes), np.array([0, 1, 1])  # two states of the second value
    evidence = rng.uniform(size=(6, 2))
    evidence[2] = [0, 1]  # a true value
    found = expect(replace(people, evidence=evidence), own, values)
    total = np.zeros(3)
    for n in range(6):
        start = own.start * evidence[n, values]
        alone = expect(people.select(np.array([n])), replace(own, start=start / start.sum()))
        total += alone.counts.start
        expected = alone.log_likelihoods[0] + np.log(start.sum())
        assert found.log_likelihoods[n] == pytest.approx(expected)
        assert n != 2 or alone.counts.start[0] == 0
    assert found.counts.start == pytest.approx(total)


def test_facts_are_in_the_domain(tmp_path):
    """The knowledge relates a fact to the wish: tea by day, milk at night."""
    rng, episodes, facts = np.random.default_rng(1), [], []
    for _ in range(300):
        wish = rng.choice(["tea", "milk"])
        usual = {"tea": "day", "milk": "night"}[wish]
        facts.append({"time": usual if rng.random() < 0.8 else {"day": "night", "night": "day"}[usual]})
        report = rng.choice(["tea", "milk"])
        heard = wish if rng.random() < 0.8 else {"tea": "milk", "milk": "tea"}[wish]
        steps = [
            Step("ask", f"hear_{heard}", -1.0),
            Step(f"bring_{report}", "none", 9.0 if report == wish else -9.0),
        ]
        episodes.append(steps)
    learnt = learn_model(Episodes.of(episodes, [True] * 300, facts), reports="bring_{wish}")
    write_model(tmp_path / "own", learnt)
    domain = load_domain(tmp_path / "own")
    assert domain.observed == ("time",)
    rates = {
        str(own.statement).partition(" = ")[0]: float(own.value) for own in learnt.knowledge.fitted.numbers
    }
    assert rates["pr(time=day | wish=tea)"] == pytest.approx(0.8, abs=0.08)
    assert rates["pr(time=day | wish=milk)"] == pytest.approx(0.2, abs=0.08)


def test_selected_episodes_are_those_episodes():
    people = make_people(20, seed=4)
    places = np.array([3, 3, 0, 19])
    chosen = people.select(places)
    assert len(chosen) == 4
    rng = np.random.default_rng(2)
    parameters = draw_parameters(
        rng, 2, len(people.action_names), len(people.observation_names), len(people.reward_values)
    )
    logs = expect(people, parameters).log_likelihoods
    assert expect(chosen, parameters).log_likelihoods == pytest.approx(logs[places])


def test_records_and_their_options(lcorpp, tmp_path):
    (tmp_path / "own.csv").write_text("a,b,c\n" + 30 * "x,u,1\n" + 30 * "y,v,2\n")
    ended = lcorpp(
        "model", tmp_path / "own.csv", "-o", tmp_path / "own", "--facts", "a,b", "--order", "b < a"
    )
    assert ended.code == 0, ended.err
    assert "a depends on b" in ended.out
    assert "c" not in (tmp_path / "own/knowledge.plog").read_text().partition("\n\n")[2].split()
    for arguments, message in (
        (("--facts", "d"), "no column d; expected one of a, b, c"),
        (("--discount", "0.9"), "has records; expected no --discount, which is for others"),
        (("--order", "a < d"), "the order 'a < d' has 'd'; expected one of a, b, c"),
    ):
        wrong = lcorpp("model", tmp_path / "own.csv", "-o", tmp_path / "other", *arguments)
        assert wrong.code == 2
        assert message in wrong.err
    assert not (tmp_path / "other").exists()


def test_rows_of_tiny_weights_are_drawn():
    """Gamma variables of tiny shapes are 0, and a Dirichlet distribution is then one of its corners."""
    rng, weights = np.random.default_rng(0), np.array([[3e-4, 1e-4, 0.0]] * 400)
    rows = _draw_rows(weights, rng)
    assert rows.sum(axis=1) == pytest.approx(np.ones(400))
    assert not rows[:, 2].any()
    assert rows[:, 0].mean() == pytest.approx(0.75, abs=0.08)


def test_a_pipe_is_read_as_a_file(tmp_path):
    rows = "a,b\n" + 30 * "x,u\n" + 30 * "y,v\n"
    (tmp_path / "own.csv").write_text(rows)
    for name, source in (("file", tmp_path / "own.csv"), ("pipe", "/dev/stdin")):
        command = [sys.executable, "-c", RUN, "model", source, "-o", tmp_path / name]
        subprocess.run(command, input=rows, text=True, check=True, capture_output=True)
    one, other = (tmp_path / name / "knowledge.plog" for name in ("file", "pipe"))
    assert one.read_text() == other.read_text()


def test_wrong_folders_names_and_hidden_attributes_are_refused(lcorpp, tmp_path, monkeypatch):
    (tmp_path / "own.csv").write_text("a,b\n" + 30 * "x,u\n" + 30 * "y,v\n")
    rows = "1,ask,yes,-1\n1,bring_over,none,10\n2,ask,no,-1\n2,bring_tea,none,-10\n"
    (tmp_path / "steps.csv").write_text(HEADER + rows)
    (tmp_path / "many.csv").write_text("a,b\n" + "".join(f"n{i},{i % 2}\n" for i in range(101)))
    (tmp_path / "link").symlink_to(tmp_path / "new")
    folder = tmp_path / "empty"
    folder.mkdir()
    monkeypatch.chdir(folder)
    own, steps = ("model", tmp_path / "own.csv"), ("model", tmp_path / "steps.csv")
    for arguments, message in (
        ((*own, "-o", "."), ".: a link or the working folder; expected a new or an empty folder"),
        ((*own, "-o", tmp_path / "link"), "link: a link or the working folder"),
        ((*own, "-o", "out", "--hidden", "h=2", "--hidden", "h=3"), "--hidden has h twice; expected it once"),
        ((*own, "-o", "out", "--hidden", "a=2"), "own.csv:2: a is stated; expected no value of a hidden"),
        (("model", tmp_path / "many.csv", "-o", "out"), "many.csv: a has 101 values; expected at most 100"),
        ((*steps, "-o", "out", "--reports", "bring_{w}"), "would be the state over, which is the end of a"),
        (
            (*steps, "-o", "out", "--reports", "w: bring_over=x, bring_tea=x"),
            "name the same values; expected two or more of a variable",
        ),
    ):
        ended = lcorpp(*arguments)
        assert ended.code == 2
        assert message in ended.err
    assert not any(folder.iterdir())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"order": ["wish < place"]}, "the order 'wish < place' has 'place'; expected one of wish, time"),
        ({"order": ["wish < time", "time < wish"]}, "before itself"),
        ({"hidden": {"time": ("1", "2")}}, "the hidden attribute time is one of those that are stated"),
    ],
)
def test_attributes_are_checked_before_learning(tmp_path, monkeypatch, options, message):
    monkeypatch.setattr("lcorpp.model_learning.learnt_model.learn", None)  # learning would fail
    (tmp_path / "steps.csv").write_text(FACTS)
    with pytest.raises(DataError, match=message):
        learn_model(read_episodes(tmp_path / "steps.csv", ["time"]), reports="bring_{wish}", **options)
