// Python bindings of the belief tree.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <cmath>
#include <utility>
#include <vector>

#include "arguments.hpp"
#include "graph/belief_graph.hpp"
#include "bindings.hpp"
#include "exports.hpp"
#include "path_sampling.hpp"
#include "tree.hpp"

namespace lcorpp {

using namespace nb::literals;

namespace {

// (A,) a field of each branch of a node.
auto collect_branches(Tree& tree, Index node, double Branch::*field) {
    std::vector<double> values;
    for (const Branch& branch : get_node(tree, node).branches) values.push_back(branch.*field);
    return make_array(std::move(values));
}

}  // namespace

void bind_tree(nb::module_& m) {
    const auto without_gil = nb::call_guard<nb::gil_scoped_release>();
    nb::class_<Tree>(m, "Tree", R"(Beliefs, numbered in order of creation, and the two bounds that they share.

One thread at a time: methods that search release the interpreter lock, and other threads must not use the same
tree meanwhile.

Raises:
    IndexError: a node, action, child or group does not exist.
    ValueError, TypeError: an array has a wrong shape or type, or a number is invalid.

Source: Kurniawati, Hsu and Lee, RSS 2008, sections III and IV.)")
        .def(
            "__init__",
            [](Tree* self, const Model& model, InputArray<double, 2> informed, InputArray<double, 2> blind) {
                new (self) Tree(model, copy_table(model, informed), copy_table(model, blind));
            },
            nb::keep_alive<1, 2>(), "model"_a, "informed"_a, "blind"_a,
            "Make a tree without nodes, with (A, S) upper bounds on the Q values and (A, S) values of the blind policies.")
        .def(
            "add_potential",
            [](Tree& tree, InputArray<double, 1> offset, double scale, double power, double entropy, InputArray<Index, 2> pairs,
               InputArray<double, 1> pair_weights, Index state) {
                Potential potential = make_potential(tree.model, offset, scale, power, entropy, pairs, pair_weights);
                require(state >= -1 && state < tree.model.states, "the state of the block is unknown");
                if (state >= 0) potential.block = tree.model.block[as_size(state)];
                tree.sawtooth.add_potential(std::move(potential));
            },
            "offset"_a, "scale"_a, "power"_a, "entropy"_a, "pairs"_a.noconvert(), "pair_weights"_a, "state"_a,
            R"(Add the upper bound offset.b + scale N(b) - entropy H(b) - sum of weight sqrt(b(s) b(t)).

Args:
    offset: (S,). scale, power: of the norm N(b) = (sum of b(s)^power)^(1 / power). entropy: of the entropy in nats.
    pairs: (n, 2) states s and t. pair_weights: (n,).
    state: the bound holds at beliefs within the block of this state; -1: within any block.)")
        .def(
            "add_graph",
            [](Tree& tree, const std::vector<std::vector<Index>>& symmetries) {
                for (const std::vector<Index>& image : symmetries) {
                    require(image.size() == as_size(tree.model.states), "a symmetry needs one state for each state");
                    for (const Index s : image) require(s >= 0 && s < tree.model.states, "a symmetry has an unknown state");
                }
                tree.graph = std::make_unique<BeliefGraph>(tree, Renamings(tree.model.states, symmetries));
                if (!symmetries.empty()) tree.sawtooth.set_renamings(&tree.graph->renamings());
            },
            "symmetries"_a, "Make the graph of beliefs, in which those that a symmetry of the model renames are one.")
        .def(
            "search_graph",
            [](Tree& tree, Index root, double share, double min_target, std::uint64_t max_work, double seconds) {
                require(tree.graph != nullptr, "the tree has no graph");
                const Weights belief = get_node(tree, root).belief;
                Clock clock(seconds, check_interrupt);
                return tree.graph->search(belief, share, min_target, max_work, clock);
            },
            without_gil, "root"_a, "share"_a, "min_target"_a, "max_work"_a, "seconds"_a,
            R"(Lower the upper bound at a root by trials in the graph of beliefs; return the number of beliefs expanded.

Args:
    share, min_target: a trial aims at this share of the gap at the root, or at the smallest target.
    max_work: largest work of the trials, about, in the unit of `work`.
    seconds: of wall-clock time, after which they end early.)")
        .def_prop_ro("graph_memory", [](const Tree& tree) { return tree.graph ? tree.graph->memory_size() : 0; },
                     "Memory of the graph of beliefs in bytes.")
        .def_prop_ro("work", &Tree::work, "The numbers of vectors, points and beliefs that have been read so far.")
        .def_prop_ro("discount", [](const Tree& tree) { return tree.model.discount; }, "gamma.")
        .def_prop_ro("node_count", [](const Tree& tree) { return tree.nodes.size(); }, "The number of beliefs.")
        .def_prop_ro("vector_count", &Tree::vector_count, "The number of alpha vectors in all groups.")
        .def_prop_ro("made_count", &Tree::made_count,
                     "The number of alpha vectors that were ever made, by backups or otherwise.")
        .def_prop_ro("node_memory", &Tree::node_memory,
                     "Memory of the beliefs and of what is stored about them, in bytes.")
        .def_prop_ro("bound_memory", &Tree::bound_memory, "Memory of the alpha vectors and points, in bytes.")
        .def("clear_nodes", &Tree::clear_nodes, "Remove all nodes, also those of the graph, but keep the vectors and points.")
        .def("drop_older_points", &Tree::drop_older_points,
             "Remove the older half of the points: those that no backup has lowered for the longest time.")
        .def_prop_ro("point_count", [](const Tree& tree) { return tree.sawtooth.count(); },
                     "The number of points of the upper bound.")
        .def_prop_ro("group_count", [](const Tree& tree) { return tree.sets.size(); }, "The number of groups.")
        .def(
            "find_or_add_node", [](Tree& tree, InputArray<double, 1> belief) { return tree.find_or_add_node(make_belief(tree.model, belief)); },
            "belief"_a, "Return the node of a belief (S,), created if necessary.")
        .def(
            "find_or_add_child",
            [](Tree& tree, Index node, Index action, std::size_t child) {
                if (child >= get_branch(tree, node, action).children.size()) throw nb::index_error("unknown child");
                return tree.find_or_add_child(node, action, child);
            },
            "node"_a, "action"_a, "child"_a,
            "Return the node of a child, given by its index in `children`, created if necessary.")
        .def(
            "refresh", [](Tree& tree, Index node) { get_node(tree, node), tree.refresh(node); }, without_gil, "node"_a,
            "Update the bounds of a node with the vectors and points since its last visit.")
        .def(
            "select_action",
            [](Tree& tree, Index node, bool use_lower_bound) {
                return get_node(tree, node), tree.select_action(node, use_lower_bound);
            },
            without_gil, "node"_a, "use_lower_bound"_a,
            "Return the best action by the upper or lower bound, after an update of that action's bounds.")
        .def(
            "backup", [](Tree& tree, Index node) { get_node(tree, node), tree.backup(node); }, without_gil, "node"_a,
            R"(Add the best alpha vector at a node and lower the upper bound there.

Source: Kurniawati, Hsu and Lee, RSS 2008, algorithm 3 (BACKUP).)")
        .def(
            "sample",
            [](Tree& tree, ValuePredictor& predictor, Index root, double target, std::size_t max_depth, double seconds,
               bool use_lower_bound) {
                get_node(tree, root);
                require(target >= 0 && !std::isnan(seconds), "target and seconds must not be NaN, target not negative");
                Clock clock(seconds, check_interrupt);
                return sample(tree, predictor, root, SampleOptions{target, max_depth, use_lower_bound}, clock);
            },
            without_gil, "predictor"_a, "root"_a, "target"_a, "max_depth"_a, "seconds"_a, "use_lower_bound"_a,
            R"(Sample a path from a root towards the beliefs whose bounds matter most there, and back up its nodes.

The path continues while a node's gap may matter at the root (gap termination), or while the predicted value
shows that the lower bound may still rise there (selective deep sampling). The backups begin at its end.

Args:
    predictor: predicts the value of a node; it learns from the path.
    target: gap wanted at the root, in reward units; a node t steps down may keep target / gamma^t.
    max_depth: largest number of nodes on the path.
    seconds: of wall-clock time, after which the method ends early.
    use_lower_bound: follow the best action of the lower bound instead of the upper bound.

Returns:
    The number of nodes on the path.

Source: Kurniawati, Hsu and Lee, RSS 2008, algorithm 2 (SAMPLE, SAMPLEPOINTS).)")
        .def(
            "prune",
            [](Tree& tree, const std::vector<Index>& roots, double radius, double max_ratio, double growth) {
                for (const Index root : roots) get_node(tree, root);
                require(radius >= 0 && max_ratio >= 0 && growth >= 0,
                        "radius, max_ratio and growth must be numbers, not negative");
                tree.prune(roots, radius, max_ratio, growth);
            },
            without_gil, "roots"_a, "radius"_a, "max_ratio"_a, "growth"_a,
            R"(Keep the vectors that are best, or nearly best, at a belief that the roots may reach.

Args:
    radius: of delta-dominance, in the space of beliefs.
    max_ratio: at most this many times the vectors that are best at a belief are kept.
    growth: a group is pruned if it has this many times the vectors after its last pruning, and 100 more.

Source: Kurniawati, Hsu and Lee, RSS 2008, section III-D.)")
        .def(
            "compress",
            [](Tree& tree, const std::vector<Index>& roots, double max_evaluations, double seconds) {
                for (const Index root : roots) get_node(tree, root);
                require(max_evaluations >= 0 && !std::isnan(seconds),
                        "max_evaluations and seconds must not be NaN, max_evaluations not negative");
                Clock clock(seconds, check_interrupt);
                return tree.compress(roots, max_evaluations, clock);
            },
            without_gil, "roots"_a, "max_evaluations"_a, "seconds"_a,
            R"(Replace the vectors by those of a smaller controller if the bounds at the roots stay as good.

The pruned vectors that others depend on are mostly older versions of plans. Where a vector of the set is no worse
for the states in which the plans of the roots reach such a version, it replaces it. Plans may then lead back to
themselves, so all values are computed anew.

Args:
    max_evaluations: about as many vectors are computed at most; nothing is replaced if the values are not
        accurate then.
    seconds: wall-clock time limit; afterwards nothing is replaced.

Returns:
    Whether the vectors were replaced.

Sources: Hansen, "Solving POMDPs by searching in policy space", UAI 1998; Grzes, Poupart, Yang and Hoey, "Energy
efficient execution of POMDP policies", IEEE Transactions on Cybernetics 2015.)")
        .def(
            "lower_bound", [](Tree& tree, Index node) { return get_node(tree, node), tree.lower_bound(node); }, "node"_a,
            "Return the value of the best alpha vector at a node, of all current vectors.")
        .def(
            "upper_bound", [](Tree& tree, Index node) { return get_node(tree, node), tree.upper_bound(node); }, "node"_a,
            "Return the upper bound at a node by all current points, or the node's own if that is smaller.")
        .def(
            "cached_lower", [](Tree& tree, Index node) { return get_node(tree, node).lower; }, "node"_a,
            "Return the lower bound of a node at its last update.")
        .def(
            "cached_upper", [](Tree& tree, Index node) { return get_node(tree, node).upper; }, "node"_a,
            "Return the upper bound of a node at its last update.")
        .def(
            "q_lower", [](Tree& tree, Index node) { return collect_branches(tree, node, &Branch::lower); }, "node"_a,
            "Return (A,) lower bounds on the values of the actions, at their last update.")
        .def(
            "q_upper", [](Tree& tree, Index node) { return collect_branches(tree, node, &Branch::upper); }, "node"_a,
            "Return (A,) upper bounds on the values of the actions, at their last update.")
        .def(
            "expected_rewards", [](Tree& tree, Index node) { return collect_branches(tree, node, &Branch::expected_reward); },
            "node"_a, "Return (A,) expected rewards of the actions.")
        .def(
            "belief",
            [](Tree& tree, Index node) {
                std::vector<double> dense(as_size(tree.model.states), 0.0);
                const Weights& belief = get_node(tree, node).belief;
                for (std::size_t i = 0; i < belief.size(); ++i) dense[as_size(belief.state[i])] = belief.weight[i];
                return make_array(std::move(dense));
            },
            "node"_a, "Return (S,) the belief of a node.")
        .def(
            "children", [](Tree& tree, Index node, Index action) { return export_children(get_branch(tree, node, action)); },
            "node"_a, "action"_a,
            R"(Return five arrays (n,): each child's observation, probability, bounds times probability, and node.

The node is -1 before the first visit. There are no children before the first update of the action.)")
        .def("vectors", &export_vectors, "group"_a, "with_pruned"_a = false,
            R"(Return the states (n,) of a group, its alpha vectors (K, n) and their plans' first actions (K,).

Args:
    with_pruned: whether the pruned vectors that others depend on follow.)")
        .def(
            "points", [](Tree& tree) { return export_points(tree.sawtooth); },
            R"(Return the upper bound: corners (S,), and begins, states, weights and values of K points.

begins: (K + 1,). states, weights: (entries,). values: (K,). Point k is a belief with the states and weights from
begins[k] to before begins[k + 1], and an upper bound on the value at that belief.)")
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
            "group"_a, "vectors"_a, "actions"_a.noconvert(),
            "Import alpha vectors (K, n) over the states of a group, and the first actions (K,) of their plans.")
        .def(
            "add_points",
            [](Tree& tree, InputArray<std::int64_t, 1> begins, InputArray<Index, 1> states, InputArray<double, 1> weights,
               InputArray<double, 1> values) {
                const std::vector<Weights> beliefs = make_beliefs(tree.model, begins, states, weights, values.size());
                require_finite(values, "expected finite values");
                for (std::size_t k = 0; k < values.size(); ++k) tree.add_point(beliefs[k], values.data()[k]);
            },
            "begins"_a.noconvert(), "states"_a.noconvert(), "weights"_a, "values"_a,
            "Import points in the form of `points`.");
}

}  // namespace lcorpp
