// The kernels as Python sees them: lcorpp.planning._native. Shapes and indices are checked here; whatever is
// wrong with them becomes a ValueError or IndexError, never a read beyond an array.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include "bounds.hpp"
#include "model.hpp"
#include "tree.hpp"
#include "trial.hpp"

namespace nb = nanobind;
using namespace lcorpp;
using namespace nb::literals;

namespace {

template <typename T, int N>
using Given = nb::ndarray<const T, nb::ndim<N>, nb::c_contig, nb::device::cpu>;
template <typename T>
using Made = nb::ndarray<nb::numpy, T>;

template <typename T>
Made<T> made(std::vector<T> values, std::initializer_list<std::size_t> shape) {
    auto* kept = new std::vector<T>(std::move(values));
    nb::capsule owner(kept, [](void* pointer) noexcept { delete static_cast<std::vector<T>*>(pointer); });
    return Made<T>(kept->data(), shape, owner);
}

template <typename G>
auto copied(const G& given) {
    using T = std::remove_const_t<typename G::Scalar>;
    return std::vector<T>(given.data(), given.data() + given.size());
}

Rows rows_of(Index tables, Index rows, Index columns, const Given<std::int64_t, 1>& begins, const Given<Index, 1>& column,
             const Given<double, 1>& value) {
    return Rows{tables, rows, columns, copied(begins), copied(column), copied(value)};
}

// Ctrl-C, as Python sees it: raises KeyboardInterrupt.
void interrupt() {
    nb::gil_scoped_acquire held;
    if (PyErr_CheckSignals() != 0) throw nb::python_error();
}

void expect(bool holds, const char* message) {
    if (!holds) throw std::invalid_argument(message);
}

template <typename G>
void expect_finite(const G& given, const char* message) {
    for (std::size_t i = 0; i < given.size(); ++i) expect(std::isfinite(given.data()[i]), message);
}

// A sweep that may never be near enough must not run for ever because of a number that is none.
void expect_limits(double tolerance, double seconds) {
    expect(tolerance >= 0 && !std::isnan(seconds), "tolerance and seconds are numbers, the tolerance not negative");
}

std::vector<double> table_of(const Model& model, const Given<double, 2>& table) {
    expect(table.shape(0) == static_cast<std::size_t>(model.actions) &&
               table.shape(1) == static_cast<std::size_t>(model.states),
           "expected a table of actions by states");
    expect_finite(table, "expected a table of finite numbers");
    return copied(table);
}

Made<double> by_action(const Model& model, std::vector<double> values) {
    return made(std::move(values), {static_cast<std::size_t>(model.actions), static_cast<std::size_t>(model.states)});
}

Weights belief_of(const Model& model, const Given<double, 1>& given) {
    expect(given.shape(0) == static_cast<std::size_t>(model.states), "a belief has one number for each state");
    Weights belief;
    double total = 0.0;
    for (Index s = 0; s < model.states; ++s) {
        const double p = given.data()[s];
        expect(std::isfinite(p) && p >= 0, "a belief holds finite numbers, not negative");
        if (p == 0) continue;
        belief.state.push_back(s);
        belief.weight.push_back(p);
        total += p;
    }
    expect(std::abs(total - 1) <= kSumTolerance, "a belief sums to 1");
    return belief;
}

Node& node_of(Tree& tree, Index number) {
    if (number < 0 || static_cast<std::size_t>(number) >= tree.nodes.size()) throw nb::index_error("there is no such node");
    return tree.nodes[static_cast<std::size_t>(number)];
}

Branch& branch_of(Tree& tree, Index number, Index action) {
    Node& node = node_of(tree, number);
    if (action < 0 || action >= tree.model.actions) throw nb::index_error("there is no such action");
    return node.branches[static_cast<std::size_t>(action)];
}

auto of_branches(Tree& tree, Index number, double Branch::*field) {
    std::vector<double> found;
    for (const Branch& branch : node_of(tree, number).branches) found.push_back(branch.*field);
    return made(found, {found.size()});
}

VectorSet& set_of(Tree& tree, std::size_t group) {
    if (group >= tree.sets.size()) throw nb::index_error("there is no such group");
    return tree.sets[group];
}

// A table of actions by states that is worked out for some seconds, while other threads run.
template <typename Work>
auto timed(const Model& model, double tolerance, double seconds, Work work) {
    expect_limits(tolerance, seconds);
    std::vector<double> found;
    {
        nb::gil_scoped_release released;
        Clock clock(seconds, interrupt);
        found = work(clock);
    }
    return by_action(model, std::move(found));
}

}  // namespace

NB_MODULE(_native, m) {
    m.doc() = "C++ kernels of the planner; lcorpp.planning.sarsop has their numpy twins.";
    const auto free = nb::call_guard<nb::gil_scoped_release>();

    nb::class_<Model>(m, "Model")
        .def(
            "__init__",
            [](Model* self, Index actions, Index states, Index observations, Given<std::int64_t, 1> t_begins,
               Given<Index, 1> t_column, Given<double, 1> t_value, Given<std::int64_t, 1> o_begins, Given<Index, 1> o_column,
               Given<double, 1> o_value, Given<double, 2> reward, double discount) {
                expect(discount > 0 && discount < 1, "the discount is between 0 and 1, both excluded");
                expect(actions > 0 && states > 0 && reward.shape(0) == static_cast<std::size_t>(actions) &&
                           reward.shape(1) == static_cast<std::size_t>(states),
                       "expected rewards of actions by states");
                expect_finite(reward, "expected rewards that are finite");
                new (self) Model(rows_of(actions, states, states, t_begins, t_column, t_value),
                                 rows_of(actions, states, observations, o_begins, o_column, o_value), copied(reward), discount);
            },
            // Numbers of states are never converted: one beyond 32 bits would come to stand for another.
            "actions"_a, "states"_a, "observations"_a, "t_begins"_a.noconvert(), "t_column"_a.noconvert(), "t_value"_a,
            "o_begins"_a.noconvert(), "o_column"_a.noconvert(), "o_value"_a, "reward"_a, "discount"_a)
        .def("blocks", [](const Model& model) {
            return made(model.block, {model.block.size()});
        });

    m.def("blind_policies", [](const Model& model, double tolerance, double seconds) {
        return timed(model, tolerance, seconds, [&](Clock& clock) { return blind_policies(model, tolerance, clock); });
    });
    m.def("mdp_bound", [](const Model& model, double tolerance, double seconds) {
        return timed(model, tolerance, seconds, [&](Clock& clock) { return mdp_bound(model, tolerance, clock); });
    });
    m.def("fast_informed_bound", [](const Model& model, Given<double, 2> Q, double tolerance, double seconds) {
        std::vector<double> start = table_of(model, Q);
        return timed(model, tolerance, seconds,
                     [&](Clock& clock) { return fast_informed_bound(model, std::move(start), tolerance, clock); });
    });

    nb::class_<Prediction>(m, "Prediction")
        .def("__init__",
             [](Prediction* self, Given<double, 1> corners) {
                 expect(corners.size() > 0, "there are no corners");
                 expect_finite(corners, "expected corners that are finite");
                 new (self) Prediction(copied(corners));
             })
        .def("learn", [](Prediction& prediction, Tree& tree, Index number) { prediction.learn(node_of(tree, number)); })
        .def("value",
             [](const Prediction& prediction, Tree& tree, Index number) { return prediction.value(node_of(tree, number)); });

    nb::class_<Tree>(m, "Tree")
        .def(
            "__init__",
            [](Tree* self, const Model& model, Given<double, 2> informed, Given<double, 2> blind) {
                new (self) Tree(model, table_of(model, informed), table_of(model, blind));
            },
            nb::keep_alive<1, 2>())
        .def("node", [](Tree& tree, Given<double, 1> belief) { return tree.node(belief_of(tree.model, belief)); })
        .def("child",
             [](Tree& tree, Index number, Index action, std::size_t child) {
                 Branch& branch = branch_of(tree, number, action);
                 if (child >= branch.children.size()) throw nb::index_error("there is no such child");
                 return tree.child(number, action, child);
             })
        .def("refresh", [](Tree& tree, Index number) { node_of(tree, number), tree.refresh(number); }, free)
        .def("backup", [](Tree& tree, Index number) { node_of(tree, number), tree.backup(number); }, free)
        .def("lower_at", [](Tree& tree, Index number) { return node_of(tree, number), tree.lower_at(number); })
        .def("upper_at", [](Tree& tree, Index number) { return node_of(tree, number), tree.upper_at(number); })
 .def("look", [](Tree& tree, Index number, bool below) { return node_of(tree, number), tree.look(number, below); }, free)
        .def("low", [](Tree& tree, Index number) { return node_of(tree, number).low; })
        .def("high", [](Tree& tree, Index number) { return node_of(tree, number).high; })
        .def("q_lower", [](Tree& tree, Index number) { return of_branches(tree, number, &Branch::lower); })
        .def("q_upper", [](Tree& tree, Index number) { return of_branches(tree, number, &Branch::upper); })
        .def("immediate", [](Tree& tree, Index number) { return of_branches(tree, number, &Branch::immediate); })
        .def("belief",
             [](Tree& tree, Index number) {
                 std::vector<double> belief(static_cast<std::size_t>(tree.model.states), 0.0);
                 const Weights& weights = node_of(tree, number).belief;
                 for (std::size_t i = 0; i < weights.size(); ++i) {
                     belief[static_cast<std::size_t>(weights.state[i])] = weights.weight[i];
                 }
                 return made(belief, {belief.size()});
             })
        .def("children",
             [](Tree& tree, Index number, Index action) {
                 std::vector<Index> observation, link;
                 std::vector<double> probability, lower, upper;
                 for (const Child& child : branch_of(tree, number, action).children) {
                     observation.push_back(child.observation);
                     link.push_back(child.link);
                     probability.push_back(child.probability);
                     lower.push_back(child.lower);
                     upper.push_back(child.upper);
                 }
                 const std::size_t n = observation.size();
                 return std::make_tuple(made(observation, {n}), made(probability, {n}), made(lower, {n}), made(upper, {n}),
                                        made(link, {n}));
             })
        .def(
            "trial",
            [](Tree& tree, Prediction& prediction, Index root, double target, std::size_t depth, double seconds,
               bool greedy_below) {
                node_of(tree, root);
                expect(target >= 0 && !std::isnan(seconds), "target and seconds are numbers, the target not negative");
                Clock clock(seconds, interrupt);
                return run_trial(tree, prediction, root, Trial{target, depth, greedy_below}, clock);
            },
            free)
        .def(
            "prune",
            [](Tree& tree, const std::vector<Index>& roots, double delta, double cap, double growth) {
                for (const Index root : roots) node_of(tree, root);
                expect(delta >= 0 && cap >= 0 && growth >= 0, "delta, cap and growth are numbers, not negative");
                tree.prune(roots, delta, cap, growth);
            },
            free)
        .def("add_vectors",
             [](Tree& tree, std::size_t group, Given<double, 2> vectors, Given<Index, 1> actions) {
                 const std::size_t states = set_of(tree, group).states();
                 expect(vectors.shape(1) == states && vectors.shape(0) == actions.shape(0), "vectors of another group");
                 expect_finite(vectors, "expected vectors that are finite");
                 for (std::size_t k = 0; k < vectors.shape(0); ++k) {
                     const Index action = actions.data()[k];
                     if (action < 0 || action >= tree.model.actions) throw nb::index_error("there is no such action");
                 }
                 for (std::size_t k = 0; k < vectors.shape(0); ++k) {
                     const double* row = vectors.data() + k * states;
                     tree.add_vector(static_cast<Index>(group), std::vector<double>(row, row + states), actions.data()[k]);
                 }
             },
             "group"_a, "vectors"_a, "actions"_a.noconvert())
        .def("add_points",
             [](Tree& tree, Given<std::int64_t, 1> begins, Given<Index, 1> states, Given<double, 1> weights,
                Given<double, 1> values) {
                 const std::size_t count = values.size(), entries = states.size();
                 expect(begins.size() == count + 1 && weights.size() == entries && begins.data()[0] == 0 &&
                            begins.data()[count] == static_cast<std::int64_t>(entries),
                        "the points do not add up");
                 expect_finite(values, "expected values that are finite");
                 std::vector<Weights> beliefs(count);
                 for (std::size_t k = 0; k < count; ++k) {
                     const std::int64_t begin = begins.data()[k], end = begins.data()[k + 1];
                     expect(begin < end && end <= static_cast<std::int64_t>(entries), "a point without states");
                     Weights& belief = beliefs[k];
                     double total = 0.0;
                     for (std::int64_t i = begin; i < end; ++i) {
                         const Index s = states.data()[i];
                         expect(s >= 0 && s < tree.model.states && weights.data()[i] > 0 &&
                                    (i == begin || s > states.data()[i - 1]),
                                "a point has rising states with positive weights");
                         belief.state.push_back(s);
                         belief.weight.push_back(weights.data()[i]);
                         total += weights.data()[i];
                     }
                     expect(std::abs(total - 1) <= kSumTolerance, "a belief sums to 1");
                 }
                 for (std::size_t k = 0; k < count; ++k) tree.add_point(beliefs[k], values.data()[k]);
             },
             "begins"_a.noconvert(), "states"_a.noconvert(), "weights"_a, "values"_a)
        .def("points",
             [](Tree& tree) {
                 std::vector<std::int64_t> begins{0};
                 std::vector<Index> states;
                 std::vector<double> weights, values;
                 tree.sawtooth.each([&](const auto& support, const auto& inverses, double value, Index) {
                     std::vector<std::pair<Index, double>> entries;
                     for (std::size_t i = 0; i < support.size(); ++i) entries.emplace_back(support[i], 1.0 / inverses[i]);
                     std::sort(entries.begin(), entries.end());
                     for (const auto& [state, weight] : entries) {
                         states.push_back(state);
                         weights.push_back(weight);
                     }
                     begins.push_back(static_cast<std::int64_t>(states.size()));
                     values.push_back(value);
                 });
                 const std::vector<double> corners = tree.sawtooth.corners();
                 return std::make_tuple(made(corners, {corners.size()}), made(begins, {begins.size()}),
                                        made(states, {states.size()}), made(weights, {weights.size()}),
                                        made(values, {values.size()}));
             })
        .def_prop_ro("discount", [](const Tree& tree) { return tree.model.discount; })
        .def_prop_ro("vector_count", &Tree::vectors)
        .def_prop_ro("point_count", [](const Tree& tree) { return tree.sawtooth.count(); })
        .def_prop_ro("node_count", [](const Tree& tree) { return tree.nodes.size(); })
        .def_prop_ro("groups", [](const Tree& tree) { return tree.sets.size(); })
        .def("vectors", [](Tree& tree, std::size_t group) {
            const VectorSet& set = set_of(tree, group);
            std::vector<double> table;
            std::vector<Index> actions;
            for (std::size_t row = 0; row < set.count(); ++row) {
                actions.push_back(set.action(row));
                for (std::size_t s = 0; s < set.states(); ++s) table.push_back(set.at(row, s));
            }
            return std::make_tuple(made(tree.states_of(static_cast<Index>(group)), {set.states()}),
                                   made(std::move(table), {set.count(), set.states()}), made(actions, {set.count()}));
        })
        .def("origins", [](Tree& tree, std::size_t group) {
            const std::size_t states = set_of(tree, group).states();
            std::vector<double> table;
            std::vector<Index> actions;
            for (const Origins::Retired* needed : tree.origins.needed(tree.sets)) {
                if (static_cast<std::size_t>(needed->group) != group) continue;
                actions.push_back(needed->action);
                table.insert(table.end(), needed->values.begin(), needed->values.end());
            }
            const std::size_t count = actions.size();
            return std::make_tuple(made(std::move(table), {count, states}), made(std::move(actions), {count}));
        });
}
