// The finest partition of the states that start beliefs reach, such that beliefs stay within its blocks.
#pragma once

#include <vector>

#include "model.hpp"

namespace lcorpp {

// The block of each state, -1 for states that the starts do not reach. From a belief within one block, or within the
// support of a start that is over several, every action and observation lead to a belief within one block. Unlike the
// blocks of the model, these may depend on what the action and the observations before it reveal: where a robot knows
// its place and moves without fail, each place is a block even if no observation shows it.
//
// Source: Hopcroft and Karp, "A linear algorithm for testing equivalence of finite automata", 1971: blocks are merged
// until the same action and observation lead from each to one.
std::vector<Index> find_reachable_blocks(const Model& model, const std::vector<std::vector<Index>>& starts);

}  // namespace lcorpp
