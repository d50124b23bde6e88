#include "path_sampling.hpp"

#include <algorithm>

namespace lcorpp {

namespace {

// Share of the allowed gap below which selective deep sampling has nothing left to find.
constexpr double kNegligibleShare = 0.1;

// A value counts as above a level only if it exceeds the level by this share of the allowed gap: values often equal
// their level exactly, and rounding must not decide then.
constexpr double kLevelMargin = 1e-6;

}  // namespace

ValuePredictor::ValuePredictor(const std::vector<double>& corners)
    : lowest_(*std::min_element(corners.begin(), corners.end())),
      range_(std::max(*std::max_element(corners.begin(), corners.end()) - lowest_, 1e-300)),
      sum_(kPredictorBins * kPredictorBins, 0.0),
      count_(kPredictorBins * kPredictorBins, 0.0) {}

std::size_t ValuePredictor::find_bin(const Node& node) const {
    // Clamp before the conversion to an integer: the quotient is unbounded if all corners are equal.
    const double level = std::clamp((node.informed_value - lowest_) / range_ * kPredictorBins, 0.0, kPredictorBins - 1.0);
    return static_cast<std::size_t>(level) * kPredictorBins + static_cast<std::size_t>(node.entropy_bin);
}

void ValuePredictor::learn(const Node& node) {
    sum_[find_bin(node)] += node.lower;
    count_[find_bin(node)] += 1.0;
}

double ValuePredictor::predict(const Node& node) const {
    const std::size_t own = find_bin(node);
    return count_[own] > 0 ? sum_[own] / count_[own] : node.upper;
}

// The path continues while a node's gap may matter at the root (gap termination with level U), or while the predicted
// value shows that the lower bound may still rise there (selective deep sampling with level L). Beliefs already on the
// path are skipped while another child has a gap that matters: under a slow discount a path would otherwise stay at one
// belief to its end. With discount 0 the root is the whole path.
std::size_t sample(Tree& tree, ValuePredictor& predictor, Index root, const SampleOptions& options, Clock& clock) {
    const double gamma = tree.model.discount;
    std::vector<Index> path{root};
    Index action = tree.select_action(root, options.use_lower_bound);
    double allowed = options.target;
    double L = tree.nodes[as_size(root)].lower, U = L + allowed;
    Index number = root;
    while (gamma > 0 && path.size() < options.max_depth && !clock.expired()) {
        const Node& node = tree.nodes[as_size(number)];
        if (node.upper - node.lower <= kNegligibleShare * allowed) break;
        const double margin = kLevelMargin * allowed;
        if (predictor.predict(node) <= L + margin && node.upper <= std::max(U, node.lower + allowed) + margin) break;
        const Branch& branch = node.branches[as_size(action)];
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
            if (excess > widest_fresh && std::find(path.begin(), path.end(), child.node) == path.end()) {
                widest_fresh = excess;
                fresh = c;
            }
        }
        const std::size_t chosen = widest_fresh > 0 ? fresh : any;
        const Child& child = branch.children[chosen];
        const double lower = node.lower;
        L = std::max(L, lower);
        U = std::max(U, lower + allowed * gamma);
        // The value that the child needs for its parent to reach a level, with the other children unchanged.
        L = ((L - branch.expected_reward) / gamma - (lower_sum - child.lower)) / child.probability;
        U = ((U - branch.expected_reward) / gamma - (upper_sum - child.upper)) / child.probability;
        number = tree.find_or_add_child(number, action, chosen);
        action = tree.select_action(number, options.use_lower_bound);
        predictor.learn(tree.nodes[as_size(number)]);
        path.push_back(number);
    }
    for (auto node = path.rbegin(); node != path.rend(); ++node) {
        tree.backup(*node);
        if (clock.expired()) break;
    }
    return path.size();
}

}  // namespace lcorpp
