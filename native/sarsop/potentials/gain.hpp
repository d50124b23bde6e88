// The gain of an action over a potential, and its largest value over all beliefs.
#pragma once

#include <vector>

#include "potentials/potentials.hpp"

namespace lcorpp {

// The largest value over the distributions b (n) of linear.b + entropy * (H(b) - gamma * sum over o of P(o) H(b after o)) +
// sum over pairs of weight * sqrt(b(s) b(t)), which is concave in b.
//
// likelihood: (n, m) P(o | s); with m = 0 there is no observation, and gamma counts as 0. b: where the ascent begins; becomes
// where it ends. Returns an upper bound of the maximum, by the gradient there; it is close if `tolerance` was reached.
struct Ascent {
    double value, upper;
};
Ascent maximise_gain(const std::vector<double>& linear, double entropy, double gamma, const std::vector<double>& likelihood, std::size_t m,
                     const std::vector<Potential::Pair>& pairs, double tolerance, std::vector<double>& b);

}  // namespace lcorpp
