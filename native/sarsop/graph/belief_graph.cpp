#include "graph/belief_graph.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include "graph/belief_key.hpp"
#include "tree.hpp"

namespace lcorpp {

namespace {

constexpr std::size_t kMaxDepth = 200;

// Time for one number of a next belief, in that for a number of a vector or point.
constexpr std::uint64_t kWorkPerNumber = 40;

// Memory of an entry of the index, about.
constexpr std::size_t kEntrySize = 48;

}  // namespace

BeliefGraph::BeliefGraph(Tree& tree, Renamings renamings)
    : tree_(tree), model_(tree.model), renamings_(std::move(renamings)), successors_(tree.model) {}

std::size_t BeliefGraph::memory_size() const {
    return nodes_.size() * (sizeof(Node) + kEntrySize) + states_.size() * (sizeof(Index) + sizeof(double)) +
           branches_.size() * sizeof(Branch) + children_.size() * sizeof(Child);
}

void BeliefGraph::clear() {
    nodes_ = {};
    states_ = {};
    weights_ = {};
    branches_ = {};
    children_ = {};
    index_ = {};
}

Weights BeliefGraph::belief_of(const Node& node) const {
    Weights belief;
    belief.state.assign(states_.begin() + static_cast<std::ptrdiff_t>(node.first),
                        states_.begin() + static_cast<std::ptrdiff_t>(node.first + node.size));
    belief.weight.assign(weights_.begin() + static_cast<std::ptrdiff_t>(node.first),
                         weights_.begin() + static_cast<std::ptrdiff_t>(node.first + node.size));
    return belief;
}

Index BeliefGraph::find(Weights belief, float& slack) {
    renamings_.normalise(belief);
    return look_up(belief, hash_belief(belief.state.data(), belief.weight.data(), belief.size()), slack);
}

// `belief` is in normal form.
Index BeliefGraph::look_up(const Weights& belief, std::uint64_t hash, float& slack) const {
    const auto range = index_.equal_range(hash);
    for (auto entry = range.first; entry != range.second; ++entry) {
        const Node& node = nodes_[as_size(entry->second)];
        const Index* states = states_.data() + node.first;
        const double* weights = weights_.data() + node.first;
        if (!same_belief(states, weights, node.size, belief.state.data(), belief.weight.data(), belief.size())) continue;
        slack = lipschitz_slack(tree_.max_abs_value, l1_distance(states, weights, node.size, belief.state.data(),
                                                                 belief.weight.data(), belief.size()));
        return entry->second;
    }
    return -1;
}

// `belief` is in normal form.
Index BeliefGraph::find_or_add(const Weights& belief, float& slack) {
    const std::uint64_t hash = hash_belief(belief.state.data(), belief.weight.data(), belief.size());
    if (const Index known = look_up(belief, hash, slack); known >= 0) return known;
    slack = 0.0f;
    Node node;
    node.first = states_.size();
    node.size = static_cast<std::uint32_t>(belief.size());
    states_.insert(states_.end(), belief.state.begin(), belief.state.end());
    weights_.insert(weights_.end(), belief.weight.begin(), belief.weight.end());
    node.upper = tree_.sawtooth.initial_bound(belief.state.data(), belief.weight.data(), belief.size(), tree_.find_group(belief));
    node.lower = tree_.blind_value(belief);
    node.upper = std::max(node.upper, node.lower);
    const Index number = static_cast<Index>(nodes_.size());
    nodes_.push_back(node);
    index_.emplace(hash, number);
    return number;
}

// Include the points and vectors since the last visit.
void BeliefGraph::refresh(Index number) {
    Node& node = nodes_[as_size(number)];
    const Index* states = states_.data() + node.first;
    const double* weights = weights_.data() + node.first;
    if (node.points < tree_.sawtooth.next_stamp() || node.vectors < tree_.made_count()) {
        const Index group = tree_.find_group(belief_of(node));
        node.upper = std::min(node.upper, tree_.sawtooth.bound(states, weights, node.size, group, node.points));
        node.lower = std::max(node.lower, tree_.best_value_since(group, states, weights, node.size, node.vectors));
        node.points = tree_.sawtooth.next_stamp();
        node.vectors = tree_.made_count();
        node.upper = std::max(node.upper, node.lower);
    }
}

void BeliefGraph::expand(Index number) {
    const Weights belief = belief_of(nodes_[as_size(number)]);
    std::vector<Branch> branches;
    for (Index a = 0; a < model_.actions; ++a) {
        if (tree_.sawtooth.informed_value(belief, a) <= nodes_[as_size(number)].lower) continue;
        Branch branch{0.0, 0.0, children_.size(), 0};
        for (std::size_t i = 0; i < belief.size(); ++i) branch.reward += belief.weight[i] * model_.reward_of(a, belief.state[i]);
        const Outcomes& outcomes = successors_.compute_outcomes(belief, a);
        for (std::size_t c = 0; c < outcomes.count(); ++c) {
            next_.state.assign(outcomes.states(c), outcomes.states(c) + outcomes.size(c));
            next_.weight.assign(outcomes.weights(c), outcomes.weights(c) + outcomes.size(c));
            for (double& weight : next_.weight) weight /= outcomes.probability[c];
            renamings_.normalise(next_);
            work_ += kWorkPerNumber * next_.size();
            float slack;
            const Index node = find_or_add(next_, slack);
            const auto first = children_.begin() + static_cast<std::ptrdiff_t>(branch.first);
            const auto same = std::find_if(first, children_.end(), [&](const Child& child) { return child.node == node; });
            if (same != children_.end()) {
                same->probability += outcomes.probability[c];
                same->slack = std::max(same->slack, slack);
            } else {
                children_.push_back({outcomes.probability[c], node, slack});
                ++branch.count;
            }
        }
        branches.push_back(branch);
    }
    Node& node = nodes_[as_size(number)];
    node.branches = branches_.size();
    node.branch_count = static_cast<std::uint32_t>(branches.size());
    node.expanded = true;
    branches_.insert(branches_.end(), branches.begin(), branches.end());
}

// Update the bounds of a node by those of its children, drop the actions that cannot be optimal, and return the position of
// the branch with the highest upper bound, -1 if there is none.
Index BeliefGraph::back_up(Index number) {
    Node& node = nodes_[as_size(number)];
    double highest = -std::numeric_limits<double>::infinity();
    Index best = -1;
    for (std::size_t i = 0; i < node.branch_count;) {
        Branch& branch = branches_[node.branches + i];
        double upper = 0.0, lower = 0.0;
        for (std::size_t c = branch.first; c < branch.first + branch.count; ++c) {
            const Child& child = children_[c];
            const Node& next = nodes_[as_size(child.node)];
            upper += child.probability * (next.upper + static_cast<double>(child.slack));
            lower += child.probability * (next.lower - static_cast<double>(child.slack));
        }
        branch.upper = branch.reward + model_.discount * upper;
        node.lower = std::max(node.lower, branch.reward + model_.discount * lower);
        if (branch.upper <= node.lower) {
            std::swap(branch, branches_[node.branches + --node.branch_count]);
            continue;
        }
        if (branch.upper > highest) {
            highest = branch.upper;
            best = static_cast<Index>(i);
        }
        ++i;
    }
    node.upper = std::max(node.lower, std::min(node.upper, highest));
    return best;
}

std::size_t BeliefGraph::search(const Weights& root_belief, double target_share, double min_target, std::uint64_t max_work,
                                Clock& clock) {
    Weights start = root_belief;
    renamings_.normalise(start);
    float slack;
    const Index root = find_or_add(start, slack);
    std::size_t expansions = 0;
    std::vector<Index> path;
    const std::uint64_t began = tree_.work();
    while (tree_.work() - began < max_work && !clock.expired()) {
        refresh(root);
        const double gap = nodes_[as_size(root)].upper - nodes_[as_size(root)].lower;
        double allowed = std::max(min_target, target_share * gap);
        if (gap <= allowed) break;
        path.clear();
        Index number = root;
        const std::size_t expanded_before = expansions;
        ++trials_;
        while (true) {
            path.push_back(number);
            nodes_[as_size(number)].trial = trials_;
            ++work_;
            refresh(number);
            if (!nodes_[as_size(number)].expanded) {
                expand(number);
                ++expansions;
            }
            const Index best = back_up(number);
            const Node& node = nodes_[as_size(number)];
            if (best < 0 || node.upper - node.lower <= allowed || path.size() >= kMaxDepth) break;
            allowed /= model_.discount;
            const Branch& branch = branches_[node.branches + as_size(best)];
            double widest = 0.0;
            number = -1;
            for (std::size_t c = branch.first; c < branch.first + branch.count; ++c) {
                const Child& child = children_[c];
                const Node& next = nodes_[as_size(child.node)];
                const double excess = child.probability * (next.upper - next.lower - allowed);
                if (excess > widest && next.trial != trials_) {  // a path that returned to a node might go in circles
                    widest = excess;
                    number = child.node;
                }
            }
            if (number < 0) break;
        }
        for (auto node = path.rbegin(); node != path.rend(); ++node) back_up(*node);
        const double left = nodes_[as_size(root)].upper - nodes_[as_size(root)].lower;
        if (expansions == expanded_before && left > gap - kMinGain * tree_.max_abs_value) break;  // it would be repeated
    }
    return expansions;
}

}  // namespace lcorpp
