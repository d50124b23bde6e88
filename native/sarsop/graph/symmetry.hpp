// Symmetries of a model: renamings of states, actions and observations after which it is the same model.
#pragma once

#include <vector>

#include "clock.hpp"
#include "model.hpp"

namespace lcorpp {

// For each symmetry that was found, the state whose weight each state takes (S). Where values of a variable are exchangeable, all
// exchanges of two values are found; the search ends after `max_refinements`, so other symmetries may be missing.
//
// States, actions and observations are vertices of a coloured graph, numbers of the tables its edges. Colour refinement splits
// a colour until its vertices have edges of equal numbers to each colour. Then one vertex is fixed as the image of another with its
// colour, and the refinement goes on until all colours differ; as many others as possible are their own images. Each renaming is
// compared with the tables before it counts.
// Source: McKay, "Practical graph isomorphism", 1981.
std::vector<std::vector<Index>> find_symmetries(const Model& model, std::size_t max_refinements, Clock& clock);

}  // namespace lcorpp
