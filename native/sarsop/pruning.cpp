// PRUNE: vectors that serve no belief which an optimal policy may reach.
// Source: Kurniawati, Hsu and Lee, RSS 2008, section III-D (pruning, delta-dominance).

#include <algorithm>
#include <cmath>

#include "tree.hpp"

namespace lcorpp {

namespace {

// Beliefs that are looked at for vectors that are nearly the best; all are looked at for the best.
constexpr std::size_t kLooked = 2000;

// So many vectors more are never too many.
constexpr double kFew = 100;

}  // namespace

// The nodes that the roots reach by actions that may still be optimal: one whose upper bound is below another's
// lower bound at the same belief is never taken again.
std::vector<Index> Tree::reachable(const std::vector<Index>& roots) const {
    std::vector<char> met(nodes.size(), 0);
    std::vector<Index> found;
    for (const Index root : roots) {
        if (!met[static_cast<std::size_t>(root)]) found.push_back(root);
        met[static_cast<std::size_t>(root)] = 1;
    }
    for (std::size_t i = 0; i < found.size(); ++i) {
        const Index number = found[i];
        const Node& node = nodes[static_cast<std::size_t>(number)];
        const double low = node.branches[static_cast<std::size_t>(best_lower_action(number))].lower;
        for (const Branch& branch : node.branches) {
            if (branch.upper < low) continue;
            for (const Child& child : branch.children) {
                if (child.link < 0 || met[static_cast<std::size_t>(child.link)]) continue;
                met[static_cast<std::size_t>(child.link)] = 1;
                found.push_back(child.link);
            }
        }
    }
    return found;
}

void Tree::prune(const std::vector<Index>& roots, double delta, double cap, double growth) {
    bool grown = false;
    for (std::size_t g = 0; g < sets.size(); ++g) {
        grown = grown || static_cast<double>(sets[g].count()) > growth * static_cast<double>(kept_[g]) + kFew;
    }
    sawtooth.compact();
    if (!grown) return;
    std::vector<std::vector<Index>> at(sets.size());
    for (const Index number : reachable(roots)) at[static_cast<std::size_t>(nodes[static_cast<std::size_t>(number)].group)].push_back(number);
    for (std::size_t g = 0; g < sets.size(); ++g) {
        if (static_cast<double>(sets[g].count()) <= growth * static_cast<double>(kept_[g]) + kFew) continue;
        if (!at[g].empty()) prune_set(static_cast<Index>(g), at[g], delta, cap);
        kept_[g] = sets[g].count();
    }
    origins.collect(sets);
}

// A vector survives at belief b when the best vector there does not beat it in all of b's neighbourhood of
// radius delta, that is when (best - vector).b < delta |best - vector|. Too tight a rule freezes the search, for
// vectors that would be best between the beliefs are lost; too loose a one slows it. At most `cap` times the
// vectors that are best somewhere are kept, the nearest ones.
void Tree::prune_set(Index group, const std::vector<Index>& at, double delta, double cap) {
    VectorSet& set = sets[static_cast<std::size_t>(group)];
    const std::size_t count = set.count();
    std::vector<double> radius(count, kInfinity);  // the least delta with which a vector survives
    std::vector<Index> winner;                     // their numbers, by row
    std::vector<Index> number(count, -1);
    for (const Index i : at) {
        Node& node = nodes[static_cast<std::size_t>(i)];
        witness(node);
        const Index row = set.row(node.witness);
        if (number[static_cast<std::size_t>(row)] < 0) {
            number[static_cast<std::size_t>(row)] = static_cast<Index>(winner.size());
            winner.push_back(row);
        }
    }
    std::vector<std::vector<double>> distance(winner.size());
    const bool local = static_cast<std::size_t>(group) < model.members.size();
    const std::size_t step = std::max<std::size_t>(1, at.size() / kLooked);
    std::vector<Index> places;
    std::vector<double> values;
    for (std::size_t i = 0; i < at.size(); i += step) {
        const Node& node = nodes[static_cast<std::size_t>(at[i])];
        places = node.belief.state;
        if (local) {
            for (Index& place : places) place = model.local[static_cast<std::size_t>(place)];
        }
        set.values(places.data(), node.belief.weight.data(), places.size(), values);
        const auto champion = static_cast<std::size_t>(set.row(node.witness));
        auto& away = distance[static_cast<std::size_t>(number[champion])];
        if (away.empty()) set.distances(champion, away);
        for (std::size_t row = 0; row < count; ++row) {
            // The same vector twice has distance 0: the copy goes unless it is itself a winner.
            const double loss = values[champion] - values[row];
            if (away[row] > 0 && loss < radius[row] * away[row]) radius[row] = loss / away[row];
        }
    }
    for (const Index row : winner) radius[static_cast<std::size_t>(row)] = -1.0;
    // They go on with themselves.
    for (std::size_t row = 0; row < count; ++row) {
        if (set.stamp(row) < model.actions) radius[row] = -1.0;
    }
    const double most = std::min(cap * static_cast<double>(winner.size()), static_cast<double>(count));
    const auto allowed = static_cast<std::size_t>(most);
    std::vector<double> sorted = radius;
    if (allowed < count) {
        std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(allowed), sorted.end());
        delta = std::min(delta, sorted[allowed]);
    }
    std::vector<char> kept(count);
    for (std::size_t row = 0; row < count; ++row) kept[row] = radius[row] < delta || radius[row] == -1.0;
    origins.retire(set, group, kept, kGain * scale);
    set.keep(kept);
}

}  // namespace lcorpp
