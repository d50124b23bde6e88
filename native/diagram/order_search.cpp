#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <set>
#include <stdexcept>
#include <tuple>

#include "order_search.hpp"

namespace lcorpp {

namespace {

constexpr std::size_t max_connected = 20;  // steps of larger bodies are no neighbours

}  // namespace

OrderSearch::OrderSearch(StepGraph graph)
    : graph_(std::move(graph)), n_(graph_.bits.size()), users_(n_), neighbours_(n_), change_(n_ + 1), bits_(n_), ends_(n_), rank_(n_) {
    const auto check = [&](int step) {
        if (step < 0 || static_cast<std::size_t>(step) >= n_) throw std::invalid_argument("a step out of range");
    };
    if (graph_.needs.size() != n_) throw std::invalid_argument("needs of a wrong length");
    for (std::size_t step = 0; step < n_; ++step) {
        for (const int need : graph_.needs[step]) {
            check(need);
            users_[static_cast<std::size_t>(need)].push_back(static_cast<int>(step));
        }
    }
    const auto connect = [&](std::vector<int> steps) {
        for (const int a : steps) {
            for (const int b : steps) {
                if (a != b) neighbours_[static_cast<std::size_t>(a)].push_back(b);
            }
        }
    };
    at_.push_back(0);
    std::vector<int> child_of(n_, -1);
    for (const auto& group : graph_.groups) {
        if (group.child >= 0) check(group.child);
        int* number = group.child >= 0 ? &child_of[static_cast<std::size_t>(group.child)] : nullptr;
        if (number == nullptr || *number < 0) {
            children_.push_back({group.child, {}, {}});
            if (number != nullptr) *number = static_cast<int>(children_.size()) - 1;
        }
        Child& child = number == nullptr ? children_.back() : children_[static_cast<std::size_t>(*number)];
        const auto first_body = static_cast<int>(at_.size()) - 1;
        for (const auto& body : group.bodies) {
            if (body.empty()) throw std::invalid_argument("a body without steps");
            for (const int step : body) check(step);
            steps_.insert(steps_.end(), body.begin(), body.end());
            at_.push_back(static_cast<int>(steps_.size()));
            child.parents.insert(child.parents.end(), body.begin(), body.end());
        }
        child.groups.push_back({first_body, static_cast<int>(at_.size()) - 1});
    }
    for (Child& child : children_) {
        std::sort(child.parents.begin(), child.parents.end());
        child.parents.erase(std::unique(child.parents.begin(), child.parents.end()), child.parents.end());
        std::vector<int> all = child.parents;
        if (child.step >= 0) all.push_back(child.step);
        if (all.size() <= max_connected) connect(std::move(all));
    }
    for (const auto& edges : graph_.recursions) {
        Recursion recursion;
        std::vector<std::vector<int>> inputs_of;  // atom -> the inputs of its rules
        std::set<std::tuple<int, int, std::vector<int>>> known;
        for (const auto& edge : edges) known.emplace(edge.body, edge.head, edge.inputs);
        std::size_t n_both = 0, n_symmetric = 0;
        for (const auto& edge : edges) {
            const auto first_step = static_cast<int>(steps_.size());
            for (const int step : edge.inputs) check(step);
            steps_.insert(steps_.end(), edge.inputs.begin(), edge.inputs.end());
            recursion.edges.push_back({first_step, static_cast<int>(steps_.size()), edge.body, edge.head});
            for (const int atom : {edge.body, edge.head}) {
                if (atom < 0) continue;
                recursion.n_atoms = std::max(recursion.n_atoms, static_cast<std::size_t>(atom) + 1);
                inputs_of.resize(recursion.n_atoms);
                auto& own = inputs_of[static_cast<std::size_t>(atom)];
                own.insert(own.end(), edge.inputs.begin(), edge.inputs.end());
            }
            if (edge.body < 0 || edge.head < 0) continue;
            ++n_both;
            n_symmetric += known.count({edge.head, edge.body, edge.inputs});
        }
        for (auto& own : inputs_of) {
            if (own.size() <= max_connected) connect(own);
        }
        // Of k atoms, some of them true, there are about 2^(.42 k^2 + .5 k) transitive relations, and, where all implications
        // have their converse, 2^(.085 k^2 + 1.12 k) equivalences: fitted to their numbers for k from 1 to 6, sums of
        // binomial coefficients times OEIS A000798, and the Bell numbers of k + 1.
        const double share = n_both ? static_cast<double>(n_symmetric) / static_cast<double>(n_both) : 0.0;
        recursion.relation = 0.42 - 0.335 * share;
        recursion.both = 0.5 + 0.62 * share;
        recursions_.push_back(std::move(recursion));
    }
    size_ += steps_.size();
}

double OrderSearch::estimate(const std::vector<int>& order) {
    if (order.size() != n_) throw std::invalid_argument("an order of a wrong length");
    std::vector<int> position(n_, -1);
    for (std::size_t i = 0; i < n_; ++i) {
        if (order[i] < 0 || static_cast<std::size_t>(order[i]) >= n_ || position[static_cast<std::size_t>(order[i])] >= 0) {
            throw std::invalid_argument("not an order");
        }
        position[static_cast<std::size_t>(order[i])] = static_cast<int>(i);
    }
    for (std::size_t step = 0; step < n_; ++step) {
        for (const int need : graph_.needs[step]) {
            if (position[static_cast<std::size_t>(need)] > position[step]) throw std::invalid_argument("an order that is not topological");
        }
    }
    return estimate_at(position);
}

double OrderSearch::estimate_at(const std::vector<int>& position) {
    if (n_ == 0) return 0.0;
    std::fill(change_.begin(), change_.end(), 0.0);
    for (auto& own : ends_) own.clear();
    const auto at = [&](int step) { return position[static_cast<std::size_t>(step)]; };
    for (const Child& child : children_) add_child(child, position);
    for (std::size_t step = 0; step < n_; ++step) {
        // bits that depend on one step distinguish at most its outcomes
        auto& ends = ends_[step];
        double rest = graph_.bits[step];
        if (rest == 1.0 && !ends.empty()) {
            add(position[step], *std::max_element(ends.begin(), ends.end()), 1.0);
            continue;
        }
        if (static_cast<double>(ends.size()) > rest) std::sort(ends.begin(), ends.end(), std::greater<int>());
        for (const int end : ends) {
            if (rest <= 0.0) break;
            add(position[step], end, std::min(rest, 1.0));
            rest -= 1.0;
        }
    }
    for (const Recursion& recursion : recursions_) {
        for (const FlatEdge& edge : recursion.edges) {
            int start = std::numeric_limits<int>::max(), end = -1;
            for (int k = edge.first_step; k < edge.last_step; ++k) {
                const int own = at(steps_[static_cast<std::size_t>(k)]);
                start = std::min(start, own);
                end = std::max(end, own);
            }
            add(start, end, 1.0);
        }
    }
    double total = 0.0;
    for (std::size_t i = 0; i < n_; ++i) bits_[i] = total += change_[i];
    for (const Recursion& recursion : recursions_) add_relation(recursion, position);
    std::fill(change_.begin(), change_.end(), 0.0);
    for (std::size_t step = 0; step < n_; ++step) change_[static_cast<std::size_t>(position[step])] = graph_.bits[step];
    double outcomes = 0.0;  // states distinguish at most the outcomes of the steps so far
    for (std::size_t i = 0; i < n_; ++i) bits_[i] = std::min(bits_[i], outcomes += change_[i]);
    const double largest = *std::max_element(bits_.begin(), bits_.end());
    double sum = 0.0;
    for (const double own : bits_) sum += std::exp2(own - largest);
    return largest + std::log2(sum);
}

// Add the bits about the bodies of a child. A bit that depends on one parent alone is left to that parent, as those of
// several children may distinguish the same outcomes; all others distinguish at most the outcomes of the parents so far.
void OrderSearch::add_child(const Child& child, const std::vector<int>& position) {
    const int n_parents = static_cast<int>(child.parents.size());
    ranked_.clear();
    for (const int step : child.parents) ranked_.emplace_back(position[static_cast<std::size_t>(step)], step);
    std::sort(ranked_.begin(), ranked_.end());
    for (int rank = 0; rank < n_parents; ++rank) rank_[static_cast<std::size_t>(ranked_[static_cast<std::size_t>(rank)].second)] = rank;
    counts_.assign(static_cast<std::size_t>(n_parents) + 1, 0);
    const int decided = child.step >= 0 ? position[static_cast<std::size_t>(child.step)] : -1;
    const auto count = [&](int first, int last) {
        if (first >= last) return;
        ++counts_[static_cast<std::size_t>(first)];
        --counts_[static_cast<std::size_t>(last)];
    };
    const auto leave_to = [&](int rank, int last) {  // until the parent of the last rank, or the child, is decided
        const int end = last < n_parents ? ranked_[static_cast<std::size_t>(last)].first : decided;
        ends_[static_cast<std::size_t>(ranked_[static_cast<std::size_t>(rank)].second)].push_back(end);
    };
    for (const FlatGroup& group : child.groups) {
        int first = n_parents, second = n_parents, single = -1;  // the ranks at which the first two bodies are decided
        for (int body = group.first_body; body < group.last_body; ++body) {
            const int begin = at_[static_cast<std::size_t>(body)], stop = at_[static_cast<std::size_t>(body) + 1];
            int start = n_parents, next = n_parents, end = -1;
            for (int k = begin; k < stop; ++k) {
                const int own = rank_[static_cast<std::size_t>(steps_[static_cast<std::size_t>(k)])];
                end = std::max(end, own);
                if (own < start) {
                    next = start;
                    start = own;
                } else {
                    next = std::min(next, own);
                }
            }
            if (stop > begin + 1) {  // partly decided: it depends on one parent, then on several
                leave_to(start, next);
                count(next, end);
            }
            if (end < first) {
                second = first;
                first = end;
                single = stop == begin + 1 ? start : -1;
            } else {
                second = std::min(second, end);
            }
        }
        if (child.step < 0) continue;
        if (single >= 0) {
            leave_to(single, second);
            first = second;
        }
        count(first, n_parents);
    }
    double outcomes = 0.0;
    int total = 0;
    for (int rank = 0; rank < n_parents; ++rank) {
        const auto [start, step] = ranked_[static_cast<std::size_t>(rank)];
        outcomes += graph_.bits[static_cast<std::size_t>(step)];
        total += counts_[static_cast<std::size_t>(rank)];
        if (total == 0) continue;
        const int end = rank + 1 < n_parents ? ranked_[static_cast<std::size_t>(rank) + 1].first : decided;
        add(start, end, std::min(outcomes, static_cast<double>(total)));
    }
}

// Add the bits of the implications between the atoms of a recursion: those that undecided rules may make true (heads),
// and those that undecided rules or guesses still use (bodies).
void OrderSearch::add_relation(const Recursion& recursion, const std::vector<int>& position) {
    first_.assign(recursion.n_atoms, static_cast<int>(n_));
    last_head_.assign(recursion.n_atoms, -1);
    last_body_.assign(recursion.n_atoms, -1);
    for (const FlatEdge& edge : recursion.edges) {
        if (edge.first_step == edge.last_step) continue;  // a rule without inputs holds always
        int end = 0;
        for (int k = edge.first_step; k < edge.last_step; ++k) {
            end = std::max(end, position[static_cast<std::size_t>(steps_[static_cast<std::size_t>(k)])]);
        }
        if (edge.head >= 0) {
            const auto atom = static_cast<std::size_t>(edge.head);
            first_[atom] = std::min(first_[atom], end);
            last_head_[atom] = std::max(last_head_[atom], end);
        }
        if (edge.body >= 0) {
            const auto atom = static_cast<std::size_t>(edge.body);
            first_[atom] = std::min(first_[atom], end);
            last_body_[atom] = std::max(last_body_[atom], end);
        }
    }
    for (auto* counts : {&heads_, &bodies_, &both_}) counts->assign(n_ + 1, 0);
    for (std::size_t atom = 0; atom < recursion.n_atoms; ++atom) {
        const auto count = [&](std::vector<int>& counts, int end) {
            if (first_[atom] >= end) return;
            ++counts[static_cast<std::size_t>(first_[atom])];
            --counts[static_cast<std::size_t>(end)];
        };
        count(heads_, last_head_[atom]);
        count(bodies_, last_body_[atom]);
        count(both_, std::min(last_head_[atom], last_body_[atom]));
    }
    int heads = 0, bodies = 0, both = 0;
    for (std::size_t i = 0; i < n_; ++i) {
        heads += heads_[i];
        bodies += bodies_[i];
        both += both_[i];
        bits_[i] += recursion.relation * heads * bodies + recursion.both * both + (bodies - both);
    }
}

int OrderSearch::choose_target(const std::vector<int>& position, int step, int low, int high) {
    const auto& near = neighbours_[static_cast<std::size_t>(step)];
    if (!near.empty() && draw(2)) {
        const int other = position[static_cast<std::size_t>(near[draw(near.size())])];
        const int target = other + static_cast<int>(draw(3)) - 1;
        return std::clamp(target, low, high);
    }
    return low + static_cast<int>(draw(static_cast<std::uint64_t>(high - low + 1)));
}

}  // namespace lcorpp
