"""Files of sweeps: their configurations and error messages."""

import re

import pytest

from lcorpp.errors import DomainError, ParseError
from lcorpp.experiments.sweeps.definition import read_sweep

ATOM = '"intention=interested | identity=student"'


@pytest.fixture
def read(tmp_path):
    def read_text(text: str):
        (tmp_path / "s.toml").write_text(text)
        return read_sweep(tmp_path / "s.toml")

    return read_text


def values(sweep):
    return [tuple(setting.value for setting in configuration) for configuration in sweep.configurations]


def test_all_combinations_in_the_order_of_the_file(read):
    sweep = read("[axes]\nnoise = [0.1, 0.2]\ncost.greet = [1, 2, 4]\n")
    assert values(sweep) == [(n, c) for n in (0.1, 0.2) for c in (1, 2, 4)]
    assert sweep.map_axes == (("noise",), ("cost", "greet"))


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("{ from = 0.1, to = 0.3, count = 3 }", [0.1, 0.2, 0.3]),
        ("{ from = 0.1, to = 0.7, step = 0.2 }", [0.1, 0.3, 0.5, 0.7]),
        ("[0.4]", [0.4]),
    ],
)
def test_ranges_have_no_rounding_errors(read, text, numbers):
    assert values(read(f"[axes]\nnoise = {text}")) == [(number,) for number in numbers]


def test_axes_that_vary_jointly(read):
    sweep = read(
        'together = [["noise", "discount"]]\nmap = ["cost.greet", "discount"]\n'
        "[axes]\nnoise = [0.1, 0.2]\ncost.greet = [1, 2]\ndiscount = [0.8, 0.9]\n"
    )
    assert values(sweep) == [(0.1, 1, 0.8), (0.1, 2, 0.8), (0.2, 1, 0.9), (0.2, 2, 0.9)]
    assert sweep.map_axes == (("cost", "greet"), ("discount",))


def test_the_robot_and_the_world_vary_apart(read):
    sweep = read("[axes]\nknown.classifier.interested = [0.7]\ntrue.classifier.interested = [0.8, 0.9]\n")
    assert values(sweep) == [(0.7, 0.8), (0.7, 0.9)]


def test_a_name_in_quotes_is_the_same_axis(read):
    assert read('[axes]\n"cost.greet" = [1, 2]').axes == read("[axes]\ncost.greet = [1, 2]").axes


def test_files_of_knowledge_are_beside_the_sweep_or_in_the_domain(read, tmp_path):
    from lcorpp.domains.loading import SHIPPED_FOLDER
    from lcorpp.experiments.sweeps.axes import configure
    from lcorpp.experiments.sweeps.evaluation import find_key

    shipped = (SHIPPED_FOLDER / "intention" / "knowledge.plog").read_text()
    (tmp_path / "mine.plog").write_text(shipped.replace("= 0.8.", "= 0.7."))
    text = '[axes]\nknowledge = ["knowledge.plog", "mine.plog"]'
    sweep = read(text)
    same, other = [configure(sweep.problem, configuration) for configuration in sweep.configurations]
    assert same.program == same.simulation.true_program == other.simulation.true_program != other.program
    (tmp_path / "mine.plog").write_text(shipped.replace("= 0.8.", "= 0.6."))
    keys = [[find_key(configuration) for configuration in s.configurations] for s in (sweep, read(text))]
    assert keys[0][0] == keys[1][0]
    assert keys[0][1] != keys[1][1]  # another content is another configuration


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "[axes]\nnois = [0.1]",
            "s.toml:2: [axes] nois: unknown axis; did you mean 'noise'? expected one of",
        ),
        ("[axes]\ncost.gret = [1]", "s.toml:2: [axes.cost] gret: unknown axis; did you mean 'cost.greet'?"),
        (f'[axes]\npr.{ATOM[:-1]}s" = [1]', "did you mean 'pr.intention=interested|identity=student'?"),
        ("[axes]\nnoise = []", "s.toml:2: [axes] noise: the axis is empty; expected at least one value"),
        ("[axes]", "s.toml:1: axes: expected at least one axis"),
        ('domain = "intention"', "axes is missing"),
        ("[axes]\nnoise = 0.1", "s.toml:2: [axes] noise: expected a list such as [0.1, 0.2], or a range"),
        ('[axes]\nnoise = ["high"]', "[axes] noise: expected numbers from 0 to 1, not 'high'"),
        ("[axes]\nnoise = [0.1, true]", "expected finite numbers, or texts, not True in [0.1, True]"),
        ('[axes]\nnoise = [0.1, "0.2"]', "expected finite numbers, or texts, not 0.1 in [0.1, '0.2']"),
        ("[axes]\nnoise = [0.1, 0.1]", "0.1 appears twice"),
        ("[axes]\nnoise = [1.5]", "expected numbers from 0 to 1, not 1.5"),
        (
            "[axes]\ndiscount = [1]",
            "s.toml:2: [axes] discount = 1: expected a discount below 1: a dialogue may",
        ),
        ("[axes]\ncost.greet = [-1]", "expected numbers of at least 0, not -1"),
        ("[axes]\nreward.right = [nan]", "not nan"),
        ("[axes]\nnoise = { from = 0.1, to = 0.2 }", "expected a range with from, to, and count or step"),
        ("[axes]\nnoise = { from = 0.2, to = 0.1, count = 3 }", "from = 0.2 is not below to = 0.1"),
        ("[axes]\nnoise = { from = 0.1, to = 0.2, cuont = 3 }", "unknown key 'cuont' of a range"),
        (
            "[axes]\nnoise = { from = 0.1, to = 0.2, step = 0.03 }",
            "step = 0.03 does not lead from 0.1 to 0.2",
        ),
        ("[axes]\nnoise = { from = 0.1, to = 0.2, count = 1.5 }", "expected a whole number from 2 to"),
        ('[axes]\nknowledge = ["none.plog"]', "[axes] knowledge: no file"),
        ("[axes]\nknowledge = [1]", "expected names of P-log programs, not [1]"),
        ("[axes]\nsimulation.nois = [0.1]", "nois: unknown key; expected one of"),
        (
            '[axes]\npr."time=morning | identity=student" = [0.99]',
            "s.toml:2: [axes.pr] time=morning | identity=student = 0.99: ",
        ),
        (
            "[axes]\nprevalence.interested = [0.1]\nknown.prevalence.not_interested = [0.2]",
            "s.toml:3: [axes.known.prevalence] not_interested: prevalence.interested changes the same",
        ),
        (
            "[axes]\nnoise = [0.1]\nsimulation.noise = [0.2]",
            "s.toml:3: [axes.simulation] noise: noise changes",
        ),
        (
            '[axes]\n"reward.right" = [9]\nreward.right.interested = [8]',
            "s.toml:3: [axes.reward.right] interested: reward.right changes the same",
        ),
        (f"[axes]\npr.{ATOM} = [0.1]\ntrue.pr.{ATOM.replace(' ', '')} = [0.2]", "changes the same"),
        (f"[axes]\npr.{ATOM} = [0.1]\npr.{ATOM.replace(' ', '')} = [0.2]", "changes the same"),
        ('[axes]\ncost.greet = [1]\n"cost.greet" = [2]', "cost.greet: cost.greet changes the same"),
        (
            "[axes]\nnoise = {}\ndiscount = [0.9]",
            "s.toml:2: [axes] noise: expected a range with from, to, and",
        ),
        (
            "[axes]\nnoise = { count = 3 }",
            "s.toml:2: [axes] noise: expected a range with from, to, and count",
        ),
        ("[axes.cost]\ngreet = 3", "s.toml:2: [axes.cost] greet: expected a list such as"),
        ("[axes]\ncost.ask = [1]", "[axes.cost] ask: unknown axis; expected one of cost."),
        ("strategies = []\n[axes]\nnoise = [0.1]", "s.toml:1: strategies: expected at least one name"),
        ('domain = "intent"\n[axes]', "s.toml:1: domain: intent: no folder with a domain.toml"),
        ('preset = "papr"\n[axes]', "unknown preset 'papr'; expected one of paper, authors"),
        ('strategies = ["LCORP"]\n[axes]', "s.toml:1: strategies: unknown strategy"),
        ("trials = 0\n[axes]", "s.toml:1: trials: expected a whole number of at least 2, not 0"),
        ("trails = 5\n[axes]\nnoise = [0.1]", "s.toml:1: trails: unknown key; expected one of"),
        ('strategies = ["random"]\n[axes]', "'random' draws its actions, so it has no exact scores"),
        (
            'map = ["noise", "cost"]\n[axes]\nnoise = [0.1]',
            "map: 'cost' is not an axis of this sweep; expected one of noise",
        ),
        (
            'together = [["noise", "discount"]]\n[axes]\nnoise = [0.1]\ndiscount = [0.8, 0.9]',
            "s.toml:1: together: noise has 1, discount has 2 values; expected equally many",
        ),
        ("together = [[]]\n[axes]\nnoise = [0.1]", "together: expected lists of axes"),
    ],
)
def test_errors_name_the_place_and_what_was_expected(read, text, words):
    with pytest.raises(DomainError, match=re.escape(words)):
        read(text)


def test_a_file_that_is_not_toml(read):
    with pytest.raises(ParseError, match=r"s\.toml:2:9"):
        read("[axes]\nnoise = \n")
