"""Policy graphs: a policy as a finite-state controller with an action per node and observations on edges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.notebook import html_table
from lcorpp.planning.belief import check_belief
from lcorpp.planning.evaluation.belief_graph import BeliefGraph
from lcorpp.planning.evaluation.sparse_beliefs import SparseBeliefs
from lcorpp.planning.policy import Policy, check_same_model
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array, Belief, Indices

MAX_LABEL_LINES = 6
"""An arrow's label names at most this many observations and counts the others."""


@dataclass(frozen=True, eq=False)
class PolicyGraph:
    """A finite-state controller of n nodes and m edges; node 0 is the start.

    Nodes are in breadth-first order, edges ordered by source and observation.

    actions: (n,) indices. vectors: (n,) index of the policy's best vector.
    depths: (n,) number of steps on a shortest path from the start.
    complete: (n,) whether a node has all its edges; edges beyond a limit are missing.
    sources, targets: (m,) nodes. observations: (m,) indices.
    probabilities: (m,) of each observation, given the belief of its source and its action.
    beliefs: of the nodes, as first reached; `belief` returns one.
    state_names, action_names, observation_names: of the model.
    """

    actions: Indices
    vectors: Indices
    depths: Indices
    complete: npt.NDArray[np.bool_]
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

    def __repr__(self) -> str:
        cut = "" if self.complete.all() else f", {np.count_nonzero(~self.complete)} nodes incomplete"
        return f"<PolicyGraph: {len(self)} nodes, {len(self.sources)} edges, depth {self.depths.max()}{cut}>"

    def _repr_html_(self) -> str:
        """Return the nodes as a table: action, likeliest state, and the next node for each observation."""
        rows = []
        for node, action in enumerate(self.actions.tolist()):
            edges = np.flatnonzero(self.sources == node)
            following = ", ".join(
                f"{self.observation_names[self.observations[edge]]}: {self.targets[edge]}" for edge in edges
            )
            rows.append((f"{node}", self.action_names[action], self._find_likeliest_state(node), following))
        header = ("node", "action", "likeliest state", "next node")
        return html_table(header, rows, caption="Policy graph", limit=20)

    def belief(self, node: int) -> Belief:
        """Return (S,) the belief of a node, as first reached."""
        return self.beliefs.dense(node, len(self.state_names))

    def _find_likeliest_state(self, node: int) -> str:
        belief = self.belief(node)
        state = int(belief.argmax())
        return f"{self.state_names[state]} {belief[state]:.3g}"

    def layers(self) -> list[Indices]:
        """Return the nodes of each depth, ordered by their parents' mean position so that few edges cross."""
        layers: list[Indices] = []
        position = np.zeros(len(self))
        for depth in range(int(self.depths.max()) + 1):
            layer = np.flatnonzero(self.depths == depth)
            if depth:
                inner = (self.depths[self.sources] == depth - 1) & (self.depths[self.targets] == depth)
                target, above = self.targets[inner], position[self.sources[inner]]
                sums = np.bincount(target, above, minlength=len(self))
                parents = np.bincount(target, minlength=len(self))
                layer = layer[np.argsort(sums[layer] / parents[layer], kind="stable")]
            position[layer] = np.arange(len(layer)) - (len(layer) - 1) / 2
            layers.append(layer)
        return layers

    def positions(self) -> Array:
        """Return (n, 2) coordinates for drawing: x with each layer centred at 0, y minus the depth."""
        x = np.zeros(len(self))
        for layer in self.layers():
            x[layer] = np.arange(len(layer)) - (len(layer) - 1) / 2
        return np.stack([x, 0.0 - self.depths], axis=1)

    def edges_by_nodes(self) -> dict[tuple[int, int], list[int]]:
        """Return the edges from each source to each target, for drawing them as one arrow."""
        edges: dict[tuple[int, int], list[int]] = {}
        for edge, ends in enumerate(zip(self.sources.tolist(), self.targets.tolist(), strict=True)):
            edges.setdefault(ends, []).append(edge)
        return edges

    def to_dot(self) -> str:
        """Return the graph in Graphviz's language, for `dot -Tsvg`.

        A node shows its action and the likeliest state of its belief. The start has a double border, an
        incomplete node a dashed one.
        """
        lines = ["digraph policy {", "  node [shape=box, style=rounded];"]
        for node, action in enumerate(self.actions.tolist()):
            label = [self.action_names[action], self._find_likeliest_state(node)]
            extra = ", peripheries=2" if node == 0 else ""
            extra += "" if self.complete[node] else ', style="rounded,dashed"'
            lines.append(f"  n{node} [label={_quote(label)}{extra}];")
        for (source, target), edges in self.edges_by_nodes().items():
            order = sorted(edges, key=lambda edge: -self.probabilities[edge])
            label = [
                f"{self.observation_names[self.observations[edge]]} {self.probabilities[edge]:.3g}"
                for edge in order[:MAX_LABEL_LINES]
            ]
            if len(order) > MAX_LABEL_LINES:
                others = float(self.probabilities[order[MAX_LABEL_LINES:]].sum())
                label.append(f"{len(order) - MAX_LABEL_LINES} others {others:.3g}")
            lines.append(f"  n{source} -> n{target} [label={_quote(label)}];")
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
    """Convert a policy to a finite-state controller for a start belief.

    With `merge="vector"`, beliefs with the same best vector share a node, whose edges are those of the belief
    that was reached first: the graph is small, and exact if each vector belongs to one plan. With
    `merge="belief"`, only equal beliefs (of 40 binary digits) share a node: the graph is exact, but it may be
    infinite.

    Args:
        pomdp: the model. policy: for this model.
        start: (S,) the start belief; the model's own when None.
        merge: which beliefs share a node.
        max_depth: nodes at this depth have no edges; None for no limit.
        max_nodes: the maximal number of nodes; edges to further nodes are left out.
        min_probability: edges of observations below this probability are left out.

    Raises:
        ModelError: `start` is not a distribution over the states, or an argument is out of range.
        PolicyError: the policy is for another model.

    Source: the policy graphs of APPL (Kurniawati, Hsu and Lee, RSS 2008); Cassandra, Kaelbling and Littman,
    1994, section 4.

    Examples:
        >>> from lcorpp import load_domain, solve
        >>> from lcorpp.planning import policy_graph
        >>> pomdp = load_domain("intention").pomdp
        >>> graph = policy_graph(pomdp, solve(pomdp).policy)
        >>> pomdp.actions[graph.actions[0]], len(graph)
        ('move_forward', 5)
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
    nodes, depths, complete = layer.tolist(), [0], [True]
    node_of_key = {int(graph.vector_indices[layer[0]] if merge == "vector" else layer[0]): 0}
    edges: list[tuple[int, int, int, float]] = []
    depth = 0
    while len(layer) and (max_depth is None or depth < max_depth):
        depth += 1
        begin = len(nodes)
        source_of = dict(zip(layer.tolist(), range(begin - len(layer), begin), strict=True))
        for owner, observation, probability, child in zip(
            *(column.tolist() for column in graph.expand(layer)), strict=True
        ):
            source, key = source_of[owner], int(graph.vector_indices[child]) if merge == "vector" else child
            if probability < min_probability or (key not in node_of_key and len(nodes) >= max_nodes):
                complete[source] = False
                continue
            if key not in node_of_key:
                node_of_key[key] = len(nodes)
                nodes.append(child)
                depths.append(depth)
                complete.append(True)
            edges.append((source, node_of_key[key], observation, probability))
        layer = np.array(nodes[begin:], dtype=np.intp)
    complete[len(nodes) - len(layer) :] = [False] * len(layer)
    which = np.array(nodes, dtype=np.intp)
    sources, targets, observations, probabilities = zip(*edges, strict=True) if edges else ((), (), (), ())
    return PolicyGraph(
        actions=graph.actions[which].astype(np.intp),
        vectors=graph.vector_indices[which],
        depths=np.array(depths, dtype=np.intp),
        complete=np.array(complete, dtype=bool),
        sources=np.array(sources, dtype=np.intp),
        targets=np.array(targets, dtype=np.intp),
        observations=np.array(observations, dtype=np.intp),
        probabilities=np.array(probabilities, dtype=np.float64),
        beliefs=graph.beliefs.take(which),
        state_names=pomdp.states,
        action_names=pomdp.actions,
        observation_names=pomdp.observations,
    )


def _quote(lines: list[str]) -> str:
    """Return the lines of a label as a Graphviz string, with quotes and backslashes escaped."""
    printable = ("".join(c if c.isprintable() else "?" for c in line) for line in lines)
    return '"' + "\\n".join(line.replace("\\", "\\\\").replace('"', '\\"') for line in printable) + '"'
