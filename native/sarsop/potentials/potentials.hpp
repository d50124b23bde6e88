// Upper bounds on the value by potentials: functions of the belief that are not below their own backups.
#pragma once

#include <utility>
#include <vector>

#include "model.hpp"

namespace lcorpp {

// The function offset.b + scale * N(b) - entropy * H(b) - sum over pairs of weight * sqrt(b(s) b(t)), with
// N(b) = (the sum over s of b(s)^power)^(1 / power) and the Shannon entropy H in nats. It is positively homogeneous: for a
// belief times a probability it is the probability times the bound.
struct Potential {
    struct Pair {
        Index first, second;
        double weight;
    };
    std::vector<double> offset;  // (S)
    double scale = 0.0, power = 2.0, entropy = 0.0;
    std::vector<Pair> pairs;
    Index block = -1;  // of the beliefs at which it is an upper bound, -1 for those within any block
};

// The smallest of some potentials at beliefs.
class Potentials {
  public:
    explicit Potentials(Index states) : roots_(as_size(states), 0.0) {}

    bool empty() const { return potentials_.empty(); }
    void add(Potential potential) { potentials_.push_back(std::move(potential)); }

    // The lowest potential at n states of a block with positive weights; infinite if there is none.
    double bound(const Index* states, const double* weights, std::size_t n, Index block);

  private:
    std::vector<Potential> potentials_;
    std::vector<double> logs_;   // reusable memory
    std::vector<double> roots_;  // (S) reusable memory, zero between calls
};

}  // namespace lcorpp
