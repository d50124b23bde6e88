// SAMPLE: one path of beliefs from a root, towards where the bounds matter most for the root.
#pragma once

#include <vector>

#include "clock.hpp"
#include "tree.hpp"

namespace lcorpp {

// A guess at the value of a belief, learnt from beliefs alike: those whose initial upper bound and entropy fall
// into one bin. Source: Kurniawati, Hsu and Lee, RSS 2008, section III-B.
class Prediction {
  public:
    explicit Prediction(const std::vector<double>& corners);
    void learn(const Node& node);
    double value(const Node& node) const;

  private:
    std::size_t bin(const Node& node) const;
    double least_, span_;
    std::vector<double> sum_, count_;
};

struct Trial {
    double target;      // the gap wanted at the root; a node t steps down may keep target / gamma^t
    std::size_t depth;  // the most nodes on the path
    bool greedy_below;  // follow the action that is best in the lower bound instead of the upper
};

// Sample a path and back up along it, the last belief first; how many nodes it had. At the end
// of the time it ends wherever it is.
std::size_t run_trial(Tree& tree, Prediction& prediction, Index root, const Trial& trial, Clock& clock);

}  // namespace lcorpp
