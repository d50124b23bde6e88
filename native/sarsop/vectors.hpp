// The lower bound: alpha vectors over the states of a block.
#pragma once

#include <vector>

#include "model.hpp"

namespace lcorpp {

struct Best {
    Index row = -1;
    double value = 0.0;
};

// Alpha vectors over n states in the order they were found, stored state by state: asking a belief of a few
// states about many vectors reads a few long runs of numbers.
class VectorSet {
  public:
    explicit VectorSet(std::size_t states) : states_(states), table_() {}

    std::size_t count() const { return stamps_.size(); }
    std::size_t states() const { return states_; }
    Index action(std::size_t row) const { return actions_[row]; }
    Stamp stamp(std::size_t row) const { return stamps_[row]; }
    double at(std::size_t row, std::size_t state) const { return table_[state * capacity_ + row]; }

    // The first row whose stamp is at least `stamp`.
    std::size_t first_since(Stamp stamp) const;

    // The row of a stamp, -1 if it was pruned.
    Index row(Stamp stamp) const;

    // The vector that is best at n local states with weights, among the rows from `first` on.
    Best best(const Index* states, const double* weights, std::size_t n, std::size_t first) const;

    // The values of all rows there.
    void values(const Index* states, const double* weights, std::size_t n, std::vector<double>& out) const;

    // The Euclidean distances of all rows from one.
    void distances(std::size_t from, std::vector<double>& out) const;

    // The first row among the kept that is worth as much as another in every state, less `slack`; -1 for none.
    Index above(std::size_t row, const std::vector<char>& kept, double slack) const;

    // The row that is best on the average over all states: what to do where nothing is known.
    Index central() const { return central_; }

    void add(const std::vector<double>& vector, Index action, Stamp stamp);

    // Drop the rows whose entry is 0.
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
