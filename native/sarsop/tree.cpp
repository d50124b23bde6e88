#include "tree.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "graph/belief_graph.hpp"
#include "graph/belief_key.hpp"

namespace lcorpp {

namespace {

// A table (A, S) as (S, A).
std::vector<double> transpose(const Model& model, const std::vector<double>& table) {
    const auto states = as_size(model.states), actions = as_size(model.actions);
    std::vector<double> transposed(states * actions);
    for (std::size_t a = 0; a < actions; ++a) {
        for (std::size_t s = 0; s < states; ++s) transposed[s * actions + a] = table[a * states + s];
    }
    return transposed;
}

}  // namespace

Tree::Tree(const Model& model_, const std::vector<double>& informed, const std::vector<double>& blind)
    : model(model_),
      dependencies(model_.actions),
      sawtooth(model_, transpose(model_, informed), model_.members.size() + 1),
      successors_(model_),
      blind_(transpose(model_, blind)),
      all_states_(as_size(model_.states)),
      next_values_(as_size(model_.states), kInfinity) {
    std::iota(all_states_.begin(), all_states_.end(), 0);
    for (const double value : blind) max_abs_value = std::max(max_abs_value, std::abs(value));
    for (const double value : informed) max_abs_value = std::max(max_abs_value, std::abs(value));
    const std::size_t groups = model.members.size() + 1;
    for (std::size_t g = 0; g < groups; ++g) {
        const std::vector<Index>& states = group_states(static_cast<Index>(g));
        sets.emplace_back(states.size());
        if (groups == 2 && g == 1) break;  // with one block, no belief is over several blocks
        for (Index a = 0; a < model.actions; ++a) {
            std::vector<double> values;
            for (const Index s : states) {
                values.push_back(blind[as_size(a) * as_size(model.states) + as_size(s)]);
            }
            const Stamp stamp = a;  // the blind policies have the stamps 0 to A - 1
            sets.back().add(values, a, stamp);
        }
    }
    next_vector_ = model.actions;
    for (const VectorSet& set : sets) sizes_after_pruning_.push_back(set.count());
}

Tree::~Tree() = default;

std::uint64_t Tree::work() const { return work_ + sawtooth.work() + (graph ? graph->work() : 0); }

double Tree::blind_value(const Weights& belief) const {
    double best = -kInfinity;
    for (std::size_t a = 0; a < as_size(model.actions); ++a) {
        double sum = 0.0;
        for (std::size_t i = 0; i < belief.size(); ++i) sum += belief.weight[i] * blind_[as_size(belief.state[i]) * as_size(model.actions) + a];
        best = std::max(best, sum);
    }
    return best;
}

double Tree::best_value_since(Index group, const Index* states, const double* weights, std::size_t n, Stamp since) {
    return find_best_vector(group, states, weights, n, sets[as_size(group)].first_since(since)).value;
}

void Tree::add_vector(Index group, const std::vector<double>& vector, Index action) {
    dependencies.record_imported_vector(next_vector_);
    sets[as_size(group)].add(vector, action, next_vector_++);
}

void Tree::add_point(const Weights& belief, double value) { sawtooth.add(belief, find_group(belief), value); }

std::size_t Tree::vector_count() const {
    std::size_t count = 0;
    for (const VectorSet& set : sets) count += set.count();
    return count;
}

std::size_t Tree::bound_memory() const {
    std::size_t size = dependencies.memory_size() + sawtooth.memory_size();
    for (const VectorSet& set : sets) size += set.memory_size();
    return size;
}

void Tree::clear_nodes() {
    for (const auto& [hash, number] : node_index_) {
        const Stamp stamp = nodes[as_size(number)].point_stamp;
        if (stamp >= 0) known_points_[hash] = stamp;
    }
    nodes.clear();
    node_index_.clear();
    if (graph) graph->clear();
    node_memory_ = 0;
}

Index Tree::find_group(const Weights& belief) const {
    const Index block = model.block[as_size(belief.state[0])];
    for (const Index s : belief.state) {
        if (model.block[as_size(s)] != block) return static_cast<Index>(model.members.size());
    }
    return block;
}

// The positions of the states of a node's belief in its group.
std::vector<Index> Tree::find_positions(const Node& node) const {
    std::vector<Index> positions = node.belief.state;
    if (as_size(node.group) < model.members.size()) {
        for (Index& position : positions) position = model.local[as_size(position)];
    }
    return positions;
}

Best Tree::find_best_vector(Index group, const Index* states, const double* weights, std::size_t n, std::size_t first) {
    const VectorSet& set = sets[as_size(group)];
    if (first >= set.count()) return {-1, -kInfinity};
    work_ += n * (set.count() - first);
    if (as_size(group) == model.members.size()) return set.best(states, weights, n, first);
    positions_.resize(n);
    for (std::size_t i = 0; i < n; ++i) positions_[i] = model.local[as_size(states[i])];
    return set.best(positions_.data(), weights, n, first);
}

Index Tree::find_or_add_node(Weights belief) {
    const std::uint64_t hash = hash_belief(belief.state.data(), belief.weight.data(), belief.size());
    const auto range = node_index_.equal_range(hash);
    for (auto entry = range.first; entry != range.second; ++entry) {
        const Weights& known = nodes[as_size(entry->second)].belief;
        if (same_belief(known.state.data(), known.weight.data(), known.size(), belief.state.data(), belief.weight.data(), belief.size())) {
            return entry->second;
        }
    }
    Node node;
    node.group = find_group(belief);
    node.branches.resize(as_size(model.actions));
    double entropy = 0.0;
    for (const double p : belief.weight) entropy -= p * std::log(p);
    const double max_entropy = std::log(static_cast<double>(model.states));
    node.entropy_bin = std::clamp(static_cast<int>(max_entropy > 0 ? entropy / max_entropy * kPredictorBins : 0), 0, kPredictorBins - 1);
    node.belief = std::move(belief);
    for (Index a = 0; a < model.actions; ++a) {
        Branch& branch = node.branches[as_size(a)];
        for (std::size_t i = 0; i < node.belief.size(); ++i) {
            branch.expected_reward += node.belief.weight[i] * model.reward_of(a, node.belief.state[i]);
        }
        branch.upper = sawtooth.informed_value(node.belief, a);
        node.informed_value = a == 0 ? branch.upper : std::max(node.informed_value, branch.upper);
    }
    const Index number = static_cast<Index>(nodes.size());
    node.sawtooth_value =
        sawtooth.bound(node.belief.state.data(), node.belief.weight.data(), node.belief.size(), node.group, 0);
    node.sawtooth_version = sawtooth.next_stamp();
    node.upper = std::min(node.informed_value, node.sawtooth_value);
    if (const auto known = known_points_.find(hash); known != known_points_.end()) {
        node.point_stamp = known->second;  // so that the next point here replaces it
        known_points_.erase(known);
    }
    node_memory_ += sizeof(Node) + node.belief.size() * (sizeof(Index) + sizeof(double)) + node.branches.size() * sizeof(Branch);
    nodes.push_back(std::move(node));
    node_index_.emplace(hash, number);
    return number;
}

// The children of a node and an action; the reference is valid until the next call. The next beliefs are computed at each
// visit: they take many times the memory of all else, and reading them takes as long.
const Outcomes& Tree::expand(Node& node, Index action) {
    Branch& branch = node.branches[as_size(action)];
    const Outcomes& outcomes = successors_.compute_outcomes(node.belief, action);
    if (!branch.expanded) {
        branch.expanded = true;
        branch.children.resize(outcomes.count());
        node_memory_ += outcomes.count() * sizeof(Child);
        for (std::size_t c = 0; c < outcomes.count(); ++c) {
            branch.children[c].observation = outcomes.observation[c];
            branch.children[c].probability = outcomes.probability[c];
            branch.children[c].group = model.block[as_size(outcomes.states(c)[0])];
        }
    }
    return outcomes;
}

Index Tree::find_or_add_child(Index number, Index action, std::size_t c) {
    Node& node = nodes[as_size(number)];
    Branch& branch = node.branches[as_size(action)];
    if (branch.children[c].node < 0) {
        const Outcomes& outcomes = expand(node, action);
        Weights next;
        next.state.assign(outcomes.states(c), outcomes.states(c) + outcomes.size(c));
        next.weight.assign(outcomes.weights(c), outcomes.weights(c) + outcomes.size(c));
        for (double& weight : next.weight) weight /= outcomes.probability[c];
        branch.children[c].node = find_or_add_node(next);
        // The values of two beliefs differ by at most the largest value times their distance.
        const Weights& known = nodes[as_size(branch.children[c].node)].belief;
        branch.children[c].lipschitz_slack = lipschitz_slack(
            max_abs_value, l1_distance(next.state.data(), next.weight.data(), next.size(), known.state.data(), known.weight.data(), known.size()));
    }
    return branch.children[c].node;
}

}  // namespace lcorpp
