// The values of the plans, which may lead to each other in circles.

#include <algorithm>

#include "controller.hpp"

namespace lcorpp {

namespace {

// Smallest rise of a value that is passed on, and largest rounding error of a value, relative to Tree::max_abs_value.
constexpr double kMinRise = 1e-7, kRounding = 1e-14;

}  // namespace

std::vector<double> Controller::back_up(const Plan& plan) {
    for (const auto& [observation, next] : plan.next) next_plan_[as_size(observation)] = next;
    return tree_.combine(plan.group, plan.action, [&](Index observation, Index next) {
        return plans_[as_size(next_plan_[as_size(observation)])].values[as_size(tree_.model.local[as_size(next)])];
    });
}

// If no value falls when all plans are backed up, the values are lower bounds. If one falls by d, they are after all have
// been lowered by d / (1 - gamma).
double Controller::evaluate(double max_evaluations) {
    const double scale = tree_.max_abs_value, gamma = tree_.model.discount;
    const double min_fall = std::max(kMinGain * (1 - gamma), kRounding) * scale, min_rise = kMinRise * scale;
    const auto back_up_all = [&](auto visit) {
        for (auto plan = plans_.rbegin(); plan != plans_.rend(); ++plan) {  // the older, on which others depend, first
            if (!is_blind(plan->stamp)) visit(*plan);
        }
    };
    std::size_t evaluations = 1;
    for (bool any_changed = true; any_changed && static_cast<double>(evaluations) < max_evaluations;) {
        any_changed = false;
        back_up_all([&](Plan& plan) {
            std::size_t changed = plan.evaluated ? 0 : plan.changed;
            for (const auto& [observation, next] : plan.next) changed = std::max(changed, plans_[as_size(next)].changed);
            if (changed <= plan.evaluated || clock_.expired()) return;
            std::vector<double> values = back_up(plan);
            plan.evaluated = ++evaluations;
            for (std::size_t i = 0; i < values.size(); ++i) {
                if (values[i] < plan.values[i] - min_fall || values[i] > plan.values[i] + min_rise) plan.changed = evaluations + 1;
            }
            any_changed = any_changed || plan.changed > evaluations;
            plan.values.swap(values);
        });
    }
    double fall = 0.0;
    back_up_all([&](Plan& plan) {
        if (clock_.expired()) return;
        const std::vector<double> values = back_up(plan);
        for (std::size_t i = 0; i < values.size(); ++i) fall = std::max(fall, plan.values[i] - values[i]);
    });
    return clock_.expired() ? kInfinity : fall / (1 - gamma);
}

double Controller::value(const Node& node, double excess) const {
    const std::vector<Index> positions = tree_.find_positions(node);
    const VectorSet& set = tree_.sets[as_size(node.group)];
    double best = -kInfinity;
    const auto compare = [&](double shift, auto value_at) {
        double value = shift;
        for (std::size_t i = 0; i < positions.size(); ++i) value += node.belief.weight[i] * value_at(as_size(positions[i]));
        best = std::max(best, value);
    };
    for (std::size_t row = 0; row < set.count() && is_blind(set.stamp(row)); ++row) {
        compare(0.0, [&](std::size_t s) { return set.at(row, s); });
    }
    for (const Plan& plan : plans_) {
        if (plan.group != node.group || plan.pruned || is_blind(plan.stamp)) continue;
        compare(-excess, [&](std::size_t s) { return plan.values[s]; });
    }
    return best;
}

}  // namespace lcorpp
