#include "dependencies.hpp"

#include <algorithm>
#include <unordered_set>
#include <utility>

namespace lcorpp {

void VectorDependencies::record(Stamp vector, std::vector<Stamp> depends_on) {
    depends_on.erase(std::remove_if(depends_on.begin(), depends_on.end(), [&](Stamp stamp) { return stamp < blind_; }),
                     depends_on.end());
    std::sort(depends_on.begin(), depends_on.end());
    depends_on.erase(std::unique(depends_on.begin(), depends_on.end()), depends_on.end());
    add_memory(depends_on);
    depends_on_[vector] = std::move(depends_on);
}

void VectorDependencies::record_imported_vector(Stamp vector) {
    depends_on_[kImported].push_back(vector);
    depends_on_[vector] = {kImported};
}

void VectorDependencies::record_pruned_vectors(const VectorSet& set, Index group, const std::vector<char>& kept, double slack) {
    for (std::size_t row = 0; row < set.count(); ++row) {
        if (kept[row]) continue;
        const Index dominating = set.find_dominating(row, kept, slack);
        if (dominating >= 0) {
            replaced_by_[set.stamp(row)] = set.stamp(as_size(dominating));
        } else {
            PrunedVector pruned{group, set.action(row), {}};
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
        const auto entry = depends_on_.find(queue[i]);
        if (entry == depends_on_.end()) continue;
        for (Stamp& stamp : entry->second) {
            stamp = find_replacement(stamp);
            visit(stamp);
        }
    }
    return queue;
}

void VectorDependencies::forget_unneeded(const std::vector<VectorSet>& sets) {
    const std::vector<Stamp> needed = find_needed_stamps(sets);  // after it, no dependency is on a replaced vector
    decltype(depends_on_) depends_on;
    decltype(pruned_) pruned;
    for (const Stamp stamp : needed) {
        if (const auto entry = depends_on_.find(stamp); entry != depends_on_.end()) depends_on.insert(depends_on_.extract(entry));
        if (const auto entry = pruned_.find(stamp); entry != pruned_.end()) pruned.insert(pruned_.extract(entry));
    }
    depends_on_.swap(depends_on);
    pruned_.swap(pruned);
    replaced_by_.clear();
    memory_size_ = 0;
    for (const auto& [stamp, stamps] : depends_on_) add_memory(stamps);
    for (const auto& [stamp, vector] : pruned_) add_memory(vector);
}

std::vector<const PrunedVector*> VectorDependencies::find_needed_vectors(const std::vector<VectorSet>& sets) {
    if (pruned_.empty()) return {};
    std::vector<Stamp> stamps = find_needed_stamps(sets);
    std::sort(stamps.begin(), stamps.end());
    std::vector<const PrunedVector*> needed;
    for (const Stamp stamp : stamps) {
        if (const auto entry = pruned_.find(stamp); entry != pruned_.end()) needed.push_back(&entry->second);
    }
    return needed;
}

}  // namespace lcorpp
