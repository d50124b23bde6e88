// COMPRESS: replace the alpha vectors by the values of a finite-state controller with fewer plans.
// Sources: Hansen, "Solving POMDPs by searching in policy space", UAI 1998 (controllers and their values); Grzes, Poupart,
// Yang and Hoey, "Energy efficient execution of POMDP policies", IEEE Transactions on Cybernetics 2015 (controllers made
// of alpha vectors).

#include <algorithm>
#include <map>
#include <utility>

#include "tree.hpp"

namespace lcorpp {

namespace {

// Initial weight of all beliefs that the roots reach, relative to that of a root.
constexpr double kReachedWeight = 0.1;

// The occupancy is accurate enough if at most this share of it is missing, or after this many passes.
constexpr double kMaxMissing = 1e-2;
constexpr int kMaxPasses = 10;

// Smallest rise of a value that is passed on, and largest rounding error of a value, relative to Tree::max_abs_value.
constexpr double kMinRise = 1e-7, kRounding = 1e-14;

}  // namespace

// Each vector is the value of a plan: an action, then the vector of the observation. The pruned vectors that others depend
// on are mostly older versions of plans that the sets contain in a better version. The controller replaces such a version
// by the vector that is best for the states in which the roots' plans reach it. As plans may then lead back to themselves,
// all values are computed anew.
class Controller {
  public:
    Controller(Tree& tree, Clock& clock);

    // Replace pruned vectors by vectors of the sets, where these are no worse for the plans of the roots.
    void replace_pruned(const std::vector<Index>& roots);

    // Compute the values of the plans, with at most about `max_evaluations` vectors. Returns by how much they may exceed
    // those of the controller, infinity if time is up.
    double evaluate(double max_evaluations);

    // The value at a node if all values are lowered by `excess`.
    double value(const Node& node, double excess) const;

    // Replace the vectors of the tree, lowered by `excess`.
    void install(double excess);

  private:
    struct Plan {
        Stamp stamp;
        Index group, action;
        Index row;                                  // in its set, -1 for a pruned vector
        const PrunedVector* pruned;                 // null for a vector of a set
        std::vector<std::pair<Index, Index>> next;  // observation and plan; none for a blind policy
        std::vector<float> arriving, occupancy;     // discounted visits of each state: not passed on yet, and all
        std::vector<double> values;                 // over the states of the group
        std::size_t evaluated = 0, changed = 0;          // number of the last evaluation, and of the last change
    };

    bool is_blind(const Plan& plan) const { return plan.stamp < tree_.model.actions; }
    void arrive(Index plan, const Weights& belief, double weight);
    void find_occupancy(const std::vector<Index>& roots);
    void pass_on(Plan& plan);
    Index find_replacement(Index number) const;
    std::vector<double> back_up(const Plan& plan);

    Tree& tree_;
    Clock& clock_;
    std::vector<Plan> plans_;                                   // by falling stamps
    std::map<std::pair<Stamp, Index>, Index> number_of_;    // of the plan with a stamp and a group
    std::vector<Index> next_plan_;                        // (O) reusable memory
    std::vector<double> predicted_;                             // (S) reusable memory, zero between calls
    std::vector<Index> reached_;                                // reusable memory
};

Controller::Controller(Tree& tree, Clock& clock)
    : tree_(tree), clock_(clock), next_plan_(as_size(tree.model.observations)), predicted_(as_size(tree.model.states)) {
    for (std::size_t g = 0; g < tree.sets.size(); ++g) {
        const VectorSet& set = tree.sets[g];
        for (std::size_t row = 0; row < set.count(); ++row) {
            plans_.push_back({set.stamp(row), static_cast<Index>(g), set.action(row), static_cast<Index>(row), nullptr, {}, {}, {}, {}});
        }
    }
    for (const PrunedVector* pruned : tree.dependencies.pruned()) {
        plans_.push_back({pruned->stamp, pruned->group, pruned->action, -1, pruned, {}, {}, {}, {}});
    }
    std::sort(plans_.begin(), plans_.end(), [](const Plan& a, const Plan& b) {
        return std::pair(a.stamp, a.group) > std::pair(b.stamp, b.group);
    });
    for (std::size_t i = 0; i < plans_.size(); ++i) number_of_[{plans_[i].stamp, plans_[i].group}] = static_cast<Index>(i);
    for (Plan& plan : plans_) {
        if (is_blind(plan)) continue;
        plan.next.reserve(tree.dependencies.edges(plan.stamp).size());
        for (const Edge& edge : tree.dependencies.edges(plan.stamp)) {
            plan.next.emplace_back(edge.observation, number_of_.at({edge.vector, edge.group}));
        }
    }
}

void Controller::arrive(Index number, const Weights& belief, double weight) {
    Plan& plan = plans_[as_size(number)];
    if (is_blind(plan)) return;
    const bool is_block = as_size(plan.group) < tree_.model.members.size();
    plan.arriving.resize(tree_.group_states(plan.group).size());
    for (std::size_t i = 0; i < belief.size(); ++i) {
        const auto s = as_size(belief.state[i]);
        plan.arriving[is_block ? as_size(tree_.model.local[s]) : s] += static_cast<float>(weight * belief.weight[i]);
    }
}

// The expected discounted number of visits of each state under each plan, if the roots and the beliefs that they reach
// start with their best plans. Edges mostly lead to older plans, so that few passes by falling stamps suffice.
void Controller::find_occupancy(const std::vector<Index>& roots) {
    const auto start = [&](Index number, double weight) {
        Node& node = tree_.nodes[as_size(number)];
        tree_.update_best_vector(node);
        arrive(number_of_.at({node.best_vector, node.group}), node.belief, weight);
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

void Controller::pass_on(Plan& plan) {
    const Model& model = tree_.model;
    const SparseTables& T = model.transition;
    const SparseTables& Z = model.observation;
    const std::vector<float> arriving = std::exchange(plan.arriving, {});
    const std::vector<Index>& states = tree_.group_states(plan.group);
    plan.occupancy.resize(arriving.size());
    for (std::size_t i = 0; i < arriving.size(); ++i) {
        if (arriving[i] == 0) continue;
        plan.occupancy[i] += arriving[i];
        for (std::size_t j = T.begin(plan.action, states[i]); j < T.end(plan.action, states[i]); ++j) {
            double& mass = predicted_[as_size(T.column[j])];
            if (mass == 0) reached_.push_back(T.column[j]);
            mass += model.discount * static_cast<double>(arriving[i]) * T.value[j];
        }
    }
    for (const auto& [observation, next] : plan.next) next_plan_[as_size(observation)] = next;
    for (const Index s : reached_) {
        for (std::size_t k = Z.begin(plan.action, s); k < Z.end(plan.action, s); ++k) {
            Plan& next = plans_[as_size(next_plan_[as_size(Z.column[k])])];
            if (is_blind(next)) continue;
            next.arriving.resize(tree_.group_states(next.group).size());
            next.arriving[as_size(model.local[as_size(s)])] += static_cast<float>(predicted_[as_size(s)] * Z.value[k]);
        }
        predicted_[as_size(s)] = 0.0;
    }
    reached_.clear();
}

// The plan that replaces a pruned one: of those in its set the best for its occupancy. Its own number if that is worse.
Index Controller::find_replacement(Index number) const {
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
    if (positions.empty()) return number_of_.at({set.stamp(as_size(set.central())), plan.group});  // no plan reaches it
    const Best best = set.best(positions.data(), weights.data(), positions.size(), 0);
    const bool is_worse = best.value < own_value - kMinGain * tree_.max_abs_value * mass;
    return is_worse ? number : number_of_.at({set.stamp(as_size(best.row)), plan.group});
}

void Controller::replace_pruned(const std::vector<Index>& roots) {
    find_occupancy(roots);
    std::vector<Index> replacement(plans_.size()), retained;
    std::vector<char> is_retained(plans_.size());
    for (std::size_t i = 0; i < plans_.size(); ++i) {
        replacement[i] = find_replacement(static_cast<Index>(i));
        plans_[i].occupancy = {};
        is_retained[i] = !plans_[i].pruned;
        if (is_retained[i]) retained.push_back(static_cast<Index>(i));
    }
    for (std::size_t i = 0; i < retained.size(); ++i) {
        Plan& plan = plans_[as_size(retained[i])];
        for (auto& [observation, next] : plan.next) {
            if (replacement[as_size(next)] != next) plan.changed = 1;  // so that its value is computed
            next = replacement[as_size(next)];
            if (!is_retained[as_size(next)]) retained.push_back(next);
            is_retained[as_size(next)] = 1;
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
            if (!is_blind(*plan)) visit(*plan);
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
    const bool is_block = as_size(node.group) < tree_.model.members.size();
    double best = -kInfinity;
    for (const Plan& plan : plans_) {
        if (plan.group != node.group || plan.pruned) continue;
        double value = is_blind(plan) ? 0.0 : -excess;
        for (std::size_t i = 0; i < node.belief.size(); ++i) {
            const auto s = as_size(node.belief.state[i]);
            value += node.belief.weight[i] * plan.values[is_block ? as_size(tree_.model.local[s]) : s];
        }
        best = std::max(best, value);
    }
    return best;
}

void Controller::install(double excess) {
    std::vector<Stamp> stamps(plans_.size());
    for (std::size_t i = plans_.size(); i-- > 0;) stamps[i] = is_blind(plans_[i]) ? plans_[i].stamp : tree_.next_vector_++;
    for (VectorSet& set : tree_.sets) {
        std::vector<char> kept(set.count());
        for (std::size_t row = 0; row < set.count(); ++row) kept[row] = set.stamp(row) < tree_.model.actions;
        set.keep(kept);
    }
    std::vector<char> is_pruned(plans_.size());
    for (std::size_t i = 0; i < plans_.size(); ++i) is_pruned[i] = plans_[i].pruned != nullptr;
    tree_.dependencies.clear();
    for (std::size_t i = plans_.size(); i-- > 0;) {
        Plan& plan = plans_[i];
        if (is_blind(plan)) continue;
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
