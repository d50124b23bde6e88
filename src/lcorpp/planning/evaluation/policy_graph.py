"""A policy as a finite-state controller: what to do, and where each observation leads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.belief import check_belief
from lcorpp.planning.evaluation.belief_graph import BeliefGraph
from lcorpp.planning.evaluation.sparse_beliefs import Indices, SparseBeliefs
from lcorpp.planning.planner import check_same_model
from lcorpp.planning.policy import Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array, Belief

MOST_LINES = 6
"""Observations that an arrow of a picture names; the others are counted."""


@dataclass(frozen=True, eq=False)
class PolicyGraph:
    """n nodes, each with an action and the belief it was first met with, and m edges, one an observation.

    Node 0 is the start. Nodes are numbered by their depth and then as they were met, edges by their source
    and then by their observation.

    actions: (n,) indices. vectors: (n,) the number of the policy's best vector there.
    depths: (n,) the fewest steps that lead there from the start.
    whole: (n,) whether a node has all its edges; the others were left out, being beyond a limit.
    sources, targets: (m,) nodes. observations: (m,) indices.
    probabilities: (m,) of each observation, in the belief of its source after its action.
    beliefs: of the nodes; `belief` gives one.
    state_names, action_names, observation_names: of the model.
    """

    actions: Indices
    vectors: Indices
    depths: Indices
    whole: npt.NDArray[np.bool_]
    sources: Indices
    targets: Indices
    observations: Indices
    probabilities: Array
    beliefs: SparseBeliefs
    state_names: tuple[str, ...]
    action_names: tuple[str, ...]
    observation_names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.actions)

    def belief(self, node: int) -> Belief:
        """(S,) the belief that a node was first met with."""
        return self.beliefs.belief(node, len(self.state_names))

    def layers(self) -> list[Indices]:
        """The nodes of each depth, so ordered that few edges cross: by where their parents stand."""
        layers: list[Indices] = []
        place = np.zeros(len(self))
        for depth in range(int(self.depths.max()) + 1):
            layer = np.flatnonzero(self.depths == depth)
            if depth:
                inner = (self.depths[self.sources] == depth - 1) & (self.depths[self.targets] == depth)
                target, stand = self.targets[inner], place[self.sources[inner]]
                sums, parents = (np.bincount(target, of, minlength=len(self)) for of in (stand, None))
                layer = layer[np.argsort(sums[layer] / parents[layer], kind="stable")]
            place[layer] = np.arange(len(layer)) - (len(layer) - 1) / 2
            layers.append(layer)
        return layers

    def positions(self) -> Array:
        """(n, 2) where to draw each node: across, its layer centred at 0, and up, minus its depth."""
        places = np.stack([np.zeros(len(self)), 0.0 - self.depths], axis=1)
        for layer in self.layers():
            places[layer, 0] = np.arange(len(layer)) - (len(layer) - 1) / 2
        return places

    def arrows(self) -> dict[tuple[int, int], list[int]]:
        """The edges (their numbers) between each two nodes, for drawing them as one."""
        found: dict[tuple[int, int], list[int]] = {}
        for edge, ends in enumerate(zip(self.sources.tolist(), self.targets.tolist(), strict=True)):
            found.setdefault(ends, []).append(edge)
        return found

    def dot(self) -> str:
        """The graph in the language of Graphviz: `dot -Tsvg` draws it.

        A node shows its action and the most likely state of its belief; the start has a double line, and a
        node whose edges are not all there a dashed one.
        """
        lines = ["digraph policy {", "  node [shape=box, style=rounded];"]
        for node, action in enumerate(self.actions.tolist()):
            belief = self.belief(node)
            state = int(belief.argmax())
            label = [self.action_names[action], f"{self.state_names[state]} {belief[state]:.3g}"]
            extra = ", peripheries=2" if node == 0 else ""
            extra += "" if self.whole[node] else ', style="rounded,dashed"'
            lines.append(f"  n{node} [label={_quoted(label)}{extra}];")
        for (source, target), edges in self.arrows().items():
            order = sorted(edges, key=lambda edge: -self.probabilities[edge])
            label = [
                f"{self.observation_names[self.observations[edge]]} {self.probabilities[edge]:.3g}"
                for edge in order[:MOST_LINES]
            ]
            if len(order) > MOST_LINES:
                others = float(self.probabilities[order[MOST_LINES:]].sum())
                label.append(f"{len(order) - MOST_LINES} others {others:.3g}")
            lines.append(f"  n{source} -> n{target} [label={_quoted(label)}];")
        return "\n".join([*lines, "}"]) + "\n"


def policy_graph(
    pomdp: Pomdp,
    policy: Policy,
    start: npt.ArrayLike | None = None,
    *,
    merge: Literal["vector", "belief"] = "vector",
    max_depth: int | None = None,
    max_nodes: int = 1_000,
    min_probability: float = 0.0,
) -> PolicyGraph:
    """The controller that a policy is, from a start belief on.

    Merged by vector, beliefs with the same best vector are one node, which goes on as the belief does that
    was met first: small, and exact where each vector stands for one plan. Merged by belief, only equal
    beliefs are one (up to the 40 binary digits they are kept with): the policy itself, but the graph may have
    no end.

    Args:
        pomdp: the world. policy: made for it.
        start: (S,) where the policy begins; the model's own when None.
        merge: what makes two beliefs one node.
        max_depth: nodes this many steps from the start have no edges; None for no limit.
        max_nodes: no nodes are added beyond so many; edges to them are left out.
        min_probability: edges of observations less likely than this are left out.

    Raises:
        ModelError: `start` is not a distribution over the states, or an argument is out of range.
        PolicyError: the policy is for another model.

    Source: the policy graphs of APPL (Kurniawati, Hsu and Lee, RSS 2008); Cassandra, Kaelbling and Littman,
    1994, section 4.
    """
    check_same_model(pomdp, policy)
    if merge not in ("vector", "belief"):
        raise ModelError(f"nodes are merged by 'vector' or by 'belief', not by {merge!r}")
    if max_nodes < 1 or (max_depth is not None and max_depth < 0) or not 0 <= min_probability <= 1:
        raise ModelError(
            f"max_nodes {max_nodes} is from 1, max_depth {max_depth} from 0 and min_probability"
            f" {min_probability} between 0 and 1"
        )
    belief = check_belief(pomdp, pomdp.start if start is None else start)
    graph = BeliefGraph(pomdp, policy)
    layer = graph.add(SparseBeliefs.of(belief[None]))
    nodes, depths, whole = layer.tolist(), [0], [True]
    numbers = {_key(graph, int(layer[0]), merge): 0}
    edges: list[tuple[int, int, int, float]] = []
    depth = 0
    while len(layer) and (max_depth is None or depth < max_depth):
        depth += 1
        begin = len(nodes)
        source_of = dict(zip(layer.tolist(), range(begin - len(layer), begin), strict=True))
        for owner, observation, probability, child in zip(
            *(kind.tolist() for kind in graph.expand(layer)), strict=True
        ):
            source, key = source_of[owner], _key(graph, child, merge)
            if probability < min_probability or (key not in numbers and len(nodes) >= max_nodes):
                whole[source] = False
                continue
            if key not in numbers:
                numbers[key] = len(nodes)
                nodes.append(child)
                depths.append(depth)
                whole.append(True)
            edges.append((source, numbers[key], observation, probability))
        layer = np.array(nodes[begin:], dtype=np.intp)
    whole[len(nodes) - len(layer) :] = [False] * len(layer)
    return _made(graph, nodes, depths, whole, edges)


def _key(graph: BeliefGraph, node: int, merge: str) -> int:
    return int(graph.vectors[node]) if merge == "vector" else node


def _made(
    graph: BeliefGraph,
    nodes: list[int],
    depths: list[int],
    whole: list[bool],
    edges: list[tuple[int, int, int, float]],
) -> PolicyGraph:
    which, pomdp = np.array(nodes, dtype=np.intp), graph.pomdp
    sources, targets, observations, probabilities = zip(*edges, strict=True) if edges else ((), (), (), ())
    return PolicyGraph(
        actions=graph.actions[which].astype(np.intp),
        vectors=graph.vectors[which],
        depths=np.array(depths, dtype=np.intp),
        whole=np.array(whole, dtype=bool),
        sources=np.array(sources, dtype=np.intp),
        targets=np.array(targets, dtype=np.intp),
        observations=np.array(observations, dtype=np.intp),
        probabilities=np.array(probabilities, dtype=np.float64),
        beliefs=graph.beliefs.take(which),
        state_names=pomdp.states,
        action_names=pomdp.actions,
        observation_names=pomdp.observations,
    )


def _quoted(lines: list[str]) -> str:
    """Lines of a label, as a string of Graphviz: quotes and backslashes stand for themselves."""
    shown = ("".join(c if c.isprintable() else "?" for c in line) for line in lines)
    return '"' + "\\n".join(line.replace("\\", "\\\\").replace('"', '\\"') for line in shown) + '"'
