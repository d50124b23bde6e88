#include "model.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <utility>

namespace lcorpp {

namespace {

void check(const SparseTables& tables) {
    if (tables.tables < 1 || tables.rows < 1 || tables.columns < 1) throw std::invalid_argument("a model needs states, actions and observations");
    const std::size_t count = static_cast<std::size_t>(tables.tables) * static_cast<std::size_t>(tables.rows);
    if (tables.begins.size() != count + 1 || tables.begins.front() != 0 || tables.column.size() != tables.value.size() ||
        tables.begins.back() != static_cast<std::int64_t>(tables.column.size())) {
        throw std::invalid_argument("the row offsets of a table do not match its entries");
    }
    for (std::size_t i = 0; i < count; ++i) {
        if (tables.begins[i] > tables.begins[i + 1]) throw std::invalid_argument("the row offsets of a table decrease");
    }
    for (const Index column : tables.column) {
        if (column < 0 || column >= tables.columns) throw std::invalid_argument("a column of a table is out of range");
    }
    for (std::size_t i = 0; i < count; ++i) {
        double sum = 0.0;
        const auto begin = static_cast<std::size_t>(tables.begins[i]), end = static_cast<std::size_t>(tables.begins[i + 1]);
        for (std::size_t j = begin; j < end; ++j) {
            if (j > begin && tables.column[j] <= tables.column[j - 1]) throw std::invalid_argument("the columns of a row are not strictly increasing");
            if (!(tables.value[j] >= 0)) throw std::invalid_argument("a probability is negative or not finite");
            sum += tables.value[j];
        }
        if (!(std::abs(sum - 1) <= kSumTolerance)) throw std::invalid_argument("a row of a table does not sum to 1");
    }
}

// The root of a tree of a union-find forest; halves the path to it.
Index find_root(std::vector<Index>& parent, Index i) {
    while (parent[as_size(i)] != i) {
        Index& up = parent[as_size(i)];
        up = parent[as_size(up)];
        i = up;
    }
    return i;
}

}  // namespace

Model::Model(SparseTables transition_, SparseTables observation_, std::vector<double> reward_, double discount_)
    : transition(std::move(transition_)),
      observation(std::move(observation_)),
      reward(std::move(reward_)),
      discount(discount_),
      states(transition.rows),
      actions(transition.tables),
      observations(observation.columns) {
    check(transition);
    check(observation);
    if (transition.columns != states || observation.rows != states || observation.tables != actions ||
        reward.size() != as_size(actions) * as_size(states)) {
        throw std::invalid_argument("the tables of a model have different numbers of states or actions");
    }
    find_blocks();
}

// Blocks are the connected components of the states, where two are connected if the same action reaches both and the
// same observation can follow.
void Model::find_blocks() {
    const auto count = as_size(states);
    std::vector<Index> parent(count);
    std::iota(parent.begin(), parent.end(), 0);
    std::vector<char> reached(count);
    std::vector<Index> first_with(as_size(observations));
    for (Index a = 0; a < actions; ++a) {
        std::fill(reached.begin(), reached.end(), 0);
        for (std::size_t i = transition.begin(a, 0); i < transition.end(a, states - 1); ++i) {
            reached[as_size(transition.column[i])] = 1;
        }
        std::fill(first_with.begin(), first_with.end(), -1);
        for (Index s = 0; s < states; ++s) {
            if (!reached[as_size(s)]) continue;
            for (std::size_t i = observation.begin(a, s); i < observation.end(a, s); ++i) {
                Index& first = first_with[as_size(observation.column[i])];
                if (first < 0) {
                    first = s;
                } else {
                    parent[as_size(find_root(parent, s))] = find_root(parent, first);
                }
            }
        }
    }
    block.assign(count, -1);
    local.assign(count, 0);
    std::vector<Index> number(count, -1);
    for (Index s = 0; s < states; ++s) {
        Index& own = number[as_size(find_root(parent, s))];
        if (own < 0) {
            own = static_cast<Index>(members.size());
            members.emplace_back();
        }
        auto& others = members[as_size(own)];
        block[as_size(s)] = own;
        local[as_size(s)] = static_cast<Index>(others.size());
        others.push_back(s);
    }
}

Successors::Successors(const Model& model)
    : model_(model),
      mass_(as_size(model.states), 0.0),
      entries_(as_size(model.observations), 0) {}

const Weights& Successors::predict(const Weights& belief, Index action) {
    const SparseTables& T = model_.transition;
    predicted_.clear();
    for (std::size_t i = 0; i < belief.size(); ++i) {
        const std::size_t end = T.end(action, belief.state[i]);
        for (std::size_t j = T.begin(action, belief.state[i]); j < end; ++j) {
            double& mass = mass_[as_size(T.column[j])];
            const double share = belief.weight[i] * T.value[j];
            if (mass == 0.0 && share > 0.0) predicted_.state.push_back(T.column[j]);
            mass += share;
        }
    }
    std::sort(predicted_.state.begin(), predicted_.state.end());
    for (const Index s : predicted_.state) {
        double& mass = mass_[as_size(s)];
        predicted_.weight.push_back(mass);
        mass = 0.0;
    }
    return predicted_;
}

const Outcomes& Successors::compute_outcomes(const Weights& belief, Index action) {
    const SparseTables& Z = model_.observation;
    predict(belief, action);
    Outcomes& out = outcomes_;
    out.observation.clear();
    for (const Index s : predicted_.state) {
        for (std::size_t j = Z.begin(action, s); j < Z.end(action, s); ++j) {
            if (entries_[as_size(Z.column[j])]++ == 0) out.observation.push_back(Z.column[j]);
        }
    }
    std::sort(out.observation.begin(), out.observation.end());
    const std::size_t children = out.observation.size();
    out.begins.assign(children + 1, 0);
    for (std::size_t c = 0; c < children; ++c) {
        std::size_t& entries = entries_[as_size(out.observation[c])];
        out.begins[c + 1] = out.begins[c] + entries;
        entries = out.begins[c];  // from here on: index of the next entry of this child
    }
    out.state.resize(out.begins[children]);
    out.weight.resize(out.begins[children]);
    out.probability.assign(children, 0.0);
    for (std::size_t i = 0; i < predicted_.size(); ++i) {
        const Index s = predicted_.state[i];
        for (std::size_t j = Z.begin(action, s); j < Z.end(action, s); ++j) {
            std::size_t& next = entries_[as_size(Z.column[j])];
            out.state[next] = s;
            out.weight[next] = predicted_.weight[i] * Z.value[j];
            ++next;
        }
    }
    // Drop the children whose probability has no significant digits.
    std::size_t kept = 0, written = 0;
    for (std::size_t c = 0; c < children; ++c) {
        entries_[as_size(out.observation[c])] = 0;
        const std::size_t from = out.begins[c], to = out.begins[c + 1], start = written;
        double total = 0.0;
        for (std::size_t i = from; i < to; ++i) total += out.weight[i];
        if (total < kMinProbability) continue;
        for (std::size_t i = from; i < to; ++i) {
            if (out.weight[i] == 0.0) continue;
            out.state[written] = out.state[i];
            out.weight[written] = out.weight[i];
            ++written;
        }
        out.observation[kept] = out.observation[c];
        out.probability[kept] = total;
        out.begins[kept] = start;
        ++kept;
    }
    out.observation.resize(kept);
    out.probability.resize(kept);
    out.begins.resize(kept + 1);
    out.begins[kept] = written;
    out.state.resize(written);
    out.weight.resize(written);
    return out;
}

}  // namespace lcorpp
