// A POMDP in compressed rows, and what follows from one action at one belief.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace lcorpp {

using Index = std::int32_t;
using Stamp = std::int64_t;

// Below the smallest normal double a probability has no digits left: dividing by it means nothing.
constexpr double kImpossible = 2.2250738585072014e-308;

// Farther from 1 a row or a belief is no distribution; rounding stays far below.
constexpr double kSumTolerance = 1e-6;

// One table of rows by columns for each action; zeros are left out.
struct Rows {
    Index tables = 0, rows = 0, columns = 0;
    std::vector<std::int64_t> begins;  // (tables * rows + 1) where the entries of each row begin
    std::vector<Index> column;         // (entries)
    std::vector<double> value;         // (entries)

    std::size_t at(Index table, Index row) const {
        return static_cast<std::size_t>(table) * static_cast<std::size_t>(rows) + static_cast<std::size_t>(row);
    }
    std::size_t begin(Index table, Index row) const { return static_cast<std::size_t>(begins[at(table, row)]); }
    std::size_t end(Index table, Index row) const { return static_cast<std::size_t>(begins[at(table, row) + 1]); }
};

// States with non-negative weights, in the order of the states; a belief where they sum to 1.
struct Weights {
    std::vector<Index> state;
    std::vector<double> weight;

    std::size_t size() const { return state.size(); }
    void clear() {
        state.clear();
        weight.clear();
    }
};

// The problem. What an observation may leave open partitions the states into blocks: after every action and
// observation the belief lies in one block. A model whose parts are observed fully (a MOMDP; Ong, Png, Hsu
// and Lee, 2010) falls into many blocks, and all that is kept of a belief or a vector is its own block.
class Model {
  public:
    // Throws std::invalid_argument where shapes or indices do not fit together.
    Model(Rows transition, Rows observation, std::vector<double> reward, double discount);

    const Rows transition;              // (A, S, S) P(s' | s, a)
    const Rows observation;             // (A, S, O) P(o | a, s')
    const std::vector<double> reward;   // (A, S)
    const double discount;
    const Index states, actions, observations;

    std::vector<Index> block;                 // (S) the block of each state
    std::vector<Index> local;                 // (S) its place within the block
    std::vector<std::vector<Index>> members;  // the states of each block

    double reward_of(Index action, Index state) const {
        return reward[static_cast<std::size_t>(action) * static_cast<std::size_t>(states) + static_cast<std::size_t>(state)];
    }

  private:
    void find_blocks();
};

// Where one action leads from a belief, by what is observed then: children in the order of the observations,
// each with the next belief times the probability of its observation.
struct Outcomes {
    std::vector<Index> observation;
    std::vector<double> probability;
    std::vector<std::size_t> begins;  // where the entries of each child begin
    std::vector<Index> state;
    std::vector<double> weight;

    std::size_t count() const { return observation.size(); }
    std::size_t size(std::size_t child) const { return begins[child + 1] - begins[child]; }
    const Index* states(std::size_t child) const { return state.data() + begins[child]; }
    const double* weights(std::size_t child) const { return weight.data() + begins[child]; }
};

class Successors {
  public:
    explicit Successors(const Model& model);

    // Where an action leads from a belief; the reference holds until the next call.
    const Outcomes& outcomes(const Weights& belief, Index action);

    // The states that it reaches, before anything is observed; likewise.
    const Weights& spread(const Weights& belief, Index action);

  private:
    const Model& model_;
    Weights spread_;
    Outcomes outcomes_;
    std::vector<double> mass_;          // (S) scratch, zero between calls
    std::vector<std::size_t> entries_;  // (O) scratch, zero between calls
};

}  // namespace lcorpp
