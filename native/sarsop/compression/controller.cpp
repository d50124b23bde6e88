#include "controller.hpp"

#include <algorithm>

namespace lcorpp {

Controller::Controller(Tree& tree, Clock& clock)
    : tree_(tree), clock_(clock), next_plan_(as_size(tree.model.observations)) {
    for (std::size_t g = 0; g < tree.sets.size(); ++g) {
        const VectorSet& set = tree.sets[g];
        for (std::size_t row = 0; row < set.count(); ++row) {
            if (is_blind(set.stamp(row))) continue;
            plans_.push_back({set.stamp(row), static_cast<Index>(g), set.action(row), static_cast<Index>(row), nullptr, {}, {}, {}, {}});
        }
    }
    for (const PrunedVector* pruned : tree.dependencies.pruned()) {
        plans_.push_back({pruned->stamp, pruned->group, pruned->action, -1, pruned, {}, {}, {}, {}});
    }
    std::sort(plans_.begin(), plans_.end(), [](const Plan& a, const Plan& b) { return a.stamp > b.stamp; });
    const std::size_t count = plans_.size();
    for (std::size_t i = 0; i < count; ++i) number_of_[{plans_[i].stamp, plans_[i].group}] = static_cast<Index>(i);
    for (std::size_t i = 0; i < count; ++i) {
        const std::vector<Edge>& edges = tree.dependencies.edges(plans_[i].stamp);
        std::vector<std::pair<Index, Index>> next;
        next.reserve(edges.size());
        for (const Edge& edge : edges) next.emplace_back(edge.observation, find_plan(edge.vector, edge.group));
        plans_[i].next.swap(next);
    }
}

// The number of the plan of a vector; a blind policy is added.
Index Controller::find_plan(Stamp vector, Index group) {
    const auto [entry, is_new] = number_of_.try_emplace({vector, group}, static_cast<Index>(plans_.size()));
    if (is_new) {
        const Index row = tree_.sets[as_size(group)].find(vector);
        plans_.push_back({vector, group, static_cast<Index>(vector), row, nullptr, {}, {}, {}, {}});
    }
    return entry->second;
}

// The plan that replaces a pruned one: of those in its set the best for its occupancy. Its own number if that is worse.
Index Controller::find_replacement(Index number) {
    const Plan& plan = plans_[as_size(number)];
    if (!plan.pruned) return number;
    std::vector<Index> positions;
    std::vector<double> weights;
    double own_value = 0.0, mass = 0.0;
    for (std::size_t i = 0; i < plan.occupancy.size(); ++i) {
        if (plan.occupancy[i] == 0) continue;
        positions.push_back(static_cast<Index>(i));
        weights.push_back(static_cast<double>(plan.occupancy[i]));
        own_value += weights.back() * plan.pruned->values[i];
        mass += weights.back();
    }
    const VectorSet& set = tree_.sets[as_size(plan.group)];
    if (positions.empty()) return find_plan(set.stamp(as_size(set.central())), plan.group);  // no plan reaches it
    const Best best = set.best(positions.data(), weights.data(), positions.size(), 0);
    const bool is_worse = best.value < own_value - kMinGain * tree_.max_abs_value * mass;
    return is_worse ? number : find_plan(set.stamp(as_size(best.row)), plan.group);
}

void Controller::replace_pruned(const std::vector<Index>& roots) {
    find_occupancy(roots);
    std::vector<Index> replacement, retained;
    for (std::size_t i = 0; i < plans_.size(); ++i) {  // blind policies may be added
        replacement.push_back(find_replacement(static_cast<Index>(i)));
        plans_[i].occupancy = {};
    }
    std::vector<char> is_retained(plans_.size());
    const auto retain = [&](Index number) {
        if (!is_retained[as_size(number)]) retained.push_back(number);
        is_retained[as_size(number)] = 1;
    };
    for (std::size_t i = 0; i < plans_.size(); ++i) {
        if (!plans_[i].pruned && !is_blind(plans_[i].stamp)) retain(static_cast<Index>(i));
    }
    for (std::size_t i = 0; i < retained.size(); ++i) {
        Plan& plan = plans_[as_size(retained[i])];
        for (auto& [observation, next] : plan.next) {
            if (replacement[as_size(next)] != next) plan.changed = 1;  // so that its value is computed
            next = replacement[as_size(next)];
            retain(next);
        }
    }
    std::sort(retained.begin(), retained.end());
    std::vector<Index> new_number(plans_.size());
    for (std::size_t i = 0; i < retained.size(); ++i) new_number[as_size(retained[i])] = static_cast<Index>(i);
    std::vector<Plan> plans;
    for (const Index number : retained) {
        plans.push_back(std::move(plans_[as_size(number)]));
        Plan& plan = plans.back();
        for (auto& [observation, next] : plan.next) next = new_number[as_size(next)];
        const VectorSet& set = tree_.sets[as_size(plan.group)];
        plan.values.resize(set.states());
        for (std::size_t s = 0; s < set.states(); ++s) plan.values[s] = plan.pruned ? plan.pruned->values[s] : set.at(as_size(plan.row), s);
    }
    plans_.swap(plans);
    number_of_.clear();
}

void Controller::install(double excess) {
    std::vector<Stamp> stamps(plans_.size());
    std::vector<char> is_pruned(plans_.size());
    for (std::size_t i = plans_.size(); i-- > 0;) {
        stamps[i] = is_blind(plans_[i].stamp) ? plans_[i].stamp : tree_.next_vector_++;
        is_pruned[i] = plans_[i].pruned != nullptr;
    }
    for (VectorSet& set : tree_.sets) {
        std::vector<char> kept(set.count());
        for (std::size_t row = 0; row < set.count(); ++row) kept[row] = is_blind(set.stamp(row));
        set.keep(kept);
    }
    tree_.dependencies.clear();
    for (std::size_t i = plans_.size(); i-- > 0;) {
        Plan& plan = plans_[i];
        if (is_blind(plan.stamp)) continue;
        std::vector<Edge> edges;
        for (const auto& [observation, next] : plan.next) edges.push_back({observation, plans_[as_size(next)].group, stamps[as_size(next)]});
        for (double& value : plan.values) value -= excess;
        if (is_pruned[i]) {
            tree_.dependencies.record_pruned_vector({stamps[i], plan.group, plan.action, std::move(plan.values)}, std::move(edges));
        } else {
            tree_.sets[as_size(plan.group)].add(plan.values, plan.action, stamps[i]);
            tree_.dependencies.record(stamps[i], std::move(edges));
        }
    }
}

bool Tree::compress(const std::vector<Index>& roots, double max_evaluations, Clock& clock) {
    if (dependencies.has_imported()) return false;
    Controller controller(*this, clock);
    controller.replace_pruned(roots);
    const double excess = controller.evaluate(max_evaluations);
    const bool is_better = std::all_of(roots.begin(), roots.end(), [&](Index root) {
        return controller.value(nodes[as_size(root)], excess) >= lower_bound(root) - kMinGain * max_abs_value;
    });
    if (is_better) controller.install(excess);
    return is_better;
}

}  // namespace lcorpp
