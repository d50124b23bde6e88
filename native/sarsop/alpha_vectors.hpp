// The lower bound: alpha vectors over the states of a group.
#pragma once

#include <vector>

#include "model.hpp"

namespace lcorpp {

// The best vector at a belief: its row (-1: none) and its value.
struct Best {
    Index row = -1;
    double value = 0.0;
};

// Alpha vectors over n states in order of creation, each with a stamp that stays the same when others are pruned.
// Storage is by state: the values of many vectors at a sparse belief need few contiguous reads.
class VectorSet {
  public:
    explicit VectorSet(std::size_t states) : states_(states), table_() {}

    std::size_t count() const { return stamps_.size(); }
    std::size_t states() const { return states_; }

    // Memory of all vectors in bytes.
    std::size_t memory_size() const { return table_.capacity() * sizeof(double); }

    Index action(std::size_t row) const { return actions_[row]; }
    Stamp stamp(std::size_t row) const { return stamps_[row]; }
    double at(std::size_t row, std::size_t state) const { return table_[state * capacity_ + row]; }

    // The first row whose stamp is at least `stamp`.
    std::size_t first_since(Stamp stamp) const;

    // The row of a stamp, -1 if the vector was pruned.
    Index find(Stamp stamp) const;

    // The best vector at n positions with weights, among the rows from `first` on.
    Best best(const Index* positions, const double* weights, std::size_t n, std::size_t first) const;

    // The values of all rows at n positions with weights.
    void values(const Index* positions, const double* weights, std::size_t n, std::vector<double>& out) const;

    // The Euclidean distances of all rows from one row.
    void distances(std::size_t from, std::vector<double>& out) const;

    // The first kept row that is at most `slack` below the given row in every state; -1 if there is none.
    Index find_dominating(std::size_t row, const std::vector<char>& kept, double slack) const;

    // The row with the largest mean over all states: the choice if the belief is unknown.
    Index central() const { return central_; }

    void add(const std::vector<double>& vector, Index action, Stamp stamp);

    // Drop the rows whose entry in `kept` is 0.
    void keep(const std::vector<char>& kept);

  private:
    void grow();
    void find_central();

    std::size_t states_;
    std::size_t capacity_ = 0;
    std::vector<double> table_;  // (states, capacity)
    std::vector<Index> actions_;
    std::vector<Stamp> stamps_;
    std::vector<double> sums_;
    Index central_ = -1;
};

}  // namespace lcorpp
