// Python bindings of the planner's kernels: lcorpp.planning._native. `make stubs` writes the stub from these bindings.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "arguments.hpp"
#include "bindings.hpp"
#include "bounds.hpp"
#include "exports.hpp"
#include "model.hpp"
#include "path_sampling.hpp"
#include "potentials/gain.hpp"
#include "potentials/power_potentials.hpp"
#include "reachable_blocks.hpp"
#include "graph/symmetry.hpp"
#include "tree.hpp"

using namespace lcorpp;
using namespace nb::literals;

namespace {

// Compute a table (A, S) within some seconds, without the interpreter lock.
template <typename Work>
auto run_timed(const Model& model, double tolerance, double seconds, Work work) {
    // With a NaN the iteration would never terminate.
    require(tolerance >= 0 && !std::isnan(seconds), "tolerance and seconds must not be NaN, tolerance not negative");
    std::vector<double> table;
    {
        nb::gil_scoped_release released;
        Clock clock(seconds, check_interrupt);
        table = work(clock);
    }
    return make_array(std::move(table), {as_size(model.actions), as_size(model.states)});
}

void bind_model(nb::module_& m) {
    nb::class_<Model>(m, "Model", R"(The problem in the form of the kernels; `build_model` makes it from a Pomdp.

Blocks partition the states: after every action and observation the belief lies within one. A group is a block,
or the last one, of all states, for beliefs over several blocks.)")
        .def(
            "__init__",
            [](Model* self, Index n_actions, Index n_states, Index n_observations, InputArray<std::int64_t, 1> t_begins,
               InputArray<Index, 1> t_columns, InputArray<double, 1> t_values, InputArray<std::int64_t, 1> o_begins,
               InputArray<Index, 1> o_columns, InputArray<double, 1> o_values, InputArray<double, 2> reward, double discount) {
                require(discount >= 0 && discount < 1, "the discount must be at least 0 and below 1");
                require(n_actions > 0 && n_states > 0 && reward.shape(0) == as_size(n_actions) &&
                            reward.shape(1) == as_size(n_states),
                        "expected rewards of actions by states");
                require_finite(reward, "expected finite rewards");
                new (self) Model(make_tables(n_actions, n_states, n_states, t_begins, t_columns, t_values),
                                 make_tables(n_actions, n_states, n_observations, o_begins, o_columns, o_values),
                                 copy(reward), discount);
            },
            // Indices are never converted: a number beyond 32 bits would become another one.
            "n_actions"_a, "n_states"_a, "n_observations"_a, "transition_begins"_a.noconvert(),
            "transition_columns"_a.noconvert(), "transition_values"_a, "observation_begins"_a.noconvert(),
            "observation_columns"_a.noconvert(), "observation_values"_a, "reward"_a, "discount"_a,
            R"(Copy sparse tables (A, S, S) of transitions and (A, S, O) of observations, and rewards (A, S).

The entries of row a S + s are those from begins[a S + s] to before begins[a S + s + 1]: each has a column, the next
state or the observation, and a value, its probability.

Raises:
    ValueError: shapes or indices do not fit together, a row is not a distribution, or a number is not finite.)")
        .def("export_blocks", [](const Model& model) { return make_array(model.block); }, "Return (S,) the block of each state.");
    m.def(
        "find_reachable_blocks",
        [](const Model& model, InputArray<std::int64_t, 1> begins, InputArray<Index, 1> states) {
            const std::size_t entries = states.size(), count = begins.size() - 1;
            require(begins.size() > 1 && begins.data()[0] == 0 && begins.data()[count] == static_cast<std::int64_t>(entries),
                    "the arrays of the starts do not fit together");
            std::vector<std::vector<Index>> starts(count);
            for (std::size_t k = 0; k < count; ++k) {
                require(begins.data()[k] < begins.data()[k + 1] && begins.data()[k + 1] <= static_cast<std::int64_t>(entries),
                        "a start has no states");
                starts[k].assign(states.data() + begins.data()[k], states.data() + begins.data()[k + 1]);
            }
            for (std::size_t i = 0; i < entries; ++i) {
                require(states.data()[i] >= 0 && states.data()[i] < model.states, "a state of a start is out of range");
            }
            return make_array(find_reachable_blocks(model, starts));
        },
        "model"_a, "begins"_a.noconvert(), "states"_a.noconvert(),
        R"(Return (S,) the block of each state that the starts reach, -1 for others.

It is the finest partition such that every action and observation lead from a belief within a block, or within
the support of a start, to one within a block. Start k has the states from begins[k] to before begins[k + 1];
those over several blocks count as one, because they share their vectors.

Source: Hopcroft and Karp, "A linear algorithm for testing equivalence of finite automata", 1971.)");
}

void bind_bounds(nb::module_& m) {
    m.def(
        "blind_policies",
        [](const Model& model, double tolerance, double seconds) {
            return run_timed(model, tolerance, seconds, [&](Clock& clock) { return blind_policies(model, tolerance, clock); });
        },
        "model"_a, "tolerance"_a, "seconds"_a,
        R"(Return (A, S) lower bounds on the value of repeating one action forever.

The function iterates until the result is within the tolerance, in reward units, or wall-clock seconds are over.
Every sweep yields a valid bound.

Raises:
    ValueError: a limit is NaN, or the tolerance negative.

Source: Hauskrecht, JAIR 2000.)");
    m.def(
        "mdp_bound",
        [](const Model& model, double tolerance, double seconds) {
            return run_timed(model, tolerance, seconds, [&](Clock& clock) { return mdp_bound(model, tolerance, clock); });
        },
        "model"_a, "tolerance"_a, "seconds"_a,
        R"(Return (A, S) upper bounds on the Q values if the state were observed; limits as of `blind_policies`.)");
    m.def(
        "fast_informed_bound",
        [](const Model& model, InputArray<double, 2> Q, double tolerance, double seconds) {
            std::vector<double> start = copy_table(model, Q);
            return run_timed(model, tolerance, seconds,
                             [&](Clock& clock) { return fast_informed_bound(model, std::move(start), tolerance, clock); });
        },
        "model"_a, "Q"_a, "tolerance"_a, "seconds"_a,
        R"(Return (A, S) the fast informed bound, iterated downwards from Q values (A, S) that are upper bounds.

Q(a, s) <- R(a, s) + gamma sum over o of max over a' of sum over s' of P(s', o | s, a) Q(a', s'). Limits as of
`blind_policies`.

Source: Hauskrecht, JAIR 2000.)");
    m.def(
        "find_symmetries",
        [](const Model& model, std::size_t max_refinements, double seconds) {
            nb::gil_scoped_release released;
            Clock clock(seconds, check_interrupt);
            return find_symmetries(model, max_refinements, clock);
        },
        "model"_a, "max_refinements"_a, "seconds"_a,
        R"(Return, for each symmetry that was found, the state whose weight each state takes (S).

Source: McKay, "Practical graph isomorphism", 1981.)");
    m.def(
        "power_potentials",
        [](const Model& model, InputArray<double, 2> mdp, InputArray<std::int64_t, 1> begins, InputArray<Index, 1> states,
           InputArray<double, 1> weights, double seconds) {
            const std::vector<Weights> beliefs = make_beliefs(model, begins, states, weights, begins.size() - 1);
            const std::vector<double> top = copy_table(model, mdp);
            std::vector<Potential> found;
            {
                nb::gil_scoped_release released;
                Clock clock(seconds, check_interrupt);
                found = find_power_potentials(model, top, beliefs, clock);
            }
            std::vector<double> offsets, scales, powers;
            for (const Potential& potential : found) {
                offsets.insert(offsets.end(), potential.offset.begin(), potential.offset.end());
                scales.push_back(potential.scale);
                powers.push_back(potential.power);
            }
            const std::size_t count = found.size();
            return std::make_tuple(make_array(std::move(offsets), {count, as_size(model.states)}), make_array(std::move(scales)),
                                   make_array(std::move(powers)));
        },
        "model"_a, "mdp"_a, "begins"_a.noconvert(), "states"_a.noconvert(), "weights"_a, "seconds"_a,
        R"(Return offsets (K, S), scales (K,) and powers (K,) of the potentials that are the lowest at some beliefs.

Potential k is offsets[k].b + scales[k] N(b) with the norm N(b) = (sum of b(s)^powers[k])^(1 / powers[k]).

Args:
    mdp: (A, S) upper bounds on the Q values if the state were observed.
    begins, states, weights: the beliefs, each within a block, in the form of `Tree.points`.
    seconds: wall-clock time limit.

Source: Gallager, Information Theory and Reliable Communication, 1968, section 5.6, for the condition.)");
    m.def(
        "maximise_gain",
        [](InputArray<double, 1> linear, double entropy, double gamma, InputArray<double, 2> likelihood, InputArray<Index, 2> pairs,
           InputArray<double, 1> pair_weights, double tolerance, InputArray<double, 1> start) {
            const std::size_t n = linear.size();
            require(likelihood.shape(0) == n && start.size() == n && pairs.shape(0) == pair_weights.size() && pairs.shape(1) == 2,
                    "the arrays do not fit together");
            std::vector<Potential::Pair> terms;
            for (std::size_t k = 0; k < pair_weights.size(); ++k) {
                require(pairs.data()[2 * k] >= 0 && pairs.data()[2 * k + 1] >= 0 && as_size(pairs.data()[2 * k]) < n &&
                            as_size(pairs.data()[2 * k + 1]) < n,
                        "a pair has an unknown state");
                if (pair_weights.data()[k] > 0) terms.push_back({pairs.data()[2 * k], pairs.data()[2 * k + 1], pair_weights.data()[k]});
            }
            std::vector<double> b = copy(start);
            const Ascent found = maximise_gain(copy(linear), entropy, gamma, copy(likelihood), likelihood.shape(1), terms, tolerance, b);
            return std::make_tuple(make_array(std::move(b)), found.value, found.upper);
        },
        "linear"_a, "entropy"_a, "gamma"_a, "likelihood"_a, "pairs"_a.noconvert(), "pair_weights"_a, "tolerance"_a, "start"_a,
        R"(Return a belief (n,) at which the gain of an action is nearly the largest, its value, and an upper bound of all gains.

The gain is linear.b + entropy (H(b) - gamma E[H(b')]) + sum over pairs of weight sqrt(b(s) b(t)); it is concave.

Args:
    linear: (n,). likelihood: (n, m) P(o | s) of the observations; with m = 0 there is no E[H(b')].
    pairs: (n_pairs, 2) states s and t. pair_weights: (n_pairs,).
    tolerance: the ascent ends when the value is this close to its upper bound. start: (n,) where it begins.)");
}

void bind_predictor(nb::module_& m) {
    nb::class_<ValuePredictor>(m, "ValuePredictor", R"(Predicts the value of a node for selective deep sampling.

The prediction is the mean lower bound of similar beliefs, those with the same bins of initial upper bound and
entropy; the upper bound of the node where there are none.

Source: Kurniawati, Hsu and Lee, RSS 2008, section III-B.)")
        .def(
            "__init__",
            [](ValuePredictor* self, InputArray<double, 1> corners) {
                require(corners.size() > 0, "expected at least one corner");
                require_finite(corners, "expected finite corners");
                new (self) ValuePredictor(copy(corners));
            },
            "corners"_a, "Take (S,) the initial upper bound at the beliefs that know the state.")
        .def(
            "learn", [](ValuePredictor& predictor, Tree& tree, Index node) { predictor.learn(get_node(tree, node)); },
            "tree"_a, "node"_a, "Add the lower bound of a visited node.")
        .def(
            "predict",
            [](const ValuePredictor& predictor, Tree& tree, Index node) { return predictor.predict(get_node(tree, node)); },
            "tree"_a, "node"_a, "Predict the value of a node.");
}

}  // namespace

NB_MODULE(_native, m) {
    m.doc() = "C++ kernels of the planner: the initial bounds, and the belief tree in which SARSOP, Perseus and the online planner "
              "search. `make stubs` writes the stub.";
    bind_model(m);
    bind_bounds(m);
    bind_predictor(m);
    bind_tree(m);
}
