// Python bindings of the planner's kernels: lcorpp.planning._native. lcorpp.planning.sarsop.kernel_protocols documents
// each class and function; `make stubs` writes the stub from these bindings.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "arguments.hpp"
#include "bounds.hpp"
#include "exports.hpp"
#include "model.hpp"
#include "path_sampling.hpp"
#include "reachable_blocks.hpp"
#include "tree.hpp"

using namespace lcorpp;
using namespace nb::literals;

namespace {

// Raises KeyboardInterrupt after Ctrl-C.
void check_interrupt() {
    nb::gil_scoped_acquire gil;
    if (PyErr_CheckSignals() != 0) throw nb::python_error();
}

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

// (A,) a field of each branch of a node.
auto collect_branches(Tree& tree, Index node, double Branch::*field) {
    std::vector<double> values;
    for (const Branch& branch : get_node(tree, node).branches) values.push_back(branch.*field);
    return make_array(std::move(values));
}

void bind_model(nb::module_& m) {
    nb::class_<Model>(m, "Model")
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
            "observation_columns"_a.noconvert(), "observation_values"_a, "reward"_a, "discount"_a)
        .def("export_blocks", [](const Model& model) { return make_array(model.block); });
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
        "model"_a, "begins"_a.noconvert(), "states"_a.noconvert());
}

void bind_bounds(nb::module_& m) {
    m.def(
        "blind_policies",
        [](const Model& model, double tolerance, double seconds) {
            return run_timed(model, tolerance, seconds, [&](Clock& clock) { return blind_policies(model, tolerance, clock); });
        },
        "model"_a, "tolerance"_a, "seconds"_a);
    m.def(
        "mdp_bound",
        [](const Model& model, double tolerance, double seconds) {
            return run_timed(model, tolerance, seconds, [&](Clock& clock) { return mdp_bound(model, tolerance, clock); });
        },
        "model"_a, "tolerance"_a, "seconds"_a);
    m.def(
        "fast_informed_bound",
        [](const Model& model, InputArray<double, 2> Q, double tolerance, double seconds) {
            std::vector<double> start = copy_table(model, Q);
            return run_timed(model, tolerance, seconds,
                             [&](Clock& clock) { return fast_informed_bound(model, std::move(start), tolerance, clock); });
        },
        "model"_a, "Q"_a, "tolerance"_a, "seconds"_a);
}

void bind_predictor(nb::module_& m) {
    nb::class_<ValuePredictor>(m, "ValuePredictor")
        .def(
            "__init__",
            [](ValuePredictor* self, InputArray<double, 1> corners) {
                require(corners.size() > 0, "expected at least one corner");
                require_finite(corners, "expected finite corners");
                new (self) ValuePredictor(copy(corners));
            },
            "corners"_a)
        .def(
            "learn", [](ValuePredictor& predictor, Tree& tree, Index node) { predictor.learn(get_node(tree, node)); },
            "tree"_a, "node"_a)
        .def(
            "predict",
            [](const ValuePredictor& predictor, Tree& tree, Index node) { return predictor.predict(get_node(tree, node)); },
            "tree"_a, "node"_a);
}

void bind_tree(nb::module_& m) {
    const auto without_gil = nb::call_guard<nb::gil_scoped_release>();
    nb::class_<Tree>(m, "Tree")
        .def(
            "__init__",
            [](Tree* self, const Model& model, InputArray<double, 2> informed, InputArray<double, 2> blind) {
                new (self) Tree(model, copy_table(model, informed), copy_table(model, blind));
            },
            nb::keep_alive<1, 2>(), "model"_a, "informed"_a, "blind"_a)
        .def_prop_ro("discount", [](const Tree& tree) { return tree.model.discount; })
        .def_prop_ro("node_count", [](const Tree& tree) { return tree.nodes.size(); })
        .def_prop_ro("vector_count", &Tree::vector_count)
        .def_prop_ro("made_count", &Tree::made_count)
        .def_prop_ro("node_memory", &Tree::node_memory)
        .def_prop_ro("bound_memory", &Tree::bound_memory)
        .def("clear_nodes", &Tree::clear_nodes)
        .def("drop_older_points", &Tree::drop_older_points)
        .def_prop_ro("point_count", [](const Tree& tree) { return tree.sawtooth.count(); })
        .def_prop_ro("group_count", [](const Tree& tree) { return tree.sets.size(); })
        .def(
            "find_or_add_node", [](Tree& tree, InputArray<double, 1> belief) { return tree.find_or_add_node(make_belief(tree.model, belief)); },
            "belief"_a)
        .def(
            "find_or_add_child",
            [](Tree& tree, Index node, Index action, std::size_t child) {
                if (child >= get_branch(tree, node, action).children.size()) throw nb::index_error("unknown child");
                return tree.find_or_add_child(node, action, child);
            },
            "node"_a, "action"_a, "child"_a)
        .def(
            "refresh", [](Tree& tree, Index node) { get_node(tree, node), tree.refresh(node); }, without_gil, "node"_a)
        .def(
            "select_action",
            [](Tree& tree, Index node, bool use_lower_bound) {
                return get_node(tree, node), tree.select_action(node, use_lower_bound);
            },
            without_gil, "node"_a, "use_lower_bound"_a)
        .def(
            "backup", [](Tree& tree, Index node) { get_node(tree, node), tree.backup(node); }, without_gil, "node"_a)
        .def(
            "sample",
            [](Tree& tree, ValuePredictor& predictor, Index root, double target, std::size_t max_depth, double seconds,
               bool use_lower_bound) {
                get_node(tree, root);
                require(target >= 0 && !std::isnan(seconds), "target and seconds must not be NaN, target not negative");
                Clock clock(seconds, check_interrupt);
                return sample(tree, predictor, root, SampleOptions{target, max_depth, use_lower_bound}, clock);
            },
            without_gil, "predictor"_a, "root"_a, "target"_a, "max_depth"_a, "seconds"_a, "use_lower_bound"_a)
        .def(
            "prune",
            [](Tree& tree, const std::vector<Index>& roots, double radius, double max_ratio, double growth) {
                for (const Index root : roots) get_node(tree, root);
                require(radius >= 0 && max_ratio >= 0 && growth >= 0,
                        "radius, max_ratio and growth must be numbers, not negative");
                tree.prune(roots, radius, max_ratio, growth);
            },
            without_gil, "roots"_a, "radius"_a, "max_ratio"_a, "growth"_a)
        .def(
            "compress",
            [](Tree& tree, const std::vector<Index>& roots, double max_evaluations, double seconds) {
                for (const Index root : roots) get_node(tree, root);
                require(max_evaluations >= 0 && !std::isnan(seconds),
                        "max_evaluations and seconds must not be NaN, max_evaluations not negative");
                Clock clock(seconds, check_interrupt);
                return tree.compress(roots, max_evaluations, clock);
            },
            without_gil, "roots"_a, "max_evaluations"_a, "seconds"_a)
        .def(
            "lower_bound", [](Tree& tree, Index node) { return get_node(tree, node), tree.lower_bound(node); }, "node"_a)
        .def(
            "upper_bound", [](Tree& tree, Index node) { return get_node(tree, node), tree.upper_bound(node); }, "node"_a)
        .def("cached_lower", [](Tree& tree, Index node) { return get_node(tree, node).lower; }, "node"_a)
        .def("cached_upper", [](Tree& tree, Index node) { return get_node(tree, node).upper; }, "node"_a)
        .def("q_lower", [](Tree& tree, Index node) { return collect_branches(tree, node, &Branch::lower); }, "node"_a)
        .def("q_upper", [](Tree& tree, Index node) { return collect_branches(tree, node, &Branch::upper); }, "node"_a)
        .def(
            "expected_rewards", [](Tree& tree, Index node) { return collect_branches(tree, node, &Branch::expected_reward); },
            "node"_a)
        .def(
            "belief",
            [](Tree& tree, Index node) {
                std::vector<double> dense(as_size(tree.model.states), 0.0);
                const Weights& belief = get_node(tree, node).belief;
                for (std::size_t i = 0; i < belief.size(); ++i) dense[as_size(belief.state[i])] = belief.weight[i];
                return make_array(std::move(dense));
            },
            "node"_a)
        .def(
            "children", [](Tree& tree, Index node, Index action) { return export_children(get_branch(tree, node, action)); },
            "node"_a, "action"_a)
        .def("vectors", &export_vectors, "group"_a, "with_pruned"_a = false)
        .def("points", [](Tree& tree) { return export_points(tree.sawtooth); })
        .def(
            "add_vectors",
            [](Tree& tree, std::size_t group, InputArray<double, 2> vectors, InputArray<Index, 1> actions) {
                const std::size_t states = get_set(tree, group).states();
                require(vectors.shape(1) == states && vectors.shape(0) == actions.shape(0),
                        "the vectors do not fit the states of the group or the actions");
                require_finite(vectors, "expected finite vectors");
                for (std::size_t k = 0; k < vectors.shape(0); ++k) {
                    const Index action = actions.data()[k];
                    if (action < 0 || action >= tree.model.actions) throw nb::index_error("unknown action");
                }
                for (std::size_t k = 0; k < vectors.shape(0); ++k) {
                    const double* row = vectors.data() + k * states;
                    tree.add_vector(static_cast<Index>(group), std::vector<double>(row, row + states), actions.data()[k]);
                }
            },
            "group"_a, "vectors"_a, "actions"_a.noconvert())
        .def(
            "add_points",
            [](Tree& tree, InputArray<std::int64_t, 1> begins, InputArray<Index, 1> states, InputArray<double, 1> weights,
               InputArray<double, 1> values) {
                const std::vector<Weights> beliefs = make_beliefs(tree.model, begins, states, weights, values.size());
                require_finite(values, "expected finite values");
                for (std::size_t k = 0; k < values.size(); ++k) tree.add_point(beliefs[k], values.data()[k]);
            },
            "begins"_a.noconvert(), "states"_a.noconvert(), "weights"_a, "values"_a);
}

}  // namespace

NB_MODULE(_native, m) {
    m.doc() = "C++ kernels of the planner, documented by lcorpp.planning.sarsop.kernel_protocols. `make stubs` generates the stub.";
    bind_model(m);
    bind_bounds(m);
    bind_predictor(m);
    bind_tree(m);
}
