"""`lcorpp check`: validate a file or a folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import console, model_files
from lcorpp.cli.options.code import take_consent
from lcorpp.errors import DataError, DomainError, FileError, TooLargeError
from lcorpp.notebook import join_some
from lcorpp.user_code import UserFunction

if TYPE_CHECKING:
    from lcorpp.domains import Domain
    from lcorpp.domains.sections.reasoning import ReasoningSection
    from lcorpp.planning import Pomdp
    from lcorpp.reasoning import Program

KINDS = (
    "a .plog, .pl, .plp, .mln, .bif, .csv, .pomdp, .pomdpx, .policy, .xml or .alpha file, a domain folder or"
    " its domain.toml, a folder of recorded tracks, a store of tracks, a robot.toml, a .toml file of tables"
)

PROGRAMS = (".plog", ".pl", ".problog", ".lp", ".plp", ".mln", ".bif", ".csv")
"""Suffixes of programs of P-log, ProbLog, plingo and Markov logic, of Bayesian networks and of tables."""

MAX_VALUES = 12
"""Maximum number of values of a shared variable that are listed."""

AUTHORS_FILE = "interposx.csv"
"""A file that identifies a folder of the authors' recorded tracks."""


@take_consent
def check(
    path: Annotated[Path, typer.Argument(metavar="FILE|FOLDER", help=f"What to check: {KINDS}.")],
    model: Annotated[
        Path | None, typer.Option(metavar="MODEL", help="The model that a policy belongs to.")
    ] = None,
    no_code: Annotated[
        bool,
        typer.Option(
            "--no-code", help="Run no Python code of a domain folder: check its syntax and all other files."
        ),
    ] = False,
) -> None:
    """Check a file or a folder and print its content.

    The first error ends the command with exit code 2.
    """
    from lcorpp.domains.loading import SHIPPED_FOLDER, list_domains
    from lcorpp.learning.store import is_store
    from lcorpp.reasoning.language.networks.written_tables import is_table_file

    suffix = path.suffix.lower()
    is_program = suffix in PROGRAMS or (suffix == ".toml" and is_table_file(path))
    check_folder = _inspect_domain if no_code else _check_domain
    if path.is_dir() and (path / AUTHORS_FILE).exists():
        _check_tracks(path)
    elif suffix == ".toml" and not is_program and path.name != "domain.toml":
        if no_code:
            raise FileError(f"{path}: --no-code checks a domain folder; give that of the robot")
        _check_robot(path)
    elif path.is_dir() or path.name == "domain.toml":
        check_folder(path if path.is_dir() else path.parent)
    elif not path.exists() and str(path) in list_domains():
        check_folder(SHIPPED_FOLDER / path)
    elif is_store(path):
        _check_store(path)
    elif is_program:
        from lcorpp.reasoning import Reasoner, read_plog

        with console.show_warnings():
            program = read_plog(path)
        if program.has_tables:
            _check_network(program)
            return
        try:
            worlds = f"{Reasoner(program).count()} possible worlds: OK"
        except TooLargeError as error:
            worlds = f"names and sorts are OK; the possible worlds are not checked: {error}"
        console.out.print(f"{path}: {len(program.attributes)} attributes, {worlds}")
    elif suffix in model_files.MODELS:
        from lcorpp.planning import read_pomdp

        pomdp = read_pomdp(path)
        console.out.print(f"{path}: {_format_size(pomdp)}, discount {pomdp.discount:g}: OK")
    elif suffix in model_files.POLICIES and model is not None:
        from lcorpp.planning.formats.model_file import read_model

        policy = model_files.read_policy(path, *read_model(model))
        console.out.print(f"{path}: {len(policy)} vectors for {model}: OK")
    elif suffix in model_files.POLICIES:
        raise FileError(f"{path}: a policy is checked against its model; give --model FILE.pomdp")
    elif not path.exists():
        raise FileError(f"{path}: No such file or directory")
    else:
        raise FileError(f"{path}: unknown kind of file; expected {KINDS}")


def _check_network(program: Program) -> None:
    """Print the size of a Bayesian network, what its marginals cost, and the variables of tables."""
    from lcorpp.reasoning.factors.network import describe_cost, make_table_network
    from lcorpp.reasoning.language.networks.bayesian_network import BayesianNetwork

    network = make_table_network(program, {})
    n_numbers = sum(len(factor.table) for factor in network.graph.factors)
    try:
        cost = f"an answer for all {describe_cost(network.find_plan((), (), (), True))}: OK"
    except TooLargeError as error:
        cost = f"names and tables are OK; answers may be sampled: {error}"
    is_own = not str(program.file).lower().endswith(".bif")  # a file of tables, with few variables
    if is_own and isinstance(program, BayesianNetwork):
        for name, table in program.tables.items():
            given = f" given {', '.join(table.parents)}" if table.parents else ""
            console.out.print(f"  {name}: {join_some(program.attributes[name].values, MAX_VALUES)}{given}")
    console.out.print(f"{program.file}: {len(program.attributes)} variables, {n_numbers} numbers; {cost}")


def _check_robot(path: Path) -> None:
    from lcorpp.robot.config import AFTER
    from lcorpp.robot.reading import read_robot_config
    from lcorpp.worlds.ros.skills import Watch

    config, domain = read_robot_config(path)
    connection = config.connection
    actions = config.behaviours.keys() - {AFTER}
    people = " ".join(config.people.tracker.topic)
    for sense, tracker in config.people.senses.items():
        people += f", for {sense} from {' '.join(tracker.topic)}"
    where = f" at {connection.url}" if connection.kind == "rosbridge" else ""
    preset = f", preset {domain.preset}" if domain.preset else ""
    console.out.print(
        f"{path}: {domain.name}{preset} by {config.strategy}; {connection.kind} for ROS {connection.version}"
        f"{where}; people from {people}; {len(actions)} actions: OK"
    )
    unknown = [name for name in domain.observed if name not in config.facts]
    if unknown:
        console.print_note(f"the robot does not observe {', '.join(unknown)}; the reasoner sums over them")
    asks = [name for name in actions if not isinstance(config.behaviours[name].skill, Watch)]
    if asks and config.answers.topic is None and not config.answers.microphone:
        console.print_note(f"the robot cannot hear: every observation is {config.answers.silence}")


def _check_tracks(path: Path) -> None:
    from lcorpp.learning import check_trainable, read_authors

    data = read_authors(path, labels={"0": "0", "1": "1"})  # as in the file: no domain names the classes
    try:
        check_trainable(data)
    except DataError as error:
        raise DataError(f"{path}: {error}") from None
    counts = ", ".join(f"{data.labels.count(label)} of class {label}" for label in sorted(set(data.labels)))
    console.out.print(f"{path}: {len(data)} tracks ({counts}) of {len(set(data.groups))} people: OK")
    for note in data.notes:
        console.out.print(f"  note: {note}")


def _check_store(path: Path) -> None:
    from lcorpp.learning.store import read_store

    store = read_store(path)
    console.out.print(f"{path}: {store.summary()}; {store.schema}{'' if store.damage else ': OK'}")
    if store.damage:
        count = f"{len(store.damage)} place{'s' * (len(store.damage) > 1)}"
        raise DataError(
            "\n  ".join([f"{path}: damaged in {count}; the other records are OK", *map(str, store.damage)])
        )


def _check_domain(folder: Path) -> None:
    from lcorpp.domains import load_domain
    from lcorpp.domains.toml import read_preset_names

    for preset in read_preset_names(folder) or (None,):
        domain = load_domain(folder, preset=preset)
        for sense in domain.senses:
            UserFunction.parse(sense.classifier or "", DomainError)  # raises if its file lacks it
        if domain.reasoning.own_reasoners is not None:
            domain.list_starts()  # it answers all or many combinations of facts and labels
            console.out.print(f"{folder}: reasoner {domain.reasoning.own_reasoners}: OK")
        name = f"{domain.name}, preset {preset}" if preset else domain.name
        console.out.print(
            f"{folder} ({name}): observes {', '.join(domain.observed) or 'nothing'};"
            f" decides {_format_shared(domain.reasoning)}; {domain.model_size}: OK"
        )
        _note_guesses(domain)


def _note_guesses(domain: Domain) -> None:
    """Name the classes whose labels are all equally probable, e.g. as the program states no rates."""
    for sense in domain.senses:
        channel = domain.simulation.noisy_channels.get(sense.name, {})
        guessed = [
            name for name, rates in channel.items() if len(rates) > 1 and len(set(rates.values())) == 1
        ]
        if guessed:
            console.print_note(
                f"{sense.name} guesses where {sense.of} is {join_some(guessed, MAX_VALUES)}: its labels are"
                f" equally probable there; {domain.simulation.true_program.file} states rates, e.g."
                f" pr({sense.attribute}={sense.label_of[guessed[0]]} | {sense.of}={guessed[0]}) = 0.8."
            )


def _inspect_domain(folder: Path) -> None:
    from lcorpp.domains.inspection import inspect_domain
    from lcorpp.domains.toml import read_preset_names

    for preset in read_preset_names(folder) or (None,):
        read = inspect_domain(folder, preset)
        name = f"{read.name}, preset {preset}" if preset else read.name
        size = "a function makes the model" if read.pomdp is None else _format_size(read.pomdp)
        code = ", ".join(str(file.relative_to(folder)) for file in read.code)
        console.out.print(
            f"{folder} ({name}): observes {', '.join(read.reasoning.observed) or 'nothing'};"
            f" decides {_format_shared(read.reasoning)}; {size}: OK{f'; not run: {code}' if code else ''}"
        )


def _format_shared(reasoning: ReasoningSection) -> str:
    """Return "item among cup, pen", or "item, person among 6 combinations"."""
    shared, values = reasoning.shared, reasoning.values
    if len(shared) == 1:
        return f"{shared[0]} among {join_some(list(map(str, values)), MAX_VALUES)}"
    return f"{', '.join(shared)} among {len(values)} combinations"


def _format_size(pomdp: Pomdp) -> str:
    return f"{len(pomdp.states)} states, {len(pomdp.actions)} actions, {len(pomdp.observations)} observations"
