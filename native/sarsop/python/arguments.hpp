// Conversion between numpy arrays and the kernels' types. Wrong shapes, indices and numbers raise ValueError or
// IndexError, so the kernels never read beyond an array.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "model.hpp"
#include "tree.hpp"

namespace lcorpp {

template <typename T, int N>
using InputArray = nb::ndarray<const T, nb::ndim<N>, nb::c_contig, nb::device::cpu>;
template <typename A>
auto copy(const A& array) {
    using T = std::remove_const_t<typename A::Scalar>;
    return std::vector<T>(array.data(), array.data() + array.size());
}

inline void require(bool condition, const char* message) {
    if (!condition) throw std::invalid_argument(message);
}

template <typename A>
void require_finite(const A& array, const char* message) {
    for (std::size_t i = 0; i < array.size(); ++i) require(std::isfinite(array.data()[i]), message);
}

inline SparseTables make_tables(Index tables, Index rows, Index columns, const InputArray<std::int64_t, 1>& begins,
                                const InputArray<Index, 1>& column, const InputArray<double, 1>& value) {
    return SparseTables{tables, rows, columns, copy(begins), copy(column), copy(value)};
}

// A copy of a table (A, S) of finite numbers.
inline std::vector<double> copy_table(const Model& model, const InputArray<double, 2>& table) {
    require(table.shape(0) == as_size(model.actions) &&
                table.shape(1) == as_size(model.states),
            "expected a table of actions by states");
    require_finite(table, "expected a table of finite numbers");
    return copy(table);
}

inline Weights make_belief(const Model& model, const InputArray<double, 1>& dense) {
    require(dense.shape(0) == as_size(model.states), "a belief needs one number per state");
    Weights belief;
    double total = 0.0;
    for (Index s = 0; s < model.states; ++s) {
        const double p = dense.data()[s];
        require(std::isfinite(p) && p >= 0, "a number of a belief is negative or not finite");
        if (p == 0) continue;
        belief.state.push_back(s);
        belief.weight.push_back(p);
        total += p;
    }
    require(std::abs(total - 1) <= kSumTolerance, "a belief does not sum to 1");
    return belief;
}

// The beliefs of points: belief k has the states and weights from begins[k] to before begins[k + 1].
inline std::vector<Weights> make_beliefs(const Model& model, const InputArray<std::int64_t, 1>& begins,
                                         const InputArray<Index, 1>& states, const InputArray<double, 1>& weights,
                                         std::size_t count) {
    const std::size_t entries = states.size();
    require(begins.size() == count + 1 && weights.size() == entries && begins.data()[0] == 0 &&
                begins.data()[count] == static_cast<std::int64_t>(entries),
            "the arrays of the points do not fit together");
    std::vector<Weights> beliefs(count);
    for (std::size_t k = 0; k < count; ++k) {
        const std::int64_t begin = begins.data()[k], end = begins.data()[k + 1];
        require(begin < end && end <= static_cast<std::int64_t>(entries), "a point has no states");
        Weights& belief = beliefs[k];
        double total = 0.0;
        for (std::int64_t i = begin; i < end; ++i) {
            const Index s = states.data()[i];
            require(s >= 0 && s < model.states && weights.data()[i] > 0 && (i == begin || s > states.data()[i - 1]),
                    "a point needs strictly increasing states and positive weights");
            belief.state.push_back(s);
            belief.weight.push_back(weights.data()[i]);
            total += weights.data()[i];
        }
        require(std::abs(total - 1) <= kSumTolerance, "a belief does not sum to 1");
    }
    return beliefs;
}

inline Potential make_potential(const Model& model, const InputArray<double, 1>& offset, double scale, double power, double entropy,
                                const InputArray<Index, 2>& pairs, const InputArray<double, 1>& pair_weights) {
    require(offset.size() == as_size(model.states), "a potential needs one offset per state");
    require_finite(offset, "an offset is not finite");
    require(scale >= 0 && power > 1 && entropy >= 0 && std::isfinite(scale) && std::isfinite(power) && std::isfinite(entropy),
            "scale and entropy must not be negative, power above 1");
    require(pairs.shape(1) == 2 && pairs.shape(0) == pair_weights.size(), "expected one weight for each pair of states");
    Potential potential;
    potential.offset = copy(offset);
    potential.scale = scale;
    potential.power = power;
    potential.entropy = entropy;
    for (std::size_t k = 0; k < pair_weights.size(); ++k) {
        const Index first = pairs.data()[2 * k], second = pairs.data()[2 * k + 1];
        require(first >= 0 && second >= 0 && first < model.states && second < model.states && pair_weights.data()[k] >= 0,
                "a pair has an unknown state or a negative weight");
        potential.pairs.push_back({first, second, pair_weights.data()[k]});
    }
    return potential;
}

inline Node& get_node(Tree& tree, Index node) {
    if (node < 0 || as_size(node) >= tree.nodes.size()) throw nb::index_error("unknown node");
    return tree.nodes[as_size(node)];
}

inline Branch& get_branch(Tree& tree, Index node, Index action) {
    Node& found = get_node(tree, node);
    if (action < 0 || action >= tree.model.actions) throw nb::index_error("unknown action");
    return found.branches[as_size(action)];
}

inline VectorSet& get_set(Tree& tree, std::size_t group) {
    if (group >= tree.sets.size()) throw nb::index_error("unknown group");
    return tree.sets[group];
}

}  // namespace lcorpp
