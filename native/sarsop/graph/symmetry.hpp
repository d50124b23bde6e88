// Symmetries of a model: renamings of states, actions and observations after which it is the same model.
#pragma once

#include <vector>

#include "clock.hpp"
#include "model.hpp"

namespace lcorpp {

// For each symmetry that was found, the state whose weight each state takes (S). Where values of a variable are exchangeable, all
// exchanges of two values are found; the search ends after `max_refinements`, so other symmetries may be missing.
//
// Colours of states, actions and observations are refined until those with one colour cannot be told apart by the entries they
// occur in; then two vertices with one colour are fixed as images of each other, and so on until all colours differ, with as many
// others as possible as their own images. Each renaming is compared with the tables before it counts.
// Source: McKay, "Practical graph isomorphism", 1981.
std::vector<std::vector<Index>> find_symmetries(const Model& model, std::size_t max_refinements, Clock& clock);

}  // namespace lcorpp
