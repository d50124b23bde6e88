// Arrays of the parts of a tree, for Python.
#pragma once

#include <algorithm>
#include <tuple>
#include <utility>
#include <vector>

#include "arguments.hpp"
#include "tree.hpp"

namespace lcorpp {

// The states of a group, its vectors and their actions; after them the pruned vectors that others depend on, if asked.
inline auto export_vectors(Tree& tree, std::size_t group, bool with_pruned) {
    const VectorSet& set = get_set(tree, group);
    std::vector<const PrunedVector*> pruned;
    if (with_pruned) pruned = tree.dependencies.pruned();
    pruned.erase(std::remove_if(pruned.begin(), pruned.end(),
                                [&](const PrunedVector* vector) { return as_size(vector->group) != group; }),
                 pruned.end());
    const std::size_t count = set.count() + pruned.size();
    std::vector<double> table;
    std::vector<Index> actions;
    table.reserve(count * set.states());
    for (std::size_t row = 0; row < set.count(); ++row) {
        actions.push_back(set.action(row));
        for (std::size_t s = 0; s < set.states(); ++s) table.push_back(set.at(row, s));
    }
    for (const PrunedVector* vector : pruned) {
        actions.push_back(vector->action);
        table.insert(table.end(), vector->values.begin(), vector->values.end());
    }
    return std::make_tuple(make_array(tree.group_states(static_cast<Index>(group))),
                           make_array(std::move(table), {count, set.states()}), make_array(std::move(actions)));
}

// Corners, and begins, states, weights and values of the points.
inline auto export_points(const Sawtooth& sawtooth) {
    std::vector<std::int64_t> begins{0};
    std::vector<Index> states;
    std::vector<double> weights, values;
    states.reserve(sawtooth.entry_count());  // without the memory that growing takes
    weights.reserve(sawtooth.entry_count());
    sawtooth.for_each_point([&](const auto& support, const auto& inverses, double value, Index) {
        std::vector<std::pair<Index, double>> entries;
        for (std::size_t i = 0; i < support.size(); ++i) entries.emplace_back(support[i], 1.0 / inverses[i]);
        std::sort(entries.begin(), entries.end());
        for (const auto& [state, weight] : entries) {
            states.push_back(state);
            weights.push_back(weight);
        }
        begins.push_back(static_cast<std::int64_t>(states.size()));
        values.push_back(value);
    });
    return std::make_tuple(make_array(sawtooth.corners()), make_array(std::move(begins)), make_array(std::move(states)),
                           make_array(std::move(weights)), make_array(std::move(values)));
}

// Observations, probabilities, bounds and nodes of the children.
inline auto export_children(const Branch& branch) {
    std::vector<Index> observation, node;
    std::vector<double> probability, lower, upper;
    for (const Child& child : branch.children) {
        observation.push_back(child.observation);
        node.push_back(child.node);
        probability.push_back(child.probability);
        lower.push_back(child.lower);
        upper.push_back(child.upper);
    }
    return std::make_tuple(make_array(observation), make_array(probability), make_array(lower), make_array(upper),
                           make_array(node));
}

}  // namespace lcorpp
