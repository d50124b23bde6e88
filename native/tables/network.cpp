#include "network.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace lcorpp {

constexpr std::size_t min_copied = 64;  // smaller messages are written as they are read
// Steps are computed for all values of the observed variables that they read, if there are few or the work is small.
constexpr double max_open_values = 64.0;
constexpr double max_small_work = 2e4;  // multiplications
constexpr double max_step_work = 2e7;
constexpr double max_open_work = 4e7;  // of all these steps, some 50 ms

Plan::Plan(std::shared_ptr<const Network> network, Question question)
    : network_(std::move(network)), question_(std::move(question)) {
    const std::size_t n = network_->sizes.size();
    for (const int v : question_.weighted) {
        weight_offsets_.push_back(static_cast<Offset>(n_weights_));
        n_weights_ += static_cast<std::size_t>(network_->sizes[v]);
    }
    std::vector<bool> is_fixed(n, false), is_kept(n, false);
    for (const int v : question_.observed) is_fixed[v] = true;
    for (const int v : question_.kept) is_kept[v] = true;
    const std::vector<bool> needed = find_needed(is_fixed);
    std::vector<std::vector<int>> scopes;
    for (std::size_t i = 0; i < needed.size(); ++i) {
        if (!needed[i]) continue;
        tables_.push_back(static_cast<int>(i));
        scopes.emplace_back();
        for (const int v : network_->scopes[i]) {
            if (!is_fixed[v]) scopes.back().push_back(v);
        }
    }
    if (!question_.kept.empty()) scopes.push_back(question_.kept);  // they meet in the last step
    const EliminationOrder order = find_order(network_->sizes, scopes, is_kept);
    cost_ = order.cost;
    width_ = order.width;
    order_ = order.variables;
    if (cost_ >= max_cost) {  // no steps: it is refused
        memory_ = 8.0 * std::exp2(width_);
        return;
    }

    // the operands of the first variable of their scope that is eliminated
    std::vector<int> position(n, static_cast<int>(order.variables.size()));
    for (std::size_t i = 0; i < order.variables.size(); ++i) position[order.variables[i]] = static_cast<int>(i);
    std::vector<int> observed_index(n, -1);
    for (std::size_t i = 0; i < question_.observed.size(); ++i) observed_index[question_.observed[i]] = static_cast<int>(i);
    steps_.resize(order.variables.size() + 1);
    for (std::size_t i = 0; i < order.variables.size(); ++i) steps_[i].variable = order.variables[i];
    steps_.back().variable = -1;
    const auto add = [&](Operand operand) {
        int first = static_cast<int>(order.variables.size());
        for (const int v : operand.scope) first = std::min(first, position[v]);
        steps_[first].operands.push_back(std::move(operand));
    };
    for (std::size_t i = 0; i < needed.size(); ++i) {
        if (!needed[i]) continue;
        const auto& scope = network_->scopes[i];
        Operand operand{Kind::table, static_cast<int>(i), scope, list_strides(scope), {}};
        add(std::move(operand));
    }
    for (std::size_t i = 0; i < question_.weighted.size(); ++i) {
        add({Kind::weights, static_cast<int>(i), {question_.weighted[i]}, {1}, {}});
    }
    double open_work = question_.marginals ? 0.0 : max_open_work;
    for (std::size_t i = 0; i < steps_.size(); ++i) {
        Step& step = steps_[i];
        step.is_static = std::none_of(step.operands.begin(), step.operands.end(), [&](const Operand& operand) {
            return operand.kind == Kind::weights || (operand.kind == Kind::message && !steps_[operand.index].is_static);
        });
        if (!(step.is_static && can_open(step, is_fixed, open_work))) fix_observed(step, observed_index);
        if (step.variable < 0) {
            step.scope = question_.kept;
        } else {
            for (const Operand& operand : step.operands) {
                for (const int v : operand.scope) {
                    if (v != step.variable) step.scope.push_back(v);
                }
            }
            std::sort(step.scope.begin(), step.scope.end());
            step.scope.erase(std::unique(step.scope.begin(), step.scope.end()), step.scope.end());
        }
        double size = 8.0;  // bytes; as floating point, as it may be too large for memory and integers
        step.size = 1;
        for (const int v : step.scope) {
            size *= network_->sizes[v];
            step.size *= static_cast<std::size_t>(network_->sizes[v]);
        }
        memory_ += size;
        if (step.variable >= 0) add({Kind::message, static_cast<int>(i), step.scope, {}, {}});
    }
    std::vector<Use> uses(n);
    for (std::size_t i = steps_.size(); i-- > 0;) arrange_messages(steps_[i], uses);
    std::size_t largest_copy = 0;
    for (Step& step : steps_) {
        arrange_loops(step);
        if (step.is_copied) largest_copy = std::max(largest_copy, step.size);
    }
    memory_ += 8.0 * static_cast<double>(largest_copy);
    if (question_.marginals) {
        result_size_ = std::accumulate(network_->sizes.begin(), network_->sizes.end(), std::size_t{0});
        memory_ *= 2.0;
        cost_ = 0.0;
        for (const Step& step : steps_) {  // each message and each derivative is a sum over the clique
            double clique = static_cast<double>(step.size);
            if (step.variable >= 0) clique *= network_->sizes[step.variable];
            cost_ += clique * (2.0 + static_cast<double>(std::count_if(
                                         step.operands.begin(), step.operands.end(),
                                         [](const Operand& operand) { return operand.kind == Kind::message; })));
        }
    } else {
        result_size_ = steps_.back().size;
    }
}

// Whether a step can be computed for all values of its observed variables at once, so that new evidence does not repeat it;
// the work is taken from what is left for such steps.
bool Plan::can_open(const Step& step, const std::vector<bool>& is_fixed, double& open_work) const {
    std::vector<int> all;
    bool has_observed = false;
    double n_values = 1.0;  // of the observed variables together
    for (const Operand& operand : step.operands) {
        for (const int v : operand.scope) {
            if (std::find(all.begin(), all.end(), v) != all.end()) continue;
            all.push_back(v);
            has_observed |= is_fixed[v];
            if (is_fixed[v]) n_values *= network_->sizes[v];
        }
    }
    if (!has_observed) return true;
    double work = static_cast<double>(step.operands.size());
    for (const int v : all) work *= network_->sizes[v];
    const double limit = std::min(open_work, n_values > max_open_values ? max_small_work : max_step_work);
    if (step.variable < 0 || work > limit) return false;
    open_work -= work;
    return true;
}

// Let a step read its operands at the observed values only, once for each evidence.
void Plan::fix_observed(Step& step, const std::vector<int>& observed_index) const {
    for (Operand& operand : step.operands) {
        std::size_t n_free = 0;
        for (std::size_t k = 0; k < operand.scope.size(); ++k) {
            const int v = operand.scope[k];
            const Offset stride = operand.strides.empty() ? 0 : operand.strides[k];  // those of messages follow later
            if (observed_index[v] >= 0) {
                step.is_static = false;
                operand.observed.emplace_back(observed_index[v], stride);
                continue;
            }
            operand.scope[n_free] = v;
            if (!operand.strides.empty()) operand.strides[n_free] = stride;
            ++n_free;
        }
        operand.scope.resize(n_free);
        if (!operand.strides.empty()) operand.strides.resize(n_free);
    }
}

// Arrange the messages that a step reads in memory: variables that the same operands have are next to each other, those of
// one operand alone last and in the order of the step's own message, so that loops run over memory without jumps.
void Plan::arrange_messages(Step& step, std::vector<Use>& uses) {
    if (step.variable >= 0) uses[static_cast<std::size_t>(step.variable)] = {};
    for (std::size_t k = 0; k < step.scope.size(); ++k) {
        uses[static_cast<std::size_t>(step.scope[k])] = {0, 0, static_cast<int>(k)};
    }
    for (std::size_t i = 0; i < step.operands.size(); ++i) {
        for (const int v : step.operands[i].scope) {
            Use& use = uses[static_cast<std::size_t>(v)];
            ++use.users;
            use.signature |= 1ULL << (i % 64);
        }
    }
    for (Operand& operand : step.operands) {
        if (operand.kind != Kind::message) continue;
        std::vector<int>& scope = operand.scope;
        std::sort(scope.begin(), scope.end(), [&](int a, int b) {
            if ((a == step.variable) != (b == step.variable)) return a == step.variable;
            const Use &one = uses[static_cast<std::size_t>(a)], &other = uses[static_cast<std::size_t>(b)];
            if (one.users != other.users) return one.users > other.users;
            if (one.signature != other.signature) return one.signature < other.signature;
            return one.place < other.place;
        });
        std::vector<int>& own = steps_[operand.index].scope;  // first the observed variables, whose values are chosen
        own.clear();
        for (const auto& [k, stride] : operand.observed) own.push_back(question_.observed[static_cast<std::size_t>(k)]);
        own.insert(own.end(), scope.begin(), scope.end());
        std::vector<Offset> strides = list_strides(own);
        for (std::size_t k = 0; k < operand.observed.size(); ++k) operand.observed[k].second = strides[k];
        operand.strides.assign(strides.begin() + static_cast<Offset>(operand.observed.size()), strides.end());
    }
}

// Choose the loops of a step: over the entries of its message as it is read, or in the order of its largest operand, where
// what that operand alone has is last; then the message is reordered afterwards.
void Plan::arrange_loops(Step& step) {
    std::vector<const Operand*> all;
    const Operand* largest = nullptr;
    double most = 0.0;
    for (const Operand& operand : step.operands) {
        all.push_back(&operand);
        double size = 1.0;
        for (const int v : operand.scope) size *= network_->sizes[v];
        if (size > most) {
            most = size;
            largest = &operand;
        }
    }
    step.nest = make_nest<double>(step, step.scope, all);
    if (step.size < min_copied || step.variable < 0) return;
    std::vector<std::pair<Offset, int>> order;  // by the strides of the largest operand, of which others come first
    for (const int v : step.scope) {
        const auto at = std::find(largest->scope.begin(), largest->scope.end(), v);
        const bool has = at != largest->scope.end();
        order.emplace_back(has ? -largest->strides[static_cast<std::size_t>(at - largest->scope.begin())] : 0, v);
        if (!has) order.back().first = std::numeric_limits<Offset>::min();
    }
    std::stable_sort(order.begin(), order.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    std::vector<int> written;
    for (const auto& [stride, v] : order) written.push_back(v);
    if (written == step.scope) return;
    LoopNest<double> nest = make_nest<double>(step, written, all);
    std::vector<Offset> sizes, out_strides = list_strides(step.scope), own = list_strides(written), strides;
    for (const int v : step.scope) {
        sizes.push_back(network_->sizes[v]);
        strides.push_back(own[static_cast<std::size_t>(std::find(written.begin(), written.end(), v) - written.begin())]);
    }
    Reorder copy(sizes, out_strides, strides);
    if (nest.estimate() + copy.estimate() >= step.nest.estimate()) return;
    step.nest = std::move(nest);
    step.copy = std::move(copy);
    step.is_copied = true;
}

// The distance in memory between entries of a table that differ by one in a variable, for each variable of its scope.
std::vector<Offset> Plan::list_strides(const std::vector<int>& scope) const {
    std::vector<Offset> strides(scope.size());
    Offset stride = 1;
    for (std::size_t k = scope.size(); k-- > 0;) {
        strides[k] = stride;
        stride *= network_->sizes[scope[k]];
    }
    return strides;
}

// The tables without those of variables on which neither the question nor evidence nor another table depends.
std::vector<bool> Plan::find_needed(const std::vector<bool>& is_fixed) const {
    const std::size_t n_tables = network_->scopes.size();
    std::vector<bool> needed(n_tables, true);
    if (question_.marginals) return needed;
    std::vector<bool> is_read = is_fixed;
    for (const int v : question_.kept) is_read[v] = true;
    for (const int v : question_.weighted) is_read[v] = true;
    std::vector<int> users(network_->sizes.size(), 0), table_of(network_->sizes.size(), -1);
    for (std::size_t i = 0; i < n_tables; ++i) {
        for (const int v : network_->scopes[i]) ++users[v];
        if (network_->children[i] >= 0) table_of[network_->children[i]] = static_cast<int>(i);
    }
    std::vector<int> barren;
    for (std::size_t v = 0; v < users.size(); ++v) {
        if (users[v] == 1 && table_of[v] >= 0 && !is_read[v]) barren.push_back(static_cast<int>(v));
    }
    while (!barren.empty()) {
        const int v = barren.back();
        barren.pop_back();
        needed[table_of[v]] = false;
        for (const int u : network_->scopes[table_of[v]]) {
            if (--users[u] == 1 && u != v && table_of[u] >= 0 && needed[table_of[u]] && !is_read[u]) barren.push_back(u);
        }
    }
    return needed;
}

}  // namespace lcorpp
