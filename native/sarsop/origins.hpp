// Which vectors each alpha vector was made from: what a policy needs to earn what its vectors promise.
#pragma once

#include <limits>
#include <unordered_map>
#include <vector>

#include "vectors.hpp"

namespace lcorpp {

// A vector promises a value because it goes on with others. Where one of those is pruned, another that is worth
// as much in every state takes its place; where there is none it is kept here, out of the search's way, until
// no vector needs it any more.
class Origins {
  public:
    // A vector that no search asks any more, over the states of a group.
    struct Retired {
        Index group;
        Index action;
        std::vector<double> values;
    };

    // Vectors with stamps below `blind` go on with themselves and are never pruned.
    explicit Origins(Stamp blind) : blind_(blind) {}

    // A new vector and those it goes on with.
    void note(Stamp made, std::vector<Stamp> from);

    // One that was taken over from elsewhere: it may go on with any other that was.
    void note_foreign(Stamp made);

    // Called before a set drops the rows whose entry in `kept` is 0. Losses up to `slack` are rounding.
    void retire(const VectorSet& set, Index group, const std::vector<char>& kept, double slack);

    // Forget what the vectors in the sets do not go on with.
    void collect(const std::vector<VectorSet>& sets);

    // The pruned vectors that those in the sets go on with, by rising stamps.
    std::vector<const Retired*> needed(const std::vector<VectorSet>& sets);

  private:
    // Stands for all vectors that were taken over.
    static constexpr Stamp kForeign = std::numeric_limits<Stamp>::max();

    Stamp standing_for(Stamp stamp) const;
    std::vector<Stamp> reached(const std::vector<VectorSet>& sets);

    Stamp blind_;
    std::unordered_map<Stamp, std::vector<Stamp>> from_;
    std::unordered_map<Stamp, Stamp> instead_;  // what took the place of a pruned vector
    std::unordered_map<Stamp, Retired> retired_;
};

}  // namespace lcorpp
