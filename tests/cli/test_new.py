"""`lcorpp new`: by flags and by six questions."""

import io

import pytest


@pytest.fixture
def answer(monkeypatch):
    """Type lines at a terminal."""

    def prepare(*lines):
        terminal = io.StringIO("".join(f"{line}\n" for line in lines))
        terminal.isatty = lambda: True
        monkeypatch.setattr("sys.stdin", terminal)

    return prepare


def test_flags_write_a_domain_that_runs(tmp_path, lcorpp):
    folder = tmp_path / "errands"
    flags = ("--fact", "time=morning:0.3,evening", "--shared", "item=tea,book", "--shared", "room=lab,hall")
    senses = ("--sense", "gaze:item:0.9", "--question", "ask:1:0.85", "--right", 30, "--wrong", -10)
    ended = lcorpp("new", folder, *flags, *senses)
    assert ended.code == 0, ended.err
    assert f"then: lcorpp run {folder}" in ended.out
    question = "question ask_item, of item: costs 1, understood rightly with probability 0.85"
    assert question in " ".join(ended.out.split())
    ended = lcorpp("check", folder)
    assert (ended.code, "decides item, room among 4 combinations" in ended.out) == (0, True), ended.err
    ended = lcorpp("run", folder, "--trials", 50, "--jobs", 1)
    assert ended.code == 0, ended.err
    assert "LCORPP" in ended.out
    for arguments, words in (
        ((folder, *flags), "errands: exists; expected a new or an empty folder"),
        ((tmp_path / "x", "--right", 3), "--shared is missing; expected --shared NAME=VALUE"),
        ((tmp_path / "x", "--shared", "tea"), "'tea': expected NAME=VALUE,VALUE"),
        ((tmp_path / "x", "--shared", "wish=a,b", "--right", "nan"), "the rewards nan and -20"),
    ):
        refused = lcorpp("new", *arguments)
        assert refused.code == 2
        assert words in refused.err
    assert not (tmp_path / "x").exists()


def test_check_names_the_values_where_a_sense_guesses(tmp_path, lcorpp):
    folder = tmp_path / "errands"
    lcorpp("new", folder, "--shared", "room=lab,hall", "--sense", "gaze:room:0.9")
    assert "guesses" not in lcorpp("check", folder).out
    for name, changes in {
        "knowledge.plog": {
            "lab, hall": "lab, hall, shop",
            "gaze_lab, gaze_hall": "gaze_lab, gaze_hall, gaze_shop",
        },
        "domain.toml": {'gaze_hall = "hall"': 'gaze_hall = "hall", gaze_shop = "shop"'},
    }.items():
        text = (folder / name).read_text()
        for old, new in changes.items():
            assert old in text
            text = text.replace(old, new)
        (folder / name).write_text(text)
    ended = lcorpp("check", folder)
    assert ended.code == 0, ended.err
    words = " ".join(ended.out.split())
    assert "note: gaze guesses where room is shop: its labels are equally probable there" in words
    assert "e.g. pr(gaze=gaze_shop | room=shop) = 0.8." in words


def test_check_names_a_function_that_its_file_lacks(tmp_path, lcorpp):
    folder = tmp_path / "errands"
    lcorpp("new", folder, "--shared", "room=lab,hall", "--sense", "gaze:room:0.9")
    (folder / "mine.py").write_text("def walking():\n    pass\n")
    (folder / "people.py").write_text("def gaze(people, rng):\n    return [[0.0] for _ in people]\n")
    text = (folder / "domain.toml").read_text() + '\n[simulation]\npeople = "people.py"\n'
    (folder / "domain.toml").write_text(text.replace('"channel" ', '"mine.py:walkin" '))
    ended = lcorpp("check", folder)
    assert ended.code == 2
    assert ended.err.endswith("mine.py has no function 'walkin'; expected one of walking\n")
    (folder / "domain.toml").write_text(text)
    assert lcorpp("check", folder / "domain.toml").code == 0
    assert lcorpp("run", folder / "domain.toml", "--exact", "--strategy", "R").code == 0


def test_six_questions(tmp_path, lcorpp, answer):
    answer("Drinks", "time=morning,evening", "wish=tea,coffee", "gaze:0.9", "", "20 -30")
    ended = lcorpp("new", tmp_path / "drinks")
    assert ended.code == 0, ended.err
    assert [f"{number}. " in ended.out for number in range(1, 8)] == [True] * 6 + [False]
    ended = lcorpp("run", tmp_path / "drinks", "--exact")
    assert ended.code == 0, ended.err
    assert "Drinks" in ended.out
    assert "RIGHT, WRONG = 20.0, -30.0" in (tmp_path / "drinks" / "interaction.py").read_text()


def test_wrong_answers_are_asked_again(tmp_path, lcorpp, answer):
    answer("", "time", "", "", "wish=tea,coffee", "nose:ear", "", "ask:1:0.8", "20", "")
    ended = lcorpp("new", tmp_path / "again")
    assert ended.code == 0, ended.err
    for words in ("'time': expected", "expected at least one variable", "is about 'ear'", "two numbers"):
        assert words in ended.out
    assert 'name = "again"' in (tmp_path / "again" / "domain.toml").read_text()


@pytest.mark.parametrize("number", range(1, 7))
def test_an_interrupt_leaves_nothing_behind(tmp_path, lcorpp, monkeypatch, answer, number):
    lines = iter(("", "", "wish=tea,coffee", "", "", "")[: number - 1])

    def type_line(question):
        line = next(lines, None)
        if line is None:
            assert question.startswith(f"{number}. ")
            raise KeyboardInterrupt
        return line

    answer()
    monkeypatch.setattr("builtins.input", type_line)
    ended = lcorpp("new", tmp_path / "x")
    assert (ended.code, ended.err) == (130, "lcorpp: interrupted\n")
    assert list(tmp_path.iterdir()) == []


def test_without_a_terminal_the_questions_are_refused(tmp_path, lcorpp, monkeypatch, answer):
    answer("only one line")
    refused = lcorpp("new", tmp_path / "x")
    assert (refused.code, "the input ended at question 2" in refused.err) == (2, True)
    monkeypatch.setattr("sys.stdin", io.StringIO("Drinks\n"))
    refused = lcorpp("new", tmp_path / "x")
    assert (refused.code, "which needs a terminal; or give --shared" in refused.err) == (2, True)
    monkeypatch.setattr("sys.stdin", None)
    refused = lcorpp("new", tmp_path / "x")
    assert (refused.code, "which needs a terminal" in refused.err) == (2, True)
    assert not (tmp_path / "x").exists()


def test_knowledge_as_tables_gives_the_same_numbers(tmp_path, lcorpp):
    folder = tmp_path / "drinks"
    flags = (
        "--fact",
        "time=morning:0.3,evening",
        "--shared",
        "wish=tea,coffee,juice",
        "--sense",
        "gaze:wish:0.8",
    )
    ended = lcorpp("new", folder, *flags, "--tables")
    assert "edit its knowledge.csv and interaction.py" in " ".join(ended.out.split())
    table = folder / "knowledge.csv"
    assert "wish = tea,wish = coffee,wish = juice\n1/3,1/3,1/3\n" in table.read_text()
    dependent = "time,wish = tea,wish = coffee,wish = juice\nmorning,20 %,70 %,10 %\n,50 %,10 %,rest\n"
    table.write_text(
        table.read_text().replace("wish = tea,wish = coffee,wish = juice\n1/3,1/3,1/3\n", dependent)
    )
    checked = lcorpp("check", table)
    assert (checked.code, "3 variables, 17 numbers" in checked.out) == (0, True), checked.err
    expected = lcorpp("run", folder, "--trials", 30, "--jobs", 1)
    assert expected.code == 0, expected.err
    config = folder / "domain.toml"
    for form in ("plog", "toml"):
        file = folder / f"knowledge.{form}"
        assert lcorpp("translate", table, "-o", file).code == 0
        config.write_text(config.read_text().replace('"knowledge.csv"', f'"knowledge.{form}"'))
        assert lcorpp("check", file).code == 0
        found = lcorpp("run", folder, "--trials", 30, "--jobs", 1)
        assert found.out.partition("SARSOP")[0] == expected.out.partition("SARSOP")[0]
        config.write_text(config.read_text().replace(f'"knowledge.{form}"', '"knowledge.csv"'))
    assert "wish = tea" in lcorpp("translate", folder / "knowledge.plog", "--to", "csv").out
    table.write_text(table.read_text().replace("morning,20 %", "mornin,20 %"))
    for command in (("check", folder), ("run", folder), ("ask", table, "wish")):
        refused = lcorpp(*command)
        assert refused.code == 2
        assert "mornin is not a value of time; expected one of morning, evening" in " ".join(
            refused.err.split()
        )


def test_percent_and_spaces_in_answers(tmp_path, lcorpp, answer):
    options = [
        "--fact",
        "time=morning:70%,evening",
        "--shared",
        "wish=tea:20 %,coffee",
        "--sense",
        "gaze:wish:90%",
    ]
    ended = lcorpp("new", tmp_path / "percent", *options, "--question", "ask:1:80%")
    assert ended.code == 0, ended.err
    text = (tmp_path / "percent" / "knowledge.plog").read_text()
    assert "pr(time=morning) = 0.70." in text or "pr(time=morning) = 0.7." in text
    answer("", "time=morning, evening", "wish=tea,  coffee", "", "ask:2", "")
    ended = lcorpp("new", tmp_path / "asked")
    assert ended.code == 0, ended.err
    assert 'observed = ["time"]' in (tmp_path / "asked" / "domain.toml").read_text()
