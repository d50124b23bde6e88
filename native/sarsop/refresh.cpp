// Updates of a node's bounds with the vectors and points that were added since its last visit.

#include <algorithm>

#include "graph/belief_graph.hpp"
#include "tree.hpp"

namespace lcorpp {

void Tree::refresh_lower(Node& node, Index action) {
    Branch& branch = node.branches[as_size(action)];
    if (branch.expanded && branch.vectors_version == next_vector_) return;
    const Outcomes& outcomes = expand(node, action);
    double sum = 0.0;
    for (std::size_t c = 0; c < branch.children.size(); ++c) {
        Child& child = branch.children[c];
        const VectorSet& set = sets[as_size(child.group)];
        const std::size_t first = set.first_since(branch.vectors_version);
        const Best newer = find_best_vector(child.group, outcomes.states(c), outcomes.weights(c), outcomes.size(c), first);
        if (newer.row >= 0 && newer.value > child.lower) {
            child.lower = newer.value;
            child.best_vector = set.stamp(as_size(newer.row));
        }
        sum += child.lower;
    }
    branch.lower = branch.expected_reward + model.discount * sum;
    branch.vectors_version = next_vector_;
}

void Tree::refresh_upper(Node& node, Index action) {
    Branch& branch = node.branches[as_size(action)];
    if (branch.refreshed && branch.points_version == sawtooth.next_stamp() && !graph) return;
    const Outcomes& outcomes = expand(node, action);
    double sum = 0.0;
    for (std::size_t c = 0; c < branch.children.size(); ++c) {
        Child& child = branch.children[c];
        const double bound =
            sawtooth.bound(outcomes.states(c), outcomes.weights(c), outcomes.size(c), child.group, branch.points_version);
        child.upper = std::min(child.upper, bound);
        if (child.node >= 0) {
            const double node_bound = nodes[as_size(child.node)].upper + static_cast<double>(child.lipschitz_slack);
            child.upper = std::min(child.upper, child.probability * node_bound);
        }
        if (graph) {
            if (child.graph_node < 0) {
                Weights next;
                next.state.assign(outcomes.states(c), outcomes.states(c) + outcomes.size(c));
                next.weight.assign(outcomes.weights(c), outcomes.weights(c) + outcomes.size(c));
                for (double& weight : next.weight) weight /= child.probability;
                child.graph_node = graph->find(std::move(next), child.graph_slack);
            }
            if (child.graph_node >= 0) {
                child.upper = std::min(child.upper, child.probability * (graph->upper(child.graph_node) + static_cast<double>(child.graph_slack)));
            }
        }
        sum += child.upper;
    }
    branch.upper = std::min(branch.upper, branch.expected_reward + model.discount * sum);
    branch.points_version = sawtooth.next_stamp();
    branch.refreshed = true;
}

Index Tree::find_best_lower_action(const Node& node) {
    std::size_t best = 0;
    for (std::size_t a = 1; a < node.branches.size(); ++a) {
        if (node.branches[a].lower > node.branches[best].lower) best = a;
    }
    return static_cast<Index>(best);
}

Index Tree::find_best_upper_action(const Node& node) {
    std::size_t best = 0;
    for (std::size_t a = 1; a < node.branches.size(); ++a) {
        if (node.branches[a].upper > node.branches[best].upper) best = a;
    }
    return static_cast<Index>(best);
}

// Update upper bounds until the best action by the upper bound is up to date; the others' older bounds stay valid.
// Returns for each action whether its upper bound was updated.
std::vector<char> Tree::refresh_best_upper(Node& node) {
    std::vector<char> updated(as_size(model.actions), 0);
    Index action = find_best_upper_action(node);
    while (!updated[as_size(action)]) {
        refresh_upper(node, action);
        updated[as_size(action)] = 1;
        action = find_best_upper_action(node);
    }
    node.upper = std::min(node.upper, node.branches[as_size(action)].upper);
    return updated;
}

void Tree::refresh(Index number) {
    Node& node = nodes[as_size(number)];
    refresh_best_upper(node);
    const Index action = find_best_upper_action(node);
    // The lower bounds of actions that cannot be the best are not updated.
    double lower = node.branches[as_size(find_best_lower_action(node))].lower;
    refresh_lower(node, action);
    lower = std::max(lower, node.branches[as_size(action)].lower);
    for (Index a = 0; a < model.actions; ++a) {
        Branch& branch = node.branches[as_size(a)];
        if (a == action || branch.upper <= lower) continue;
        refresh_lower(node, a);
        lower = std::max(lower, branch.lower);
    }
    update_best_vector(node);
    node.lower = std::max({node.lower, lower, node.lower_value});
}

Index Tree::select_action(Index number, bool use_lower_bound) {
    Node& node = nodes[as_size(number)];
    const std::vector<char> updated = refresh_best_upper(node);
    Index action = find_best_upper_action(node);
    update_best_vector(node);
    if (use_lower_bound) {
        action = find_best_lower_action(node);
        if (node.branches[as_size(action)].lower < node.lower_value) {
            const VectorSet& set = sets[as_size(node.group)];
            action = set.action(as_size(set.find(node.best_vector)));
        }
        if (!updated[as_size(action)]) refresh_upper(node, action);
    }
    refresh_lower(node, action);
    node.lower = std::max({node.lower, node.branches[as_size(action)].lower, node.lower_value});
    return action;
}

void Tree::update_best_vector(Node& node) {
    const VectorSet& set = sets[as_size(node.group)];
    if (node.best_vector >= 0 && set.find(node.best_vector) < 0) {  // it was pruned
        node.vectors_version = 0;
        node.lower_value = -kInfinity;
    }
    const Best newer = find_best_vector(node.group, node.belief.state.data(), node.belief.weight.data(),
                                        node.belief.size(), set.first_since(node.vectors_version));
    if (newer.row >= 0 && newer.value > node.lower_value) {
        node.lower_value = newer.value;
        node.best_vector = set.stamp(as_size(newer.row));
    }
    node.vectors_version = next_vector_;
}

double Tree::lower_bound(Index number) {
    Node& node = nodes[as_size(number)];
    update_best_vector(node);
    return node.lower_value;
}

double Tree::upper_bound(Index number) {
    Node& node = nodes[as_size(number)];
    const double newer = sawtooth.bound(node.belief.state.data(), node.belief.weight.data(), node.belief.size(),
                                        node.group, node.sawtooth_version);
    node.sawtooth_value = std::min(node.sawtooth_value, newer);
    node.sawtooth_version = sawtooth.next_stamp();
    if (graph) {
        if (node.graph_node < 0) node.graph_node = graph->find(node.belief, node.graph_slack);
        if (node.graph_node >= 0) node.upper = std::min(node.upper, graph->upper(node.graph_node) + static_cast<double>(node.graph_slack));
    }
    return std::min(node.sawtooth_value, node.upper);
}

}  // namespace lcorpp
