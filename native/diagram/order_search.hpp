// Search for an order of the steps of a decision diagram in which states have few bits.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

namespace lcorpp {

// What later steps need to know of earlier ones, as in transitions/rule_templates.py.
struct StepGraph {
    // The bodies of rules of a child with the same head. Whether one is satisfied is a bit until the child is decided.
    // Constraints have no child (-1); rules of recursions are in `recursions`.
    struct Group {
        int child;
        std::vector<std::vector<int>> bodies;  // the steps that decide the literals of each body
    };
    // A rule of a recursion: the head follows from the body once the inputs are decided. Guesses are claims about an atom.
    struct Edge {
        std::vector<int> inputs;
        int body, head;  // atoms, -1 for none
    };

    std::vector<double> bits;                // of the outcomes of each step
    std::vector<std::vector<int>> needs;     // step -> the steps that must come before it
    std::vector<Group> groups;
    std::vector<std::vector<Edge>> recursions;
};

constexpr double max_temperature = 1.5, min_temperature = 0.03;  // in bits
constexpr std::size_t n_rounds = 4;

class OrderSearch {
  public:
    explicit OrderSearch(StepGraph graph);

    // Estimate the number of states of all steps, as a logarithm to base 2.
    double estimate(const std::vector<int>& order);

    // Improve an order by rounds of simulated annealing, each from the best order so far and colder; return its estimate.
    // `check` is called from time to time, and may throw.
    template <typename Check>
    double improve(std::vector<int>& order, std::size_t n_moves, Check& check);

    // The work of one estimate: the steps and literals that it visits.
    std::size_t size() const { return size_; }

  private:
    struct Child;
    struct Recursion;
    double estimate_at(const std::vector<int>& position);
    void add_child(const Child& child, const std::vector<int>& position);
    void add_relation(const Recursion& recursion, const std::vector<int>& position);
    void add(int start, int end, double weight) {
        if (start >= end) return;
        change_[static_cast<std::size_t>(start)] += weight;
        change_[static_cast<std::size_t>(end)] -= weight;
    }
    std::uint64_t draw(std::uint64_t bound) {  // xorshift
        random_ ^= random_ << 13;
        random_ ^= random_ >> 7;
        random_ ^= random_ << 17;
        return random_ % bound;
    }
    double draw_share() { return static_cast<double>(draw(1ULL << 40)) / static_cast<double>(1ULL << 40); }
    int choose_target(const std::vector<int>& position, int step, int low, int high);

    // Groups and edges, one after the other; `at_` is the first of each body in `steps_`, with the end.
    struct FlatGroup {
        int first_body, last_body;
    };
    struct Child {  // a constraint is a child of its own
        int step;
        std::vector<int> parents;  // the steps of all bodies
        std::vector<FlatGroup> groups;
    };
    struct FlatEdge {
        int first_step, last_step, body, head;
    };
    struct Recursion {
        std::vector<FlatEdge> edges;
        std::size_t n_atoms = 0;
        double relation = 0.0, both = 0.0;  // factors of the bits of the relation of atoms, see `add_relation`
    };

    StepGraph graph_;
    std::size_t n_, size_ = 1;
    std::vector<Child> children_;
    std::vector<int> at_, steps_;
    std::vector<Recursion> recursions_;
    std::vector<std::vector<int>> users_;       // step -> those that need it
    std::vector<std::vector<int>> neighbours_;  // step -> those with which it shares a body or a child
    std::vector<double> change_;                // bits that begin less those that end after each step
    std::vector<double> bits_;                  // of the states after each step
    std::vector<std::vector<int>> ends_;        // step -> ends of the bits that depend on it alone
    // atom -> the first step that decides a rule about it, the last with it as head, as body; and counts of atoms by step
    std::vector<int> first_, last_head_, last_body_, heads_, bodies_, both_;
    std::vector<int> rank_;                     // step -> its place among the parents of a child
    std::vector<std::pair<int, int>> ranked_;   // the positions of the parents of a child, sorted, and the parents
    std::vector<int> counts_;                   // bits of a child that begin less those that end, by rank
    std::uint64_t random_ = 88172645463325252ULL;
};

template <typename Check>
double OrderSearch::improve(std::vector<int>& order, std::size_t n_moves, Check& check) {
    std::vector<int> position(n_);
    const auto place = [&](const std::vector<int>& steps) {
        for (std::size_t i = 0; i < steps.size(); ++i) position[static_cast<std::size_t>(steps[i])] = static_cast<int>(i);
    };
    std::vector<int> current = order;
    place(current);
    if (n_ == 0) return 0.0;
    double cost = estimate_at(position), best = cost, temperature = 0.0, cooling = 1.0, hot = max_temperature;
    const std::size_t n_round = n_moves / n_rounds + 1;
    for (std::size_t move = 0; move < n_moves; ++move, temperature *= cooling) {
        check(size_);
        if (move % n_round == 0) {
            temperature = hot;
            cooling = std::pow(min_temperature / hot, 1.0 / static_cast<double>(n_round));
            hot /= 2.0;
            current = order;
            place(current);
            cost = best;
        }
        const int step = static_cast<int>(draw(n_));
        int low = 0, high = static_cast<int>(n_) - 1;
        for (const int need : graph_.needs[static_cast<std::size_t>(step)]) low = std::max(low, position[static_cast<std::size_t>(need)] + 1);
        for (const int user : users_[static_cast<std::size_t>(step)]) high = std::min(high, position[static_cast<std::size_t>(user)] - 1);
        const int from = position[static_cast<std::size_t>(step)];
        const int to = low < high ? choose_target(position, step, low, high) : from;
        if (to == from) continue;
        const auto shift = [&](int source, int target) {
            const auto begin = current.begin();
            if (source < target) {
                std::rotate(begin + source, begin + source + 1, begin + target + 1);
            } else {
                std::rotate(begin + target, begin + source, begin + source + 1);
            }
            for (int i = std::min(source, target); i <= std::max(source, target); ++i) {
                position[static_cast<std::size_t>(current[static_cast<std::size_t>(i)])] = i;
            }
        };
        shift(from, to);
        const double changed = estimate_at(position);
        if (changed <= cost || draw_share() < std::exp((cost - changed) / temperature)) {
            cost = changed;
            if (cost < best) {
                best = cost;
                order = current;
            }
        } else {
            shift(to, from);
        }
    }
    return best;
}

}  // namespace lcorpp
