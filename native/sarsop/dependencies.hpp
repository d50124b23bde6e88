// The vectors that each alpha vector depends on: a policy needs them to earn what its vectors promise.
#pragma once

#include <limits>
#include <unordered_map>
#include <vector>

#include "alpha_vectors.hpp"

namespace lcorpp {

// After an observation, the plan of a vector continues with a vector of the group of the next belief.
struct Edge {
    Index observation, group;
    Stamp vector;
};

// A pruned vector that others still depend on, over the states of a group. The search does not use it.
struct PrunedVector {
    Stamp stamp;
    Index group;
    Index action;
    std::vector<double> values;
};

// A vector depends on the vectors from which its backup computed it, one per observation: the promised value is earned
// only if the policy continues with those. If one of them is pruned, a vector that dominates it replaces it. If there is none, the pruned
// vector is kept here until no other vector depends on it.
class VectorDependencies {
  public:
    // Vectors with stamps below `blind`, the number of actions, are blind policies: they depend on themselves and are
    // never pruned.
    explicit VectorDependencies(Stamp blind) : blind_(blind) {}

    // Record a new vector and the vectors it depends on, one for each observation that its states may lead to.
    void record(Stamp vector, std::vector<Edge> edges);

    // Record a vector that was imported from another search: it may depend on any other imported vector.
    void record_imported_vector(Stamp vector);

    // Record the rows whose entry in `kept` is 0, before the set drops them; `remove_unneeded` must follow. Losses up to `slack` are rounding errors.
    void record_pruned_vectors(const VectorSet& set, Index group, const std::vector<char>& kept, double slack);

    // Record a pruned vector, with its edges.
    void record_pruned_vector(PrunedVector pruned, std::vector<Edge> edges);

    // Remove all vectors that the vectors in the sets do not depend on.
    void remove_unneeded(const std::vector<VectorSet>& sets);

    // Remove all vectors.
    void clear();

    // Whether vectors were imported from another search.
    bool has_imported() const { return edges_.count(kImported) > 0; }

    // The edges of a vector that is neither blind nor imported.
    const std::vector<Edge>& edges(Stamp vector) const { return edges_.at(vector); }

    // Memory of all pruned vectors and dependencies in bytes.
    std::size_t memory_size() const { return memory_size_; }

    // The pruned vectors by rising stamps.
    std::vector<const PrunedVector*> pruned() const;

  private:
    // Stands for all imported vectors: each depends on it, and it depends on each.
    static constexpr Stamp kImported = std::numeric_limits<Stamp>::max();

    // Memory of an entry of a map beside its numbers, about.
    static constexpr std::size_t kEntrySize = 64;

    Stamp find_replacement(Stamp stamp) const;
    std::vector<Stamp> find_needed_stamps(const std::vector<VectorSet>& sets);

    void add_memory(const std::vector<Edge>& edges) { memory_size_ += kEntrySize + edges.size() * sizeof(Edge); }
    void add_memory(const PrunedVector& vector) { memory_size_ += kEntrySize + vector.values.size() * sizeof(double); }

    Stamp blind_;
    std::size_t memory_size_ = 0;
    std::unordered_map<Stamp, std::vector<Edge>> edges_;
    std::unordered_map<Stamp, Stamp> replaced_by_;
    std::unordered_map<Stamp, PrunedVector> pruned_;
};

}  // namespace lcorpp
