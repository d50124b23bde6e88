// The vectors that each alpha vector depends on: a policy needs them to earn what its vectors promise.
#pragma once

#include <limits>
#include <unordered_map>
#include <vector>

#include "alpha_vectors.hpp"

namespace lcorpp {

// A pruned vector that others still depend on, over the states of a group. The search does not use it.
struct PrunedVector {
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

    // Record a new vector and the vectors it depends on.
    void record(Stamp vector, std::vector<Stamp> depends_on);

    // Record a vector that was imported from another search: it may depend on any other imported vector.
    void record_imported_vector(Stamp vector);

    // Record the rows whose entry in `kept` is 0, before the set drops them. Losses up to `slack` are rounding errors.
    void record_pruned_vectors(const VectorSet& set, Index group, const std::vector<char>& kept, double slack);

    // Forget all vectors that the vectors in the sets do not depend on.
    void forget_unneeded(const std::vector<VectorSet>& sets);

    // Memory of all pruned vectors and dependencies in bytes.
    std::size_t memory_size() const { return memory_size_; }

    // The pruned vectors that the vectors in the sets depend on, by rising stamps.
    std::vector<const PrunedVector*> find_needed_vectors(const std::vector<VectorSet>& sets);

  private:
    // Stands for all imported vectors: each depends on it, and it depends on each.
    static constexpr Stamp kImported = std::numeric_limits<Stamp>::max();

    // Memory of an entry of a map beside its numbers, about.
    static constexpr std::size_t kEntrySize = 64;

    Stamp find_replacement(Stamp stamp) const;
    std::vector<Stamp> find_needed_stamps(const std::vector<VectorSet>& sets);

    void add_memory(const std::vector<Stamp>& stamps) { memory_size_ += kEntrySize + stamps.size() * sizeof(Stamp); }
    void add_memory(const PrunedVector& vector) { memory_size_ += kEntrySize + vector.values.size() * sizeof(double); }

    Stamp blind_;
    std::size_t memory_size_ = 0;
    std::unordered_map<Stamp, std::vector<Stamp>> depends_on_;
    std::unordered_map<Stamp, Stamp> replaced_by_;
    std::unordered_map<Stamp, PrunedVector> pruned_;
};

}  // namespace lcorpp
