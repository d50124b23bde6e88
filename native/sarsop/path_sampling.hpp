// SAMPLE: sample one path of beliefs from a root, towards the beliefs whose bounds matter most at the root.
#pragma once

#include <vector>

#include "clock.hpp"
#include "tree.hpp"

namespace lcorpp {

// Predicts the value of a belief as the mean lower bound of similar beliefs: those with the same bin of initial upper
// bound and entropy. Source: Kurniawati, Hsu and Lee, RSS 2008, section III-B.
class ValuePredictor {
  public:
    explicit ValuePredictor(const std::vector<double>& corners);
    void learn(const Node& node);
    double predict(const Node& node) const;

  private:
    std::size_t find_bin(const Node& node) const;
    double lowest_, range_;
    std::vector<double> sum_, count_;
};

struct SampleOptions {
    double target;          // gap wanted at the root; a node t steps down may keep target / gamma^t
    std::size_t max_depth;  // largest number of nodes on the path
    bool use_lower_bound;   // follow the best action of the lower bound instead of the upper bound
};

// Sample a path, back up its nodes from the last to the first, and return their number. Stops early if time is up.
std::size_t sample(Tree& tree, ValuePredictor& predictor, Index root, const SampleOptions& options, Clock& clock);

}  // namespace lcorpp
