// Where both bounds start: blind policies below, the fast informed bound above.
// Source: Hauskrecht, JAIR 2000.
#pragma once

#include <vector>

#include "clock.hpp"
#include "model.hpp"

namespace lcorpp {

// (A, S) the value of doing one action for ever, from below: every sweep is a bound.
std::vector<double> blind_policies(const Model& model, double tolerance, Clock& clock);

// (A, S) Q values above those of the fully observed problem: every sweep is a bound.
std::vector<double> mdp_bound(const Model& model, double tolerance, Clock& clock);

// (A, S) the fast informed bound, from Q values (A, S) above it: every sweep is a bound.
// Q(a, s) <- R(a, s) + gamma sum over o of max over a' of sum over s' of P(s', o | s, a) Q(a', s')
std::vector<double> fast_informed_bound(const Model& model, std::vector<double> Q, double tolerance, Clock& clock);

}  // namespace lcorpp
