#include "dependencies.hpp"

#include <algorithm>
#include <unordered_set>
#include <utility>

namespace lcorpp {

void VectorDependencies::record(Stamp vector, std::vector<Edge> edges) {
    edges.shrink_to_fit();
    add_memory(edges);
    edges_[vector] = std::move(edges);
}

void VectorDependencies::record_imported_vector(Stamp vector) {
    edges_[kImported].push_back({-1, -1, vector});
    edges_[vector] = {{-1, -1, kImported}};
}

void VectorDependencies::record_pruned_vector(PrunedVector pruned, std::vector<Edge> edges) {
    record(pruned.stamp, std::move(edges));
    add_memory(pruned);
    pruned_.emplace(pruned.stamp, std::move(pruned));
}

void VectorDependencies::record_pruned_vectors(const VectorSet& set, Index group, const std::vector<char>& kept, double slack) {
    for (std::size_t row = 0; row < set.count(); ++row) {
        if (kept[row]) continue;
        const Index dominating = set.find_dominating(row, kept, slack);
        if (dominating >= 0) {
            replaced_by_[set.stamp(row)] = set.stamp(as_size(dominating));
        } else {
            PrunedVector pruned{set.stamp(row), group, set.action(row), {}};
            pruned.values.reserve(set.states());
            for (std::size_t s = 0; s < set.states(); ++s) pruned.values.push_back(set.at(row, s));
            add_memory(pruned);
            pruned_.emplace(set.stamp(row), std::move(pruned));
        }
    }
}

Stamp VectorDependencies::find_replacement(Stamp stamp) const {
    for (auto next = replaced_by_.find(stamp); next != replaced_by_.end(); next = replaced_by_.find(stamp)) {
        stamp = next->second;
    }
    return stamp;
}

// Replace all pruned vectors that were replaced in the dependencies; return the stamps of the vectors in the sets and of
// all vectors that they depend on, directly or not.
std::vector<Stamp> VectorDependencies::find_needed_stamps(const std::vector<VectorSet>& sets) {
    std::vector<Stamp> queue;
    std::unordered_set<Stamp> visited;
    const auto visit = [&](Stamp stamp) {
        if (stamp >= blind_ && visited.insert(stamp).second) queue.push_back(stamp);
    };
    for (const VectorSet& set : sets) {
        for (std::size_t row = 0; row < set.count(); ++row) visit(set.stamp(row));
    }
    for (std::size_t i = 0; i < queue.size(); ++i) {
        const auto entry = edges_.find(queue[i]);
        if (entry == edges_.end()) continue;
        for (Edge& edge : entry->second) {
            edge.vector = find_replacement(edge.vector);
            visit(edge.vector);
        }
    }
    return queue;
}

void VectorDependencies::remove_unneeded(const std::vector<VectorSet>& sets) {
    const std::vector<Stamp> needed = find_needed_stamps(sets);  // after it, no edge leads to a replaced vector
    decltype(edges_) edges;
    decltype(pruned_) pruned;
    for (const Stamp stamp : needed) {
        if (const auto entry = edges_.find(stamp); entry != edges_.end()) edges.insert(edges_.extract(entry));
        if (const auto entry = pruned_.find(stamp); entry != pruned_.end()) pruned.insert(pruned_.extract(entry));
    }
    edges_.swap(edges);
    pruned_.swap(pruned);
    replaced_by_.clear();
    memory_size_ = 0;
    for (const auto& [stamp, list] : edges_) add_memory(list);
    for (const auto& [stamp, vector] : pruned_) add_memory(vector);
}

void VectorDependencies::clear() {
    edges_.clear();
    pruned_.clear();
    replaced_by_.clear();
    memory_size_ = 0;
}

std::vector<const PrunedVector*> VectorDependencies::pruned() const {
    std::vector<const PrunedVector*> vectors;
    for (const auto& [stamp, vector] : pruned_) vectors.push_back(&vector);
    std::sort(vectors.begin(), vectors.end(), [](const auto* a, const auto* b) { return a->stamp < b->stamp; });
    return vectors;
}

}  // namespace lcorpp
