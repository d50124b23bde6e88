// A POMDP as sparse tables, and the successors of a belief under an action.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace lcorpp {

using Index = std::int32_t;
using Stamp = std::int64_t;

// An index as a position in an array.
constexpr std::size_t as_size(Index index) { return static_cast<std::size_t>(index); }

// The smallest normal double. A smaller probability has no significant digits: dividing by it is meaningless.
constexpr double kMinProbability = 2.2250738585072014e-308;

// Largest deviation of the sum of a distribution from 1; rounding stays far below.
constexpr double kSumTolerance = 1e-6;

// One table of rows by columns for each action, without zeros.
struct SparseTables {
    Index tables = 0, rows = 0, columns = 0;
    std::vector<std::int64_t> begins;  // (tables * rows + 1) index of the first entry of each row
    std::vector<Index> column;         // (entries)
    std::vector<double> value;         // (entries)

    std::size_t at(Index table, Index row) const {
        return as_size(table) * as_size(rows) + as_size(row);
    }
    std::size_t begin(Index table, Index row) const { return static_cast<std::size_t>(begins[at(table, row)]); }
    std::size_t end(Index table, Index row) const { return static_cast<std::size_t>(begins[at(table, row) + 1]); }
};

// States with non-negative weights, by rising state; a belief if the weights sum to 1.
struct Weights {
    std::vector<Index> state;
    std::vector<double> weight;

    std::size_t size() const { return state.size(); }
    void clear() {
        state.clear();
        weight.clear();
    }
};

// The POMDP as sparse tables, and its partition into blocks. Blocks partition the states: after every action and
// observation the belief lies within one block; only a start belief may be over several. A model with fully observed
// parts (a MOMDP; Ong, Png, Hsu and Lee, 2010) has many blocks, and beliefs and alpha vectors are stored over their own
// block only. A group is a block, or (the last one) all states, for beliefs over several blocks.
class Model {
  public:
    // Throws std::invalid_argument if shapes or indices do not fit together.
    Model(SparseTables transition, SparseTables observation, std::vector<double> reward, double discount);

    const SparseTables transition;     // (A, S, S) P(s' | s, a)
    const SparseTables observation;    // (A, S, O) P(o | a, s')
    const std::vector<double> reward;  // (A, S)
    const double discount;
    const Index states, actions, observations;

    std::vector<Index> block;                 // (S) block of each state
    std::vector<Index> local;                 // (S) position of each state within its block
    std::vector<std::vector<Index>> members;  // states of each block

    double reward_of(Index action, Index state) const {
        return reward[as_size(action) * as_size(states) + as_size(state)];
    }

  private:
    void find_blocks();
};

// The children of a belief and an action, by rising observation: each next belief times the probability of its
// observation.
struct Outcomes {
    std::vector<Index> observation;
    std::vector<double> probability;
    std::vector<std::size_t> begins;  // index of the first entry of each child
    std::vector<Index> state;
    std::vector<double> weight;

    std::size_t count() const { return observation.size(); }
    std::size_t size(std::size_t child) const { return begins[child + 1] - begins[child]; }
    const Index* states(std::size_t child) const { return state.data() + begins[child]; }
    const double* weights(std::size_t child) const { return weight.data() + begins[child]; }
};

// Belief updates with reusable memory; a returned reference is valid until the next call.
class Successors {
  public:
    explicit Successors(const Model& model);

    // The children of a belief and an action.
    const Outcomes& compute_outcomes(const Weights& belief, Index action);

    // The distribution of the next state, before any observation.
    const Weights& predict(const Weights& belief, Index action);

  private:
    const Model& model_;
    Weights predicted_;
    Outcomes outcomes_;
    std::vector<double> mass_;          // (S) reusable memory, zero between calls
    std::vector<std::size_t> entries_;  // (O) reusable memory, zero between calls
};

}  // namespace lcorpp
