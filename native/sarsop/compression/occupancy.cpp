// The discounted visits of each state under each plan.

#include "controller.hpp"

namespace lcorpp {

namespace {

// Initial weight of all beliefs that the roots reach, relative to that of a root.
constexpr double kReachedWeight = 0.1;

// The occupancy is accurate enough if at most this share of it is missing, or after this many passes.
constexpr double kMaxMissing = 1e-2;
constexpr int kMaxPasses = 10;

}  // namespace

// The expected discounted number of visits of each state under each plan, if the roots and the beliefs that they reach
// start with their best plans. Edges mostly lead to older plans, so that few passes by falling stamps suffice.
void Controller::find_occupancy(const std::vector<Index>& roots) {
    const auto start = [&](Index number, double weight) {
        Node& node = tree_.nodes[as_size(number)];
        tree_.update_best_vector(node);
        if (is_blind(node.best_vector)) return;
        Plan& plan = plans_[as_size(find_plan(node.best_vector, node.group))];
        const std::vector<Index> positions = tree_.find_positions(node);
        plan.arriving.resize(tree_.group_states(plan.group).size());
        for (std::size_t i = 0; i < positions.size(); ++i) {
            plan.arriving[as_size(positions[i])] += static_cast<float>(weight * node.belief.weight[i]);
        }
    };
    const std::vector<Index> reachable = tree_.find_reachable(roots);
    for (const Index number : reachable) start(number, kReachedWeight / static_cast<double>(reachable.size()));
    for (const Index number : roots) start(number, 1.0);
    const double total = kReachedWeight + static_cast<double>(roots.size());
    for (int pass = 0; pass < kMaxPasses; ++pass) {
        for (Plan& plan : plans_) {
            if (plan.arriving.empty()) continue;
            if (clock_.expired()) return;
            pass_on(plan);
        }
        double missing = 0.0;
        for (const Plan& plan : plans_) {
            for (const float mass : plan.arriving) missing += static_cast<double>(mass);
        }
        if (missing <= kMaxMissing * total) break;
    }
}

// Add what arrives at a plan to its occupancy, and its next states to what arrives at the next plans.
void Controller::pass_on(Plan& plan) {
    const std::vector<float> arriving = std::exchange(plan.arriving, {});
    const std::vector<Index>& states = tree_.group_states(plan.group);
    Weights visits;
    if (plan.pruned) plan.occupancy.resize(arriving.size());
    for (std::size_t i = 0; i < arriving.size(); ++i) {
        if (arriving[i] == 0) continue;
        if (plan.pruned) plan.occupancy[i] += arriving[i];
        visits.state.push_back(states[i]);
        visits.weight.push_back(static_cast<double>(arriving[i]));
    }
    for (const auto& [observation, next] : plan.next) next_plan_[as_size(observation)] = next;
    const Outcomes& outcomes = tree_.successors_.compute_outcomes(visits, plan.action);
    for (std::size_t c = 0; c < outcomes.count(); ++c) {
        Plan& next = plans_[as_size(next_plan_[as_size(outcomes.observation[c])])];
        if (is_blind(next.stamp)) continue;
        next.arriving.resize(tree_.group_states(next.group).size());
        for (std::size_t i = 0; i < outcomes.size(c); ++i) {
            const Index position = tree_.model.local[as_size(outcomes.states(c)[i])];
            next.arriving[as_size(position)] += static_cast<float>(tree_.model.discount * outcomes.weights(c)[i]);
        }
    }
}

}  // namespace lcorpp
