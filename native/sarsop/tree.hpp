// The belief tree and the two bounds its nodes share.
// Source: Kurniawati, Hsu and Lee, "SARSOP", RSS 2008, sections III and IV.
#pragma once

#include <cstdint>
#include <deque>
#include <limits>
#include <memory>
#include <unordered_map>
#include <vector>

#include "alpha_vectors.hpp"
#include "clock.hpp"
#include "dependencies.hpp"
#include "model.hpp"
#include "sawtooth.hpp"

namespace lcorpp {

// Smallest improvement of a bound, relative to Tree::max_abs_value; smaller ones are rounding errors.
constexpr double kMinGain = 1e-11;

// Bins of the value predictor, for the initial upper bound and for the entropy.
constexpr int kPredictorBins = 32;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// An observation after an action. Bounds are those of the next belief times the probability.
struct Child {
    Index observation;
    Index group;                  // block of the next belief
    Index node = -1;              // node of the next belief, -1 before the first visit
    float lipschitz_slack = 0.0f; // largest difference between the values of the next belief and of its node, rounded up
    double probability;
    double lower = -kInfinity, upper = kInfinity;
    Stamp best_vector = -1;  // the vector that gives `lower`
    Index graph_node = -1;  // its node in the belief graph, if it has been found
    float graph_slack = 0.0f;
};

// One action at a belief. Before it is expanded, the informed bound is its upper bound.
struct Branch {
    bool expanded = false, refreshed = false;  // whether the children are known, and their upper bounds computed
    double expected_reward = 0.0;
    double lower = -kInfinity, upper = kInfinity;
    Stamp vectors_version = 0, points_version = 0;  // the bounds include all vectors and points with earlier stamps
    std::vector<Child> children;
};

struct Node {
    Weights belief;
    Index group;
    double lower = -kInfinity, upper = kInfinity;  // the best bounds so far
    std::vector<Branch> branches;                  // by action
    Stamp best_vector = -1;                        // the best vector here
    double lower_value = -kInfinity;               // value of the best vector
    Stamp vectors_version = 0;
    Stamp point_stamp = -1;            // stamp of this belief's point in the upper bound
    double sawtooth_value = kInfinity;  // the upper bound by the points, at its last update
    Stamp sawtooth_version = 0;
    double informed_value = 0.0;  // the initial upper bound
    Index graph_node = -1;
    float graph_slack = 0.0f;
    Index entropy_bin = 0;
};

class BeliefGraph;

class Tree {
    friend class Controller;  // see compression/controller.hpp

  public:
    // informed: (A, S) the fast informed bound: upper bounds on the Q values. blind: (A, S) lower bounds on the values of
    // the blind policies, each of which repeats one action forever. Both in row-major order.
    Tree(const Model& model, const std::vector<double>& informed, const std::vector<double>& blind);
    Tree(const Tree&) = delete;
    ~Tree();
    Tree& operator=(const Tree&) = delete;

    const Model& model;

    // The node of a belief, created if necessary.
    Index find_or_add_node(Weights belief);
    // The node of a child, created if necessary.
    Index find_or_add_child(Index node, Index action, std::size_t child);

    // Update the bounds of a node with the vectors and points since its last visit.
    void refresh(Index node);
    // The best action of a node by its upper or lower bound, after an update of that action's bounds.
    Index select_action(Index node, bool use_lower_bound);

    // Add the best alpha vector at a node and lower the upper bound there (RSS 2008, algorithm 3).
    void backup(Index node);

    // Import bounds of the same model: a vector over the states of a group, a point at a belief.
    void add_vector(Index group, const std::vector<double>& vector, Index action);
    void add_point(const Weights& belief, double value);

    // The bounds at a node, up to date with all vectors and points.
    double lower_bound(Index node);
    double upper_bound(Index node);

    // Keep the vectors that are best, or nearly best, at a belief that the roots reach by actions that may be optimal;
    // see pruning.cpp. A set is pruned only if it has grown enough since its last pruning.
    void prune(const std::vector<Index>& roots, double radius, double max_ratio, double growth);

    // Replace the vectors by those of a finite-state controller with fewer plans, if no lower bound at the roots becomes
    // worse; see compression/controller.hpp. At most about `max_evaluations` vectors are computed. Returns whether it did.
    bool compress(const std::vector<Index>& roots, double max_evaluations, Clock& clock);

    // The number of vectors that were ever made.
    Stamp made_count() const { return next_vector_; }

    // The value of the best blind policy at a belief.
    double blind_value(const Weights& belief) const;
    // The value of the best vector at a belief, of those with a stamp of at least `since`; minus infinity if there is none.
    double best_value_since(Index group, const Index* states, const double* weights, std::size_t n, Stamp since);
    Index find_group(const Weights& belief) const;

    // Whose bounds the upper bounds of children include; may be null.
    std::unique_ptr<BeliefGraph> graph;

    // Numbers of vectors and points that have been read.
    std::uint64_t work() const;

    std::size_t vector_count() const;

    // Memory in bytes: of the nodes, and of the vectors and points.
    std::size_t node_memory() const { return node_memory_; }
    std::size_t bound_memory() const;

    // Remove all nodes, also those of the graph, but keep the vectors and points.
    void clear_nodes();

    // Remove the older half of the points.
    void drop_older_points() { sawtooth.drop_older_half(); }

    const std::vector<Index>& group_states(Index group) const {
        return as_size(group) < model.members.size() ? model.members[as_size(group)]
                                                                      : all_states_;
    }

    std::deque<Node> nodes;       // a deque, so that references stay valid when nodes are added
    std::vector<VectorSet> sets;  // by group
    VectorDependencies dependencies;
    Sawtooth sawtooth;
    double max_abs_value = 1.0;  // largest absolute initial bound, at least 1: the unit of rounding errors

  private:
    const Outcomes& expand(Node& node, Index action);
    std::vector<char> refresh_best_upper(Node& node);
    void refresh_lower(Node& node, Index action);
    void refresh_upper(Node& node, Index action);
    void update_best_vector(Node& node);
    static Index find_best_lower_action(const Node& node);
    static Index find_best_upper_action(const Node& node);
    // A new vector; its edges are appended to `edges`.
    std::vector<double> make_vector(Node& node, Index action, std::vector<Edge>& edges);
    // R(a) + gamma sum over s' and o of T Z value_of(o, s'), over the states of a group.
    template <typename ValueOf>
    std::vector<double> combine(Index group, Index action, ValueOf value_of);
    Best find_best_vector(Index group, const Index* states, const double* weights, std::size_t n, std::size_t first);
    std::vector<Index> find_positions(const Node& node) const;
    std::vector<Index> find_reachable(const std::vector<Index>& roots) const;
    void prune_set(Index group, const std::vector<Index>& nodes_of_group, double radius, double max_ratio);

    Successors successors_;
    std::vector<double> blind_;  // (S, A)
    std::uint64_t work_ = 0;
    Stamp next_vector_ = 0;
    std::unordered_multimap<std::uint64_t, Index> node_index_;  // by hash of the belief
    std::unordered_map<std::uint64_t, Stamp> known_points_;     // by hash of the belief of a removed node
    std::size_t node_memory_ = 0;
    std::vector<Index> all_states_;
    std::vector<std::size_t> sizes_after_pruning_;  // by group: number of vectors after the last pruning
    std::vector<Index> positions_;                  // reusable memory
    std::vector<double> next_values_;               // (S) reusable memory, infinite between calls
    std::vector<Index> reached_;                    // reusable memory, empty between calls
};

template <typename ValueOf>
std::vector<double> Tree::combine(Index group, Index action, ValueOf value_of) {
    const SparseTables& T = model.transition;
    const SparseTables& Z = model.observation;
    const std::vector<Index>& states = group_states(group);
    std::vector<double> vector(states.size());
    for (std::size_t i = 0; i < states.size(); ++i) {
        double sum = 0.0;
        for (std::size_t j = T.begin(action, states[i]); j < T.end(action, states[i]); ++j) {
            double& next_value = next_values_[as_size(T.column[j])];
            if (next_value == kInfinity) {
                reached_.push_back(T.column[j]);
                next_value = 0.0;
                for (std::size_t k = Z.begin(action, T.column[j]); k < Z.end(action, T.column[j]); ++k) {
                    next_value += Z.value[k] * value_of(Z.column[k], T.column[j]);
                }
            }
            sum += T.value[j] * next_value;
        }
        vector[i] = model.reward_of(action, states[i]) + model.discount * sum;
    }
    for (const Index next : reached_) next_values_[as_size(next)] = kInfinity;
    reached_.clear();
    return vector;
}

}  // namespace lcorpp
