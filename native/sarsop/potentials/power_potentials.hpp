// Potentials with a norm of the belief, by the information that questions give about a state that they do not change.
#pragma once

#include <vector>

#include "clock.hpp"
#include "model.hpp"
#include "potentials/potentials.hpp"

namespace lcorpp {

// The potential C N(b) + (W - C).b that is the lowest at a belief within a block, W being the value of the MDP; none
// if no C makes it lower than W.b. It bounds the value at all beliefs within blocks.
//
// Let A(a, s) = W(s) - R(a, s) - gamma E[W(s')] be the loss of an action in a known state. U(b) = W.b - C + f C N(b) bounds the
// value if it is not below its own backup for any action a at any belief b of a block:
//   * A question moves the states of a block to different ones and observes them. Here the condition is
//       gamma * sum over o of N(b Z_o) - N(b) <= sum over s of (A(a, s) / C - (1 - gamma)) / f * b(s).
//     With w = b^q / sum of b^q and k(s) = ((1 - gamma) - A(a, s) / C) / f it reads F(w) <= 1 for
//       F(w) = gamma * sum over o of (sum over s of w(s) Z_o(s)^q)^(1/q) + sum over s of k(s) w(s)^(1/q),
//     and F is concave in w where no k(s) is negative, so that its gradient bounds its maximum.
//   * Any other action reveals the state at most, after which the value is at most W. This suffices if
//       sum over s of (1 - A(a, s) / C) b(s) <= f N(b), which holds (Hoelder) if f is at least the norm of the positive
//     parts of 1 - A(a, .) / C with exponent q / (q - 1).
// F is a form of Gallager's function E_0 (Information Theory and Reliable Communication, 1968, section 5.6).
std::vector<Potential> find_power_potentials(const Model& model, const std::vector<double>& mdp, const std::vector<Weights>& beliefs,
                                             Clock& clock);

}  // namespace lcorpp
