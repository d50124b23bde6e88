"""
C++ kernels of the planner: the initial bounds, and the belief tree in which SARSOP, Perseus and the online planner search. `make stubs` writes the stub.
"""

from collections.abc import Sequence
from typing import Annotated

import numpy
from numpy.typing import NDArray


class Model:
    """
    The problem in the form of the kernels; `build_model` makes it from a Pomdp.

    Blocks partition the states: after every action and observation the belief lies within one. A group is a block,
    or the last one, of all states, for beliefs over several blocks.
    """

    def __init__(self, n_actions: int, n_states: int, n_observations: int, transition_begins: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], transition_columns: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], transition_values: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], observation_begins: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], observation_columns: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], observation_values: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], reward: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], discount: float) -> None:
        """
        Copy sparse tables (A, S, S) of transitions and (A, S, O) of observations, and rewards (A, S).

        The entries of row a S + s are those from begins[a S + s] to before begins[a S + s + 1]: each has a column, the next
        state or the observation, and a value, its probability.

        Raises:
            ValueError: shapes or indices do not fit together, a row is not a distribution, or a number is not finite.
        """

    def export_blocks(self) -> NDArray[numpy.int32]:
        """Return (S,) the block of each state."""

def find_reachable_blocks(model: Model, begins: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], states: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> NDArray[numpy.int32]:
    """
    Return (S,) the block of each state that the starts reach, -1 for others.

    It is the finest partition such that every action and observation lead from a belief within a block, or within
    the support of a start, to one within a block. Start k has the states from begins[k] to before begins[k + 1];
    those over several blocks count as one, because they share their vectors.

    Source: Hopcroft and Karp, "A linear algorithm for testing equivalence of finite automata", 1971.
    """

def blind_policies(model: Model, tolerance: float, seconds: float) -> NDArray[numpy.float64]:
    """
    Return (A, S) lower bounds on the value of repeating one action forever.

    The function iterates until the result is within the tolerance, in reward units, or wall-clock seconds are over.
    Every sweep yields a valid bound.

    Raises:
        ValueError: a limit is NaN, or the tolerance negative.

    Source: Hauskrecht, JAIR 2000.
    """

def mdp_bound(model: Model, tolerance: float, seconds: float) -> NDArray[numpy.float64]:
    """
    Return (A, S) upper bounds on the Q values if the state were observed; limits as of `blind_policies`.
    """

def fast_informed_bound(model: Model, Q: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], tolerance: float, seconds: float) -> NDArray[numpy.float64]:
    """
    Return (A, S) the fast informed bound, iterated downwards from Q values (A, S) that are upper bounds.

    Q(a, s) <- R(a, s) + gamma sum over o of max over a' of sum over s' of P(s', o | s, a) Q(a', s'). Limits as of
    `blind_policies`.

    Source: Hauskrecht, JAIR 2000.
    """

def find_symmetries(model: Model, max_refinements: int, seconds: float) -> list[list[int]]:
    """
    Return, for each symmetry that was found, the state whose weight each state takes (S).

    Source: McKay, "Practical graph isomorphism", 1981.
    """

def power_potentials(model: Model, mdp: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], begins: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], states: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], weights: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], seconds: float) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.float64]]:
    """
    Return offsets (K, S), scales (K,) and powers (K,) of the potentials that are the lowest at some beliefs.

    Potential k is offsets[k].b + scales[k] N(b) with the norm N(b) = (sum of b(s)^powers[k])^(1 / powers[k]).

    Args:
        mdp: (A, S) upper bounds on the Q values if the state were observed.
        begins, states, weights: the beliefs, each within a block, in the form of `Tree.points`.
        seconds: wall-clock time limit.

    Source: Gallager, Information Theory and Reliable Communication, 1968, section 5.6, for the condition.
    """

def maximise_gain(linear: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], entropy: float, gamma: float, likelihood: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], pairs: Annotated[NDArray[numpy.int32], dict(shape=(None, None), order='C', device='cpu', writable=False)], pair_weights: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], tolerance: float, start: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> tuple[NDArray[numpy.float64], float, float]:
    """
    Return a belief (n,) at which the gain of an action is nearly the largest, its value, and an upper bound of all gains.

    The gain is linear.b + entropy (H(b) - gamma E[H(b')]) + sum over pairs of weight sqrt(b(s) b(t)); it is concave.

    Args:
        linear: (n,). likelihood: (n, m) P(o | s) of the observations; with m = 0 there is no E[H(b')].
        pairs: (n_pairs, 2) states s and t. pair_weights: (n_pairs,).
        tolerance: the ascent ends when the value is this close to its upper bound. start: (n,) where it begins.
    """

class ValuePredictor:
    """
    Predicts the value of a node for selective deep sampling.

    The prediction is the mean lower bound of similar beliefs, those with the same bins of initial upper bound and
    entropy; the upper bound of the node where there are none.

    Source: Kurniawati, Hsu and Lee, RSS 2008, section III-B.
    """

    def __init__(self, corners: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None:
        """Take (S,) the initial upper bound at the beliefs that know the state."""

    def learn(self, tree: Tree, node: int) -> None:
        """Add the lower bound of a visited node."""

    def predict(self, tree: Tree, node: int) -> float:
        """Predict the value of a node."""

class Tree:
    """
    Beliefs, numbered in order of creation, and the two bounds that they share.

    One thread at a time: methods that search release the interpreter lock, and other threads must not use the same
    tree meanwhile.

    Raises:
        IndexError: a node, action, child or group does not exist.
        ValueError, TypeError: an array has a wrong shape or type, or a number is invalid.

    Source: Kurniawati, Hsu and Lee, RSS 2008, sections III and IV.
    """

    def __init__(self, model: Model, informed: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], blind: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> None:
        """
        Make a tree without nodes, with (A, S) upper bounds on the Q values and (A, S) values of the blind policies.
        """

    def add_potential(self, offset: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], scale: float, power: float, entropy: float, pairs: Annotated[NDArray[numpy.int32], dict(shape=(None, None), order='C', device='cpu', writable=False)], pair_weights: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], state: int) -> None:
        """
        Add the upper bound offset.b + scale N(b) - entropy H(b) - sum of weight sqrt(b(s) b(t)).

        Args:
            offset: (S,). scale, power: of the norm N(b) = (sum of b(s)^power)^(1 / power). entropy: of the entropy in nats.
            pairs: (n, 2) states s and t. pair_weights: (n,).
            state: the bound holds at beliefs within the block of this state; -1: within any block.
        """

    def add_graph(self, symmetries: Sequence[Sequence[int]]) -> None:
        """
        Make the graph of beliefs, in which those that a symmetry of the model renames are one.
        """

    def search_graph(self, root: int, share: float, min_target: float, max_work: int, seconds: float) -> int:
        """
        Lower the upper bound at a root by trials in the graph of beliefs; return the number of beliefs expanded.

        Args:
            share, min_target: a trial aims at this share of the gap at the root, or at the smallest target.
            max_work: largest work of the trials, about, in the unit of `work`.
            seconds: of wall-clock time, after which they end early.
        """

    @property
    def graph_memory(self) -> int:
        """Memory of the graph of beliefs in bytes."""

    @property
    def work(self) -> int:
        """The numbers of vectors, points and beliefs that have been read so far."""

    @property
    def discount(self) -> float:
        """gamma."""

    @property
    def node_count(self) -> int:
        """The number of beliefs."""

    @property
    def vector_count(self) -> int:
        """The number of alpha vectors in all groups."""

    @property
    def made_count(self) -> int:
        """
        The number of alpha vectors that were ever made, by backups or otherwise.
        """

    @property
    def node_memory(self) -> int:
        """Memory of the beliefs and of what is stored about them, in bytes."""

    @property
    def bound_memory(self) -> int:
        """Memory of the alpha vectors and points, in bytes."""

    def clear_nodes(self) -> None:
        """
        Remove all nodes, also those of the graph, but keep the vectors and points.
        """

    def drop_older_points(self) -> None:
        """
        Remove the older half of the points: those that no backup has lowered for the longest time.
        """

    @property
    def point_count(self) -> int:
        """The number of points of the upper bound."""

    @property
    def group_count(self) -> int:
        """The number of groups."""

    def find_or_add_node(self, belief: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> int:
        """Return the node of a belief (S,), created if necessary."""

    def find_or_add_child(self, node: int, action: int, child: int) -> int:
        """
        Return the node of a child, given by its index in `children`, created if necessary.
        """

    def refresh(self, node: int) -> None:
        """
        Update the bounds of a node with the vectors and points since its last visit.
        """

    def select_action(self, node: int, use_lower_bound: bool) -> int:
        """
        Return the best action by the upper or lower bound, after an update of that action's bounds.
        """

    def backup(self, node: int) -> None:
        """
        Add the best alpha vector at a node and lower the upper bound there.

        Source: Kurniawati, Hsu and Lee, RSS 2008, algorithm 3 (BACKUP).
        """

    def sample(self, predictor: ValuePredictor, root: int, target: float, max_depth: int, seconds: float, use_lower_bound: bool) -> int:
        """
        Sample a path from a root towards the beliefs whose bounds matter most there, and back up its nodes.

        The path continues while a node's gap may matter at the root (gap termination), or while the predicted value
        shows that the lower bound may still rise there (selective deep sampling). The backups begin at its end.

        Args:
            predictor: predicts the value of a node; it learns from the path.
            target: gap wanted at the root, in reward units; a node t steps down may keep target / gamma^t.
            max_depth: largest number of nodes on the path.
            seconds: of wall-clock time, after which the method ends early.
            use_lower_bound: follow the best action of the lower bound instead of the upper bound.

        Returns:
            The number of nodes on the path.

        Source: Kurniawati, Hsu and Lee, RSS 2008, algorithm 2 (SAMPLE, SAMPLEPOINTS).
        """

    def prune(self, roots: Sequence[int], radius: float, max_ratio: float, growth: float) -> None:
        """
        Keep the vectors that are best, or nearly best, at a belief that the roots may reach.

        Args:
            radius: of delta-dominance, in the space of beliefs.
            max_ratio: at most this many times the vectors that are best at a belief are kept.
            growth: a group is pruned if it has this many times the vectors after its last pruning, and 100 more.

        Source: Kurniawati, Hsu and Lee, RSS 2008, section III-D.
        """

    def compress(self, roots: Sequence[int], max_evaluations: float, seconds: float) -> bool:
        """
        Replace the vectors by those of a smaller controller if the bounds at the roots stay as good.

        The pruned vectors that others depend on are mostly older versions of plans. Where a vector of the set is no worse
        for the states in which the plans of the roots reach such a version, it replaces it. Plans may then lead back to
        themselves, so all values are computed anew.

        Args:
            max_evaluations: about as many vectors are computed at most; nothing is replaced if the values are not
                accurate then.
            seconds: wall-clock time limit; afterwards nothing is replaced.

        Returns:
            Whether the vectors were replaced.

        Sources: Hansen, "Solving POMDPs by searching in policy space", UAI 1998; Grzes, Poupart, Yang and Hoey, "Energy
        efficient execution of POMDP policies", IEEE Transactions on Cybernetics 2015.
        """

    def lower_bound(self, node: int) -> float:
        """
        Return the value of the best alpha vector at a node, of all current vectors.
        """

    def upper_bound(self, node: int) -> float:
        """
        Return the upper bound at a node by all current points, or the node's own if that is smaller.
        """

    def cached_lower(self, node: int) -> float:
        """Return the lower bound of a node at its last update."""

    def cached_upper(self, node: int) -> float:
        """Return the upper bound of a node at its last update."""

    def q_lower(self, node: int) -> NDArray[numpy.float64]:
        """
        Return (A,) lower bounds on the values of the actions, at their last update.
        """

    def q_upper(self, node: int) -> NDArray[numpy.float64]:
        """
        Return (A,) upper bounds on the values of the actions, at their last update.
        """

    def expected_rewards(self, node: int) -> NDArray[numpy.float64]:
        """Return (A,) expected rewards of the actions."""

    def belief(self, node: int) -> NDArray[numpy.float64]:
        """Return (S,) the belief of a node."""

    def children(self, node: int, action: int) -> tuple[NDArray[numpy.int32], NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.int32]]:
        """
        Return five arrays (n,): each child's observation, probability, bounds times probability, and node.

        The node is -1 before the first visit. There are no children before the first update of the action.
        """

    def vectors(self, group: int, with_pruned: bool = False) -> tuple[NDArray[numpy.int32], NDArray[numpy.float64], NDArray[numpy.int32]]:
        """
        Return the states (n,) of a group, its alpha vectors (K, n) and their plans' first actions (K,).

        Args:
            with_pruned: whether the pruned vectors that others depend on follow.
        """

    def points(self) -> tuple[NDArray[numpy.float64], NDArray[numpy.int64], NDArray[numpy.int32], NDArray[numpy.float64], NDArray[numpy.float64]]:
        """
        Return the upper bound: corners (S,), and begins, states, weights and values of K points.

        begins: (K + 1,). states, weights: (entries,). values: (K,). Point k is a belief with the states and weights from
        begins[k] to before begins[k + 1], and an upper bound on the value at that belief.
        """

    def add_vectors(self, group: int, vectors: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], actions: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None:
        """
        Import alpha vectors (K, n) over the states of a group, and the first actions (K,) of their plans.
        """

    def add_points(self, begins: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], states: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], weights: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], values: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None:
        """Import points in the form of `points`."""
