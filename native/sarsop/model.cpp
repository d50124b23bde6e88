#include "model.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <utility>

namespace lcorpp {

namespace {

void check(const Rows& rows) {
    if (rows.tables < 1 || rows.rows < 1 || rows.columns < 1) throw std::invalid_argument("a model has states, actions and observations");
    const std::size_t count = static_cast<std::size_t>(rows.tables) * static_cast<std::size_t>(rows.rows);
    if (rows.begins.size() != count + 1 || rows.begins.front() != 0 || rows.column.size() != rows.value.size() ||
        rows.begins.back() != static_cast<std::int64_t>(rows.column.size())) {
        throw std::invalid_argument("the rows of a table do not add up");
    }
    for (std::size_t i = 0; i < count; ++i) {
        if (rows.begins[i] > rows.begins[i + 1]) throw std::invalid_argument("a row of a table has a negative length");
    }
    for (const Index column : rows.column) {
        if (column < 0 || column >= rows.columns) throw std::invalid_argument("a column of a table is out of range");
    }
    for (std::size_t i = 0; i < count; ++i) {
        double sum = 0.0;
        const auto begin = static_cast<std::size_t>(rows.begins[i]), end = static_cast<std::size_t>(rows.begins[i + 1]);
        for (std::size_t j = begin; j < end; ++j) {
            if (j > begin && rows.column[j] <= rows.column[j - 1]) throw std::invalid_argument("the columns of a row must rise");
            if (!(rows.value[j] >= 0)) throw std::invalid_argument("probabilities are finite numbers, not negative");
            sum += rows.value[j];
        }
        if (!(std::abs(sum - 1) <= kSumTolerance)) throw std::invalid_argument("a row of a table does not sum to 1");
    }
}

Index root(std::vector<Index>& parent, Index i) {
    while (parent[static_cast<std::size_t>(i)] != i) {
        Index& up = parent[static_cast<std::size_t>(i)];
        up = parent[static_cast<std::size_t>(up)];
        i = up;
    }
    return i;
}

}  // namespace

Model::Model(Rows transition_, Rows observation_, std::vector<double> reward_, double discount_)
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
        reward.size() != static_cast<std::size_t>(actions) * static_cast<std::size_t>(states)) {
        throw std::invalid_argument("the tables of a model do not have the same states and actions");
    }
    find_blocks();
}

// States that the same action can reach and the same observation can follow are in one block.
void Model::find_blocks() {
    const auto count = static_cast<std::size_t>(states);
    std::vector<Index> parent(count);
    std::iota(parent.begin(), parent.end(), 0);
    std::vector<char> reached(count);
    std::vector<Index> first(static_cast<std::size_t>(observations));
    for (Index a = 0; a < actions; ++a) {
        std::fill(reached.begin(), reached.end(), 0);
        for (std::size_t i = transition.begin(a, 0); i < transition.end(a, states - 1); ++i) {
            reached[static_cast<std::size_t>(transition.column[i])] = 1;
        }
        std::fill(first.begin(), first.end(), -1);
        for (Index s = 0; s < states; ++s) {
            if (!reached[static_cast<std::size_t>(s)]) continue;
            for (std::size_t i = observation.begin(a, s); i < observation.end(a, s); ++i) {
                Index& other = first[static_cast<std::size_t>(observation.column[i])];
                if (other < 0) {
                    other = s;
                } else {
                    parent[static_cast<std::size_t>(root(parent, s))] = root(parent, other);
                }
            }
        }
    }
    block.assign(count, -1);
    local.assign(count, 0);
    std::vector<Index> number(count, -1);
    for (Index s = 0; s < states; ++s) {
        Index& own = number[static_cast<std::size_t>(root(parent, s))];
        if (own < 0) {
            own = static_cast<Index>(members.size());
            members.emplace_back();
        }
        auto& others = members[static_cast<std::size_t>(own)];
        block[static_cast<std::size_t>(s)] = own;
        local[static_cast<std::size_t>(s)] = static_cast<Index>(others.size());
        others.push_back(s);
    }
}

Successors::Successors(const Model& model)
    : model_(model),
      mass_(static_cast<std::size_t>(model.states), 0.0),
      entries_(static_cast<std::size_t>(model.observations), 0) {}

const Weights& Successors::spread(const Weights& belief, Index action) {
    const Rows& T = model_.transition;
    spread_.clear();
    for (std::size_t i = 0; i < belief.size(); ++i) {
        const std::size_t end = T.end(action, belief.state[i]);
        for (std::size_t j = T.begin(action, belief.state[i]); j < end; ++j) {
            double& mass = mass_[static_cast<std::size_t>(T.column[j])];
            const double share = belief.weight[i] * T.value[j];
            if (mass == 0.0 && share > 0.0) spread_.state.push_back(T.column[j]);
            mass += share;
        }
    }
    std::sort(spread_.state.begin(), spread_.state.end());
    for (const Index s : spread_.state) {
        double& mass = mass_[static_cast<std::size_t>(s)];
        spread_.weight.push_back(mass);
        mass = 0.0;
    }
    return spread_;
}

const Outcomes& Successors::outcomes(const Weights& belief, Index action) {
    const Rows& Z = model_.observation;
    spread(belief, action);
    Outcomes& out = outcomes_;
    out.observation.clear();
    for (const Index s : spread_.state) {
        for (std::size_t j = Z.begin(action, s); j < Z.end(action, s); ++j) {
            if (entries_[static_cast<std::size_t>(Z.column[j])]++ == 0) out.observation.push_back(Z.column[j]);
        }
    }
    std::sort(out.observation.begin(), out.observation.end());
    const std::size_t children = out.observation.size();
    out.begins.assign(children + 1, 0);
    for (std::size_t c = 0; c < children; ++c) {
        std::size_t& entries = entries_[static_cast<std::size_t>(out.observation[c])];
        out.begins[c + 1] = out.begins[c] + entries;
        entries = out.begins[c];  // from here on: where the next entry of this child goes
    }
    out.state.resize(out.begins[children]);
    out.weight.resize(out.begins[children]);
    out.probability.assign(children, 0.0);
    for (std::size_t i = 0; i < spread_.size(); ++i) {
        const Index s = spread_.state[i];
        for (std::size_t j = Z.begin(action, s); j < Z.end(action, s); ++j) {
            std::size_t& next = entries_[static_cast<std::size_t>(Z.column[j])];
            out.state[next] = s;
            out.weight[next] = spread_.weight[i] * Z.value[j];
            ++next;
        }
    }
    // Children whose probability has no digits are left out; the others move up.
    std::size_t kept = 0, written = 0;
    for (std::size_t c = 0; c < children; ++c) {
        entries_[static_cast<std::size_t>(out.observation[c])] = 0;
        const std::size_t from = out.begins[c], to = out.begins[c + 1], start = written;
        double total = 0.0;
        for (std::size_t i = from; i < to; ++i) total += out.weight[i];
        if (total < kImpossible) continue;
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
