// PRUNE: drop alpha vectors that are useless at all beliefs that an optimal policy may reach.
// Source: Kurniawati, Hsu and Lee, RSS 2008, section III-D (pruning, delta-dominance).

#include <algorithm>
#include <cmath>
#include <utility>

#include "tree.hpp"

namespace lcorpp {

namespace {

// Largest number of beliefs at which nearly best vectors are searched; best vectors are searched at all beliefs.
constexpr std::size_t kMaxSampledBeliefs = 2000;

// A set is never pruned before it has this many vectors more than after its last pruning.
constexpr double kMinGrowth = 100;

}  // namespace

// The nodes that the roots reach by actions that may be optimal: an action whose upper bound is below another's lower
// bound at the same belief is never taken again.
std::vector<Index> Tree::find_reachable(const std::vector<Index>& roots) const {
    std::vector<char> visited(nodes.size(), 0);
    std::vector<Index> queue;
    for (const Index root : roots) {
        if (!visited[as_size(root)]) queue.push_back(root);
        visited[as_size(root)] = 1;
    }
    for (std::size_t i = 0; i < queue.size(); ++i) {
        const Node& node = nodes[as_size(queue[i])];
        const double lower = node.branches[as_size(find_best_lower_action(node))].lower;
        for (const Branch& branch : node.branches) {
            if (branch.upper < lower) continue;
            for (const Child& child : branch.children) {
                if (child.node < 0 || visited[as_size(child.node)]) continue;
                visited[as_size(child.node)] = 1;
                queue.push_back(child.node);
            }
        }
    }
    return queue;
}

void Tree::prune(const std::vector<Index>& roots, double radius, double max_ratio, double growth) {
    const auto has_grown = [&](std::size_t g) {
        return static_cast<double>(sets[g].count()) > growth * static_cast<double>(sizes_after_pruning_[g]) + kMinGrowth;
    };
    bool any_grown = false;
    for (std::size_t g = 0; g < sets.size(); ++g) any_grown = any_grown || has_grown(g);
    sawtooth.compact();
    if (!any_grown) return;
    std::vector<std::vector<Index>> by_group(sets.size());
    for (const Index number : find_reachable(roots)) {
        by_group[as_size(nodes[as_size(number)].group)].push_back(number);
    }
    for (std::size_t g = 0; g < sets.size(); ++g) {
        if (!has_grown(g)) continue;
        if (!by_group[g].empty()) prune_set(static_cast<Index>(g), by_group[g], radius, max_ratio);
        sizes_after_pruning_[g] = sets[g].count();
    }
    dependencies.remove_unneeded(sets);
}

// A vector survives at belief b if the best vector there does not dominate it within a radius around b, that is if
// (best - vector).b < radius |best - vector|. Too small a radius loses vectors that are best between the beliefs and
// stops the search; too large a radius slows it down. At most `max_ratio` times the vectors that are best somewhere
// survive, those with the smallest radius.
void Tree::prune_set(Index group, const std::vector<Index>& nodes_of_group, double radius, double max_ratio) {
    VectorSet& set = sets[as_size(group)];
    const std::size_t count = set.count();
    std::vector<double> min_radius(count, kInfinity);  // by row: the smallest radius with which a vector survives
    std::vector<std::pair<Index, Index>> winners;      // by node: the row that is best there, and the node
    for (const Index i : nodes_of_group) {
        Node& node = nodes[as_size(i)];
        update_best_vector(node);
        winners.emplace_back(set.find(node.best_vector), i);
    }
    const std::size_t step = std::max<std::size_t>(1, nodes_of_group.size() / kMaxSampledBeliefs);
    std::vector<std::pair<Index, Index>> sampled;
    for (std::size_t i = 0; i < winners.size(); i += step) sampled.push_back(winners[i]);
    std::sort(sampled.begin(), sampled.end());  // so that the distances from each row are computed once
    std::vector<double> distance, values;
    Index measured = -1;
    for (const auto& [winner, number] : sampled) {
        const Node& node = nodes[as_size(number)];
        const std::vector<Index> positions = find_positions(node);
        set.values(positions.data(), node.belief.weight.data(), positions.size(), values);
        if (winner != measured) set.distances(as_size(winner), distance);
        measured = winner;
        for (std::size_t row = 0; row < count; ++row) {
            // A duplicate has distance 0: it is dropped unless it is itself a winner.
            const double loss = values[as_size(winner)] - values[row];
            if (distance[row] > 0 && loss < min_radius[row] * distance[row]) min_radius[row] = loss / distance[row];
        }
    }
    std::size_t winner_count = 0;
    for (const auto& [winner, number] : winners) {
        winner_count += min_radius[as_size(winner)] != -1.0;
        min_radius[as_size(winner)] = -1.0;
    }
    // Blind policies depend on themselves and always stay.
    for (std::size_t row = 0; row < count; ++row) {
        if (set.stamp(row) < model.actions) min_radius[row] = -1.0;
    }
    const double limit = std::min(max_ratio * static_cast<double>(winner_count), static_cast<double>(count));
    const auto max_kept = static_cast<std::size_t>(limit);
    std::vector<double> sorted = min_radius;
    if (max_kept < count) {
        std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(max_kept), sorted.end());
        radius = std::min(radius, sorted[max_kept]);
    }
    std::vector<char> kept(count);
    for (std::size_t row = 0; row < count; ++row) kept[row] = min_radius[row] < radius || min_radius[row] == -1.0;
    dependencies.record_pruned_vectors(set, group, kept, kMinGain * max_abs_value);
    set.keep(kept);
}

}  // namespace lcorpp
