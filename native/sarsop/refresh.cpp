// What a node knows, brought up to date with the vectors and points that were added since its last visit.

#include <algorithm>

#include "tree.hpp"

namespace lcorpp {

void Tree::refresh_lower(Node& node, Index action) {
    Branch& branch = node.branches[static_cast<std::size_t>(action)];
    if (branch.open && branch.seen_vectors == next_vector_) return;
    const Outcomes& found = outcomes(node, action);
    double sum = 0.0;
    for (std::size_t c = 0; c < branch.children.size(); ++c) {
        Child& child = branch.children[c];
        const VectorSet& set = sets[static_cast<std::size_t>(child.group)];
        const std::size_t first = set.first_since(branch.seen_vectors);
        const Best newer = best(child.group, found.states(c), found.weights(c), found.size(c), first);
        if (newer.row >= 0 && newer.value > child.lower) {
            child.lower = newer.value;
            child.best = set.stamp(static_cast<std::size_t>(newer.row));
        }
        sum += child.lower;
    }
    branch.lower = branch.immediate + model.discount * sum;
    branch.seen_vectors = next_vector_;
}

void Tree::refresh_upper(Node& node, Index action) {
    Branch& branch = node.branches[static_cast<std::size_t>(action)];
    if (branch.refreshed && branch.seen_points == sawtooth.next_stamp()) return;
    const Outcomes& found = outcomes(node, action);
    double sum = 0.0;
    for (std::size_t c = 0; c < branch.children.size(); ++c) {
        Child& child = branch.children[c];
        const double bound =
            sawtooth.bound(found.states(c), found.weights(c), found.size(c), child.group, branch.seen_points);
        child.upper = std::min(child.upper, bound);
        if (child.link >= 0) {
            const double above = nodes[static_cast<std::size_t>(child.link)].high + child.apart;
            child.upper = std::min(child.upper, child.probability * above);
        }
        sum += child.upper;
    }
    branch.upper = std::min(branch.upper, branch.immediate + model.discount * sum);
    branch.seen_points = sawtooth.next_stamp();
    branch.refreshed = true;
}

void Tree::refresh_upper(Index number, Index action) {
    refresh_upper(nodes[static_cast<std::size_t>(number)], action);
}

Index Tree::best_lower_action(Index number) const {
    const auto& branches = nodes[static_cast<std::size_t>(number)].branches;
    Index best = 0;
    for (Index a = 1; a < model.actions; ++a) {
        if (branches[static_cast<std::size_t>(a)].lower > branches[static_cast<std::size_t>(best)].lower) best = a;
    }
    return best;
}

Index Tree::best_upper_action(Index number) const {
    const auto& branches = nodes[static_cast<std::size_t>(number)].branches;
    Index best = 0;
    for (Index a = 1; a < model.actions; ++a) {
        if (branches[static_cast<std::size_t>(a)].upper > branches[static_cast<std::size_t>(best)].upper) best = a;
    }
    return best;
}

void Tree::refresh(Index number) {
    Node& node = nodes[static_cast<std::size_t>(number)];
    // Only the action that looks best from above need be up to date: the others' old bounds are bounds still.
    std::vector<char> fresh(static_cast<std::size_t>(model.actions), 0);
    Index action = best_upper_action(number);
    while (!fresh[static_cast<std::size_t>(action)]) {
        refresh_upper(node, action);
        fresh[static_cast<std::size_t>(action)] = 1;
        action = best_upper_action(number);
    }
    node.high = std::min(node.high, node.branches[static_cast<std::size_t>(action)].upper);
    // From below, an action that cannot be better than the best is passed over.
    double low = node.branches[static_cast<std::size_t>(best_lower_action(number))].lower;
    refresh_lower(node, action);
    low = std::max(low, node.branches[static_cast<std::size_t>(action)].lower);
    for (Index a = 0; a < model.actions; ++a) {
        Branch& branch = node.branches[static_cast<std::size_t>(a)];
        if (a == action || branch.upper <= low) continue;
        refresh_lower(node, a);
        low = std::max(low, branch.lower);
    }
    witness(node);
    node.low = std::max({node.low, low, node.held});
}

Index Tree::look(Index number, bool below) {
    Node& node = nodes[static_cast<std::size_t>(number)];
    std::vector<char> fresh(static_cast<std::size_t>(model.actions), 0);
    Index action = best_upper_action(number);
    while (!fresh[static_cast<std::size_t>(action)]) {
        refresh_upper(node, action);
        fresh[static_cast<std::size_t>(action)] = 1;
        action = best_upper_action(number);
    }
    node.high = std::min(node.high, node.branches[static_cast<std::size_t>(action)].upper);
    witness(node);
    if (below) {
        action = best_lower_action(number);
        if (node.branches[static_cast<std::size_t>(action)].lower < node.held) {
            const VectorSet& set = sets[static_cast<std::size_t>(node.group)];
            action = set.action(static_cast<std::size_t>(set.row(node.witness)));
        }
        if (!fresh[static_cast<std::size_t>(action)]) refresh_upper(node, action);
    }
    refresh_lower(node, action);
    node.low = std::max({node.low, node.branches[static_cast<std::size_t>(action)].lower, node.held});
    return action;
}

// The vector that is best at a node, and its value.
void Tree::witness(Node& node) {
    const VectorSet& set = sets[static_cast<std::size_t>(node.group)];
    if (node.witness >= 0 && set.row(node.witness) < 0) {  // it was pruned
        node.seen_vectors = 0;
        node.held = -kInfinity;
    }
    const Best found = best(node.group, node.belief.state.data(), node.belief.weight.data(), node.belief.size(),
                            set.first_since(node.seen_vectors));
    if (found.row >= 0 && found.value > node.held) {
        node.held = found.value;
        node.witness = set.stamp(static_cast<std::size_t>(found.row));
    }
    node.seen_vectors = next_vector_;
}

double Tree::lower_at(Index number) {
    Node& node = nodes[static_cast<std::size_t>(number)];
    witness(node);
    return node.held;
}

double Tree::upper_at(Index number) {
    Node& node = nodes[static_cast<std::size_t>(number)];
    const double newer = sawtooth.bound(node.belief.state.data(), node.belief.weight.data(), node.belief.size(),
                                        node.group, node.seen_surface);
    node.surface = std::min(node.surface, newer);
    node.seen_surface = sawtooth.next_stamp();
    return std::min(node.surface, node.high);
}

}  // namespace lcorpp
