// Beliefs as keys: those that differ by rounding errors only are one.
#pragma once

#include <cstdint>

#include "model.hpp"

namespace lcorpp {

// Beliefs whose weights are equal after rounding to multiples of 1 / kBeliefResolution share a node. The lower bound of a
// node is used only at its own belief; the upper bound also at a parent's next belief, plus the Lipschitz slack between
// the two.
constexpr double kBeliefResolution = 1e10;

// A hash of the states with a rounded weight above 0 and of these weights. Equal keys are compared by same_belief.
std::uint64_t hash_belief(const Index* states, const double* weights, std::size_t n);

// Whether the rounded weights of two beliefs are equal.
bool same_belief(const Index* states_a, const double* weights_a, std::size_t n_a, const Index* states_b, const double* weights_b,
                 std::size_t n_b);

// The sum over the states of |a(s) - b(s)|.
double l1_distance(const Index* states_a, const double* weights_a, std::size_t n_a, const Index* states_b, const double* weights_b,
                   std::size_t n_b);

// The largest difference between the values of two beliefs, rounded up: a value is at most `max_abs_value`.
float lipschitz_slack(double max_abs_value, double distance);

}  // namespace lcorpp
