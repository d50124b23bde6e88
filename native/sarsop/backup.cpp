// BACKUP: improve both bounds at one belief by one step of look-ahead.
// Source: Kurniawati, Hsu and Lee, RSS 2008, algorithm 3.

#include <algorithm>
#include <utility>

#include "tree.hpp"

namespace lcorpp {

void Tree::backup(Index number) {
    refresh(number);
    Node& node = nodes[as_size(number)];
    Index action = find_best_lower_action(node);
    for (int attempt = 0; attempt < 2; ++attempt) {
        Branch& branch = node.branches[as_size(action)];
        const bool pruned = std::any_of(branch.children.begin(), branch.children.end(), [&](const Child& child) {
            return sets[as_size(child.group)].find(child.best_vector) < 0;
        });
        if (!pruned) break;
        for (Branch& other : node.branches) {  // a remembered vector was pruned: forget all lower bounds
            for (Child& child : other.children) child.lower = -kInfinity;
            other.lower = -kInfinity;
            other.vectors_version = 0;
        }
        refresh(number);
        action = find_best_lower_action(node);
    }
    update_best_vector(node);
    if (node.branches[as_size(action)].lower > node.lower_value + kMinGain * max_abs_value) {
        std::vector<Edge> edges;
        const std::vector<double> vector = make_vector(node, action, edges);
        // The value of the vector here, not the look-ahead value: their rounding errors differ.
        const std::vector<Index> positions = find_positions(node);
        double value = 0.0;
        for (std::size_t i = 0; i < positions.size(); ++i) value += node.belief.weight[i] * vector[as_size(positions[i])];
        if (value > node.lower_value) {
            node.best_vector = next_vector_;
            node.lower_value = value;
            dependencies.record(next_vector_, std::move(edges));
            sets[as_size(node.group)].add(vector, action, next_vector_++);
        }
    }
    node.lower = node.lower_value;
    upper_bound(number);
    if (node.upper < node.sawtooth_value - kMinGain * max_abs_value) {
        const Stamp replaced = node.point_stamp;
        node.point_stamp = sawtooth.add(node.belief, node.group, node.upper);
        if (replaced >= 0) sawtooth.remove(replaced);
    }
}

// R(a) + gamma sum over o of T Z (the best vector at the child of a and o), over the states of the node's group. For an
// observation that is impossible at this belief any vector is valid; the best vector after the action alone is used,
// because it serves the neighbouring beliefs.
std::vector<double> Tree::make_vector(Node& node, Index action, std::vector<Edge>& edges) {
    std::vector<Index> row(as_size(model.observations), -1);
    for (const Child& child : node.branches[as_size(action)].children) {
        edges.push_back({child.observation, child.group, child.best_vector});
        row[as_size(child.observation)] = sets[as_size(child.group)].find(child.best_vector);
    }
    std::vector<Index> default_rows(model.members.size(), -1);
    const auto default_row = [&](Index block) {
        Index& result = default_rows[as_size(block)];
        if (result >= 0) return result;
        Weights part;
        const Weights& predicted = successors_.predict(node.belief, action);
        for (std::size_t i = 0; i < predicted.size(); ++i) {
            if (model.block[as_size(predicted.state[i])] != block) continue;
            part.state.push_back(predicted.state[i]);
            part.weight.push_back(predicted.weight[i]);
        }
        const VectorSet& set = sets[as_size(block)];
        return result = part.size() ? find_best_vector(block, part.state.data(), part.weight.data(), part.size(), 0).row : set.central();
    };
    return combine(node.group, action, [&](Index observation, Index next) {
        const Index block = model.block[as_size(next)];
        const VectorSet& set = sets[as_size(block)];
        Index& chosen = row[as_size(observation)];
        if (chosen < 0) {
            chosen = default_row(block);
            edges.push_back({observation, block, set.stamp(as_size(chosen))});
        }
        return set.at(as_size(chosen), as_size(model.local[as_size(next)]));
    });
}

}  // namespace lcorpp
