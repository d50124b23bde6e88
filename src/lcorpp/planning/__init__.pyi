from .belief import (
    check_belief as check_belief,
    observation_probabilities as observation_probabilities,
    update as update,
)
from .evaluation.batch_policy import BatchPolicy as BatchPolicy
from .evaluation.certificate import Certificate as Certificate, certificate as certificate
from .evaluation.policy_evaluation import Evaluation as Evaluation, evaluate as evaluate
from .evaluation.policy_graph import PolicyGraph as PolicyGraph, policy_graph as policy_graph
from .evaluation.simulation import SimulationResult as SimulationResult, simulate as simulate
from .factored.cpt import cpt as cpt
from .factored.flatten import flatten as flatten, start_beliefs as start_beliefs
from .factored.model import Factored as Factored
from .factored.table import Table as Table
from .factored.variables import Variable as Variable
from .formats.alpha_file import read_alphas as read_alphas, write_alphas as write_alphas
from .formats.policy_xml import read_policy as read_policy, write_policy as write_policy
from .formats.pomdp.reader import parse_pomdp as parse_pomdp, read_pomdp as read_pomdp
from .formats.pomdp.writer import format_pomdp as format_pomdp, write_pomdp as write_pomdp
from .formats.pomdpx.reader import (
    parse_pomdpx as parse_pomdpx,
    read_factored as read_factored,
    read_pomdpx as read_pomdpx,
)
from .formats.pomdpx.writer import format_pomdpx as format_pomdpx, write_pomdpx as write_pomdpx
from .generative_model import GenerativeModel as GenerativeModel, Interaction as Interaction
from .limits.controller import Controller as Controller
from .limits.limit import Limit as Limit, read_limit as read_limit
from .limits.randomised_policy import (
    RandomisedPlanner as RandomisedPlanner,
    RandomisedPolicy as RandomisedPolicy,
    read_randomised_policy as read_randomised_policy,
    write_randomised_policy as write_randomised_policy,
)
from .limits.solver import (
    LimitedProgress as LimitedProgress,
    LimitedSolution as LimitedSolution,
    solve_limited as solve_limited,
)
from .limits.verification import LimitsCertificate as LimitsCertificate, verify_limits as verify_limits
from .planner import Planner as Planner
from .plots.belief_figures import draw_line as draw_line, draw_triangle as draw_triangle
from .plots.bounds import draw_bounds as draw_bounds
from .plots.policy_graph import draw_graph as draw_graph
from .policy import AlphaVectors as AlphaVectors, Policy as Policy, UpperBound as UpperBound
from .pomdp import Pomdp as Pomdp
from .sarsop import solve as solve
from .solution import Progress as Progress, Solution as Solution
from .solver_table import SOLVER_NAMES as SOLVER_NAMES
from .solvers import SolverOptions as SolverOptions, load_solver as load_solver
from .solvers.finite_horizon import (
    FiniteHorizonSolution as FiniteHorizonSolution,
    solve_finite_horizon as solve_finite_horizon,
    solve_finite_horizon_exact as solve_finite_horizon_exact,
)
from .solvers.heuristic_search import OnlinePlanner as OnlinePlanner, SearchResult as SearchResult
from .solvers.pomcp import (
    GenerativePlanner as GenerativePlanner,
    ObservedSimulator as ObservedSimulator,
    ParticlePlanner as ParticlePlanner,
    PomcpPlanner as PomcpPlanner,
    SearchOptions as SearchOptions,
    Simulator as Simulator,
    TableSimulator as TableSimulator,
    Widening as Widening,
)
from .sparse import SparseTables as SparseTables
