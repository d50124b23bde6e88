#include "network.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace lcorpp {

constexpr std::size_t min_copied = 64;  // smaller messages are written as they are read

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
        Operand operand{Kind::table, static_cast<int>(i), {}, {}, {}};
        Offset stride = 1;
        const auto& scope = network_->scopes[i];
        for (std::size_t k = scope.size(); k-- > 0;) {
            const int v = scope[k];
            if (is_fixed[v]) {
                operand.observed.emplace_back(observed_index[v], stride);
            } else {
                operand.scope.push_back(v);
                operand.strides.push_back(stride);
            }
            stride *= network_->sizes[v];
        }
        add(std::move(operand));
    }
    for (std::size_t i = 0; i < question_.weighted.size(); ++i) {
        add({Kind::weights, static_cast<int>(i), {question_.weighted[i]}, {1}, {}});
    }
    for (std::size_t i = 0; i < steps_.size(); ++i) {
        Step& step = steps_[i];
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
        step.is_static = true;
        for (const Operand& operand : step.operands) {
            step.is_static &= operand.observed.empty() && operand.kind != Kind::weights &&
                              (operand.kind != Kind::message || steps_[operand.index].is_static);
        }
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
        operand.strides = list_strides(scope);
        steps_[operand.index].scope = scope;
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
