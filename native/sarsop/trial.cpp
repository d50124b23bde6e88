#include "trial.hpp"

#include <algorithm>

namespace lcorpp {

namespace {

constexpr int kBins = 32;

// Share of the allowed gap below which even selective deep sampling has nothing left to find.
constexpr double kNegligible = 0.1;

// Share of the allowed gap by which a value must be above a level to count as above it: a belief's value often is
// the very level it is held against, and rounding must not decide then.
constexpr double kAbove = 1e-6;

}  // namespace

Prediction::Prediction(const std::vector<double>& corners)
    : least_(*std::min_element(corners.begin(), corners.end())),
      span_(std::max(*std::max_element(corners.begin(), corners.end()) - least_, 1e-300)),
      sum_(kBins * kBins, 0.0),
      count_(kBins * kBins, 0.0) {}

std::size_t Prediction::bin(const Node& node) const {
    // Clamped before it is an integer: where all corners are equal the quotient is beyond any.
    const double level = std::clamp((node.informed - least_) / span_ * kBins, 0.0, kBins - 1.0);
    return static_cast<std::size_t>(level) * kBins + static_cast<std::size_t>(node.entropy);
}

void Prediction::learn(const Node& node) {
    sum_[bin(node)] += node.low;
    count_[bin(node)] += 1.0;
}

double Prediction::value(const Node& node) const {
    const std::size_t own = bin(node);
    return count_[own] > 0 ? sum_[own] / count_[own] : node.high;
}

// The path goes on while a node's gap may still matter at the root (gap termination with the level U), or while
// the predicted value says that the lower bound may still rise there (selective deep sampling, level L).
// Beliefs already on the path are passed over while another child has a gap that matters: under a slow discount
// a trial would circle in one belief to its end.
std::size_t run_trial(Tree& tree, Prediction& prediction, Index root, const Trial& trial, Clock& clock) {
    const double gamma = tree.model.discount;
    std::vector<Index> path{root};
    Index action = tree.look(root, trial.greedy_below);
    double allowed = trial.target;
    double L = tree.nodes[static_cast<std::size_t>(root)].low, U = L + allowed;
    Index at = root;
    while (path.size() < trial.depth && !clock.over()) {
        const Node& node = tree.nodes[static_cast<std::size_t>(at)];
        if (node.high - node.low <= kNegligible * allowed) break;
        const double slack = kAbove * allowed;
        if (prediction.value(node) <= L + slack && node.high <= std::max(U, node.low + allowed) + slack) break;
        const Branch& branch = node.branches[static_cast<std::size_t>(action)];
        allowed /= gamma;
        double widest = -kInfinity, widest_fresh = -kInfinity, lower_sum = 0.0, upper_sum = 0.0;
        std::size_t any = 0, fresh = 0;
        for (std::size_t c = 0; c < branch.children.size(); ++c) {
            const Child& child = branch.children[c];
            const double excess = child.upper - child.lower - child.probability * allowed;
            lower_sum += child.lower;
            upper_sum += child.upper;
            if (excess > widest) {
                widest = excess;
                any = c;
            }
            if (excess > widest_fresh && std::find(path.begin(), path.end(), child.link) == path.end()) {
                widest_fresh = excess;
                fresh = c;
            }
        }
        const std::size_t chosen = widest_fresh > 0 ? fresh : any;
        const Child& child = branch.children[chosen];
        const double best = node.low;
        L = std::max(L, best);
        U = std::max(U, best + allowed * gamma);
        // What the child must be worth for its parent to reach a level, the other children staying as they are.
        L = ((L - branch.immediate) / gamma - (lower_sum - child.lower)) / child.probability;
        U = ((U - branch.immediate) / gamma - (upper_sum - child.upper)) / child.probability;
        at = tree.child(at, action, chosen);
        action = tree.look(at, trial.greedy_below);
        prediction.learn(tree.nodes[static_cast<std::size_t>(at)]);
        path.push_back(at);
    }
    for (auto number = path.rbegin(); number != path.rend(); ++number) {
        tree.backup(*number);
        if (clock.over()) break;
    }
    return path.size();
}

}  // namespace lcorpp
