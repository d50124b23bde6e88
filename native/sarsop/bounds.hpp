// Initial bounds: blind policies from below, the MDP and the fast informed bound from above.
// Source: Hauskrecht, JAIR 2000.
#pragma once

#include <vector>

#include "clock.hpp"
#include "model.hpp"

namespace lcorpp {

// Each function iterates sweeps until the result is within `tolerance` or time is up. Every sweep yields a valid bound.

// (A, S) lower bounds on the value of repeating one action forever.
std::vector<double> blind_policies(const Model& model, double tolerance, Clock& clock);

// (A, S) upper bounds on the Q values of the fully observable problem.
std::vector<double> mdp_bound(const Model& model, double tolerance, Clock& clock);

// (A, S) the fast informed bound, iterated downwards from Q values (A, S) that are upper bounds:
// Q(a, s) <- R(a, s) + gamma sum over o of max over a' of sum over s' of P(s', o | s, a) Q(a', s')
std::vector<double> fast_informed_bound(const Model& model, std::vector<double> Q, double tolerance, Clock& clock);

}  // namespace lcorpp
