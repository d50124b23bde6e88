#include "origins.hpp"

#include <algorithm>
#include <unordered_set>
#include <utility>

namespace lcorpp {

void Origins::note(Stamp made, std::vector<Stamp> from) {
    from.erase(std::remove_if(from.begin(), from.end(), [&](Stamp stamp) { return stamp < blind_; }), from.end());
    std::sort(from.begin(), from.end());
    from.erase(std::unique(from.begin(), from.end()), from.end());
    from_[made] = std::move(from);
}

void Origins::note_foreign(Stamp made) {
    from_[kForeign].push_back(made);
    from_[made] = {kForeign};
}

void Origins::retire(const VectorSet& set, Index group, const std::vector<char>& kept, double slack) {
    for (std::size_t row = 0; row < set.count(); ++row) {
        if (kept[row]) continue;
        const Index better = set.above(row, kept, slack);
        if (better >= 0) {
            instead_[set.stamp(row)] = set.stamp(static_cast<std::size_t>(better));
        } else {
            Retired retired{group, set.action(row), {}};
            for (std::size_t s = 0; s < set.states(); ++s) retired.values.push_back(set.at(row, s));
            retired_.emplace(set.stamp(row), std::move(retired));
        }
    }
}

Stamp Origins::standing_for(Stamp stamp) const {
    for (auto found = instead_.find(stamp); found != instead_.end(); found = instead_.find(stamp)) stamp = found->second;
    return stamp;
}

// The stamps of all vectors that those in the sets go on with, now or later, and of those themselves.
std::vector<Stamp> Origins::reached(const std::vector<VectorSet>& sets) {
    std::vector<Stamp> found;
    std::unordered_set<Stamp> met;
    const auto meet = [&](Stamp stamp) {
        if (stamp >= blind_ && met.insert(stamp).second) found.push_back(stamp);
    };
    for (const VectorSet& set : sets) {
        for (std::size_t row = 0; row < set.count(); ++row) meet(set.stamp(row));
    }
    for (std::size_t i = 0; i < found.size(); ++i) {
        const auto from = from_.find(found[i]);
        if (from == from_.end()) continue;
        for (Stamp& stamp : from->second) {
            stamp = standing_for(stamp);
            meet(stamp);
        }
    }
    return found;
}

void Origins::collect(const std::vector<VectorSet>& sets) {
    const std::vector<Stamp> found = reached(sets);  // after which nothing asks `instead_` any more
    decltype(from_) from;
    decltype(retired_) retired;
    for (const Stamp stamp : found) {
        if (const auto held = from_.find(stamp); held != from_.end()) from.insert(from_.extract(held));
        if (const auto held = retired_.find(stamp); held != retired_.end()) retired.insert(retired_.extract(held));
    }
    from_.swap(from);
    retired_.swap(retired);
    instead_.clear();
}

std::vector<const Origins::Retired*> Origins::needed(const std::vector<VectorSet>& sets) {
    std::vector<Stamp> found = reached(sets);
    std::sort(found.begin(), found.end());
    std::vector<const Retired*> needed;
    for (const Stamp stamp : found) {
        if (const auto held = retired_.find(stamp); held != retired_.end()) needed.push_back(&held->second);
    }
    return needed;
}

}  // namespace lcorpp
