// Symmetries of a model: renamings of states (with actions and observations) after which it is the same model.
#pragma once

#include <vector>

#include "model.hpp"

namespace lcorpp {

// A set of renamings of the states, and a normal form of beliefs under them. Two beliefs with one normal form have the same
// value. The normal form is found by applying renamings that raise the belief in lexicographic order, so two beliefs
// that are renamed into each other may still have different ones: then they only share less.
class Renamings {
  public:
    // images: for each renaming, the state whose weight each state takes (S).
    Renamings(Index states, std::vector<std::vector<Index>> images);

    // Rename a belief to its normal form.
    void normalise(Weights& belief);

  private:
    struct Move {
        Index state, source;
    };
    std::vector<std::vector<Move>> moved_;  // by renaming: the states that take another state's weight
    std::vector<double> dense_, taken_;     // reusable memory, zero between calls
};

}  // namespace lcorpp
