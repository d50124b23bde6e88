// Python bindings: lcorpp.reasoning._diagram. `make stubs` writes the stub from them.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <memory>
#include <new>
#include <optional>
#include <set>
#include <stdexcept>
#include <tuple>

#include "arrays.hpp"
#include "interrupt.hpp"
#include "layer_builder.hpp"
#include "order_search.hpp"

using namespace lcorpp;
using namespace nb::literals;

namespace {

using Indices = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Numbers = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Codes = nb::ndarray<const std::int64_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Table = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Column = std::pair<int, Table>;
using Position = std::tuple<int, int, int, std::vector<Index>, std::vector<Index>>;
using StoredLayer = std::tuple<int, std::tuple<std::size_t, std::size_t, std::size_t>, std::vector<std::pair<std::size_t, Indices>>,
                               Indices, Indices, Indices, Numbers, Indices>;

std::vector<Word> read_bits(const nb::bytes& bits, std::size_t n_words) {
    if (bits.size() != 8 * n_words) throw std::invalid_argument("bits of a wrong length");
    std::vector<Word> words(n_words);
    if (n_words) std::memcpy(words.data(), bits.c_str(), bits.size());
    return words;
}

nb::bytes write_bits(const Word* words, std::size_t n_words) { return nb::bytes(reinterpret_cast<const char*>(words), 8 * n_words); }

std::vector<Implication> read_implications(const std::vector<std::tuple<int, int, int>>& implications, std::size_t n_bits, int n_atoms) {
    std::vector<Implication> read;
    for (const auto& [bit, body, head] : implications) {
        if (bit >= static_cast<int>(n_bits) || body < 0 || body >= n_atoms || head < 0 || head >= n_atoms) {
            throw std::invalid_argument("an implication out of range");
        }
        read.push_back({bit, body, head});
    }
    return read;
}

template <typename T>
OutputArray<std::int64_t> export_indices(const std::vector<T>& values) {
    return make_array(std::vector<std::int64_t>(values.begin(), values.end()));
}

// The layers of a circuit, with the memory of its passes.
class Layers {
  public:
    explicit Layers(std::vector<Layer> layers) : layers_(std::move(layers)), pass_(layers_) {
        for (const Layer& layer : layers_) {
            is_wide_ |= !layer.exponents.empty();
            for (const double weight : layer.weights) is_wide_ |= weight < min_number;
            work_ += layer.weights.size();
            if (layer.variable < 0) continue;
            const auto variable = static_cast<std::size_t>(layer.variable);
            if (variable >= n_outcomes_.size()) n_outcomes_.resize(variable + 1, 0);
            if (n_outcomes_[variable]) throw std::invalid_argument("two layers of one term");
            n_outcomes_[variable] = layer.n_outcomes;
        }
    }
    Layers(const Layers&) = delete;

    const std::vector<Layer>& layers() const { return layers_; }

    auto weigh(Codes codes, const std::vector<Column>& columns, const std::vector<int>& queries) {
        const std::size_t n_rows = codes.shape(0), n_terms = codes.shape(1);
        std::vector<std::size_t> n_outcomes = n_outcomes_;
        n_outcomes.resize(std::max(n_outcomes.size(), n_terms), 0);
        std::vector<TermEvidence> evidence(n_outcomes.size());  // also of terms that are only queried
        std::vector<const Table*> tables(n_terms, nullptr);
        for (const auto& [variable, table] : columns) {
            if (variable < 0 || static_cast<std::size_t>(variable) >= n_terms || table.shape(1) != n_outcomes[variable]) {
                throw std::invalid_argument("weights of a wrong shape");
            }
            tables[variable] = &table;
        }
        std::vector<std::vector<double>> results;
        for (const int query : queries) {
            check_query(query);
            results.emplace_back(n_rows * n_outcomes[query], 0.0);
        }
        std::vector<double> logarithms(n_rows);
        std::vector<double*> places(queries.size());
        const std::vector<char> leads = find_leads(queries);
        InterruptCheck check;
        for (std::size_t row = 0; row < n_rows; ++row) {
            check(2 * work_);
            for (std::size_t t = 0; t < n_terms; ++t) {
                const std::int64_t code = codes(row, t);
                evidence[t] = {};
                if (tables[t] != nullptr) {
                    if (code < 0 || static_cast<std::size_t>(code) >= tables[t]->shape(0)) throw std::invalid_argument("a label out of range");
                    evidence[t].weights = tables[t]->data() + static_cast<std::size_t>(code) * tables[t]->shape(1);
                } else {
                    evidence[t].code = code;
                }
            }
            for (std::size_t k = 0; k < queries.size(); ++k) places[k] = results[k].data() + row * n_outcomes[queries[k]];
            logarithms[row] = run(evidence, leads, queries, places);
        }
        nb::list arrays;
        for (std::size_t k = 0; k < results.size(); ++k) {
            arrays.append(make_array(std::move(results[k]), {n_rows, n_outcomes[queries[k]]}));
        }
        return nb::make_tuple(arrays, make_array(std::move(logarithms)));
    }

    std::vector<double> weigh_outcomes(int query) {
        check_query(query);
        std::vector<double> result(n_outcomes_[query], 0.0);
        run(std::vector<TermEvidence>(n_outcomes_.size()), find_leads({query}), {query}, {result.data()});
        return result;
    }

    nb::list store() const {
        nb::list stored;
        for (const Layer& layer : layers_) {
            nb::list sources;
            for (const Source& source : layer.sources) sources.append(nb::make_tuple(source.layer, export_indices(source.nodes)));
            stored.append(nb::make_tuple(layer.variable, nb::make_tuple(layer.n_outputs, layer.n_outcomes, layer.n_inputs), sources,
                                         export_indices(layer.first), export_indices(layer.outcomes), export_indices(layer.inputs),
                                         make_array(std::vector<double>(layer.weights)), export_indices(layer.exponents)));
        }
        return stored;
    }

  private:
    void check_query(int query) const {
        if (query < 0 || static_cast<std::size_t>(query) >= n_outcomes_.size() || n_outcomes_[query] == 0) {
            throw std::invalid_argument("a query without a layer");
        }
    }

    // Whether each layer is queried, or one of those before it is.
    std::vector<char> find_leads(const std::vector<int>& queries) const {
        std::vector<char> leads(layers_.size(), 0);
        for (std::size_t i = 0; i < layers_.size(); ++i) {
            leads[i] = std::find(queries.begin(), queries.end(), layers_[i].variable) != queries.end();
            for (const Source& source : layers_[i].sources) leads[i] |= leads[source.layer];
        }
        return leads;
    }

    // Write the weights of the outcomes of the queried terms; return the logarithm of the weight of the evidence.
    double run(const std::vector<TermEvidence>& evidence, const std::vector<char>& leads, const std::vector<int>& queries,
               const std::vector<double*>& results) {
        std::vector<double*> places(layers_.size(), nullptr);
        for (std::size_t i = 0; i < layers_.size(); ++i) {
            const auto at = std::find(queries.begin(), queries.end(), layers_[i].variable);
            if (at != queries.end()) places[i] = results[static_cast<std::size_t>(at - queries.begin())];
        }
        bool is_extreme = is_wide_, is_possible = false;
        double logarithm = 0.0;
        if (!is_extreme) {
            is_possible = pass_.go_up(evidence, logarithm, is_extreme);
            if (is_possible && !is_extreme) pass_.go_down(evidence, leads, places, is_extreme);
        }
        if (is_extreme) {
            if (!wide_) wide_ = std::make_unique<Pass<WideNumber>>(layers_);
            bool ignored = false;
            is_possible = wide_->go_up(evidence, logarithm, ignored);
            if (is_possible) wide_->go_down(evidence, leads, places, ignored);
        }
        return is_possible ? logarithm : -std::numeric_limits<double>::infinity();
    }

    std::vector<Layer> layers_;
    Pass<double> pass_;
    std::unique_ptr<Pass<WideNumber>> wide_;  // when it is first needed
    std::vector<std::size_t> n_outcomes_;     // of each observed term
    std::size_t work_ = 1;
    bool is_wide_ = false;
};

std::vector<Index> read_indices(const Indices& indices, std::size_t size, const char* message) {
    std::vector<Index> read;
    for (std::size_t i = 0; i < indices.shape(0); ++i) {
        const std::int64_t index = indices.data()[i];
        if (index < 0 || static_cast<std::size_t>(index) >= size) throw std::invalid_argument(message);
        read.push_back(static_cast<Index>(index));
    }
    return read;
}

std::vector<Layer> read_layers(const std::vector<StoredLayer>& stored) {
    std::vector<Layer> layers;
    std::vector<char> is_read(stored.size(), 0);
    for (const auto& [variable, shape, sources, first, outcomes, inputs, weights, exponents] : stored) {
        const auto [n_outputs, n_outcomes, n_inputs] = shape;
        Layer layer{variable, n_outputs, n_outcomes, n_inputs, {}, {}, {}, {}, {}, {}};
        if (variable < -1 || variable >= static_cast<int>(stored.size()) || !n_outputs || !n_outcomes || !n_inputs || std::max({n_outputs, n_outcomes, n_inputs}) > no_index / 2) {
            throw std::invalid_argument("a layer has a wrong shape");
        }
        for (const auto& [number, nodes] : sources) {
            if (number >= layers.size() || is_read[number] || nodes.shape(0) != n_inputs) {
                throw std::invalid_argument("a layer does not fit the layers before it");
            }
            is_read[number] = 1;
            layer.sources.push_back({number, read_indices(nodes, layers[number].n_outputs, "a layer has inputs that are no outputs of the layer before it")});
        }
        const std::size_t n_entries = weights.shape(0);
        if ((sources.empty() && n_inputs != 1) || first.shape(0) != n_outputs + 1 || outcomes.shape(0) != n_entries ||
            inputs.shape(0) != n_entries || (exponents.shape(0) != 0 && exponents.shape(0) != n_entries)) {
            throw std::invalid_argument("a layer has a wrong shape");
        }
        layer.first = read_indices(first, n_entries + 1, "a layer has entries out of range");
        if (layer.first.front() != 0 || layer.first.back() != n_entries || !std::is_sorted(layer.first.begin(), layer.first.end())) {
            throw std::invalid_argument("a layer has entries out of range");
        }
        layer.outcomes = read_indices(outcomes, n_outcomes, "a layer has outcomes out of range");
        layer.inputs = read_indices(inputs, n_inputs, "a layer has inputs out of range");
        for (std::size_t k = 0; k < n_entries; ++k) {
            const double weight = weights.data()[k];
            if (!(weight > 0.0 && weight < 1e100)) throw std::invalid_argument("a layer has weights that are not positive");
            layer.weights.push_back(weight);
        }
        for (std::size_t k = 0; k < exponents.shape(0); ++k) {
            const std::int64_t exponent = exponents.data()[k];
            if (exponent > 1000 || exponent < -(std::int64_t{1} << 48)) throw std::invalid_argument("a layer has an exponent out of range");
            layer.exponents.push_back(exponent);
        }
        layers.push_back(std::move(layer));
    }
    if (layers.empty() || layers.back().n_outputs != 1 || std::count(is_read.begin(), is_read.end(), 0) != 1) {
        throw std::invalid_argument("the layers do not end in one number");
    }
    return layers;
}

// Returns nothing if the layers take more memory than the limit.
std::shared_ptr<Layers> build_layers(const Diagram& diagram, const std::vector<double>& weights, const std::vector<std::int64_t>& exponents,
                                     const std::vector<Position>& observed, const std::vector<std::pair<std::size_t, std::vector<Index>>>& selections,
                                     std::size_t max_bytes) {
    std::vector<ObservedTerm> terms;
    std::set<int> variables;
    for (const auto& [step, variable, n_outcomes, labels, codes] : observed) {
        if (step < 0 || variable < 0 || static_cast<std::size_t>(variable) >= observed.size() || n_outcomes < 1 ||
            labels.size() != codes.size() || !std::is_sorted(labels.begin(), labels.end()) || !variables.insert(variable).second) {
            throw std::invalid_argument("an observed term out of range");
        }
        for (const Index outcome : diagram.arcs(static_cast<std::size_t>(step)).outcomes) {
            if (!std::binary_search(labels.begin(), labels.end(), outcome)) throw std::invalid_argument("an arc whose label has no code");
        }
        for (const Index code : codes) {
            if (code >= static_cast<Index>(n_outcomes)) throw std::invalid_argument("a code out of range");
        }
        terms.push_back({static_cast<std::size_t>(step), variable, static_cast<std::size_t>(n_outcomes), labels, codes});
    }
    std::vector<Selection> selected;
    for (const auto& [step, labels] : selections) {
        if (step >= diagram.n_steps() || !std::is_sorted(labels.begin(), labels.end())) throw std::invalid_argument("a step out of range");
        selected.push_back({step, labels});
    }
    for (std::size_t step = 0; step < diagram.n_steps(); ++step) {
        for (const Index outcome : diagram.arcs(step).outcomes) {
            if (outcome >= weights.size()) throw std::invalid_argument("an arc whose label has no weight");
        }
    }
    InterruptCheck check;
    if (!exponents.empty() && exponents.size() != weights.size()) throw std::invalid_argument("exponents of a wrong length");
    try {
        if (exponents.empty()) {
            try {
                LayerBuilder<double> builder(diagram, weights, terms, selected, max_bytes);
                return std::make_shared<Layers>(builder.build(check));
            } catch (const Underflow&) {
            }
        }
        std::vector<WideNumber> wide;
        for (std::size_t i = 0; i < weights.size(); ++i) {
            wide.push_back(Pass<WideNumber>::make_number(weights[i], exponents.empty() ? 0 : exponents[i]));
        }
        LayerBuilder<WideNumber> builder(diagram, std::move(wide), terms, selected, max_bytes);
        return std::make_shared<Layers>(builder.build(check));
    } catch (const OutOfBytes&) {
        return nullptr;
    }
}

}  // namespace

NB_MODULE(_diagram, m) {
    nb::set_leak_warnings(false);  // a reasoner may live until Python exits
    m.doc() = "Decision diagrams and the layers of circuits. `make stubs` generates the stub.\n\nBits are in bytes, 8 for each word.";

    nb::class_<Transition>(m, "CompiledTransition", "The outcomes of a step and their effect on the state.")
        .def("__init__",
             [](Transition* own, std::size_t n_words, nb::bytes input_mask, std::vector<nb::bytes> live_masks,
                std::vector<std::pair<nb::bytes, nb::bytes>> absorptions) {
                 if (!n_words) throw std::invalid_argument("states without bits");
                 std::vector<std::vector<Word>> masks;
                 for (const auto& mask : live_masks) masks.push_back(read_bits(mask, n_words));
                 std::vector<std::pair<std::vector<Word>, std::vector<Word>>> pairs;
                 for (const auto& [satisfied, redundant] : absorptions) {
                     pairs.emplace_back(read_bits(satisfied, n_words), read_bits(redundant, n_words));
                 }
                 new (own) Transition(n_words, read_bits(input_mask, n_words), std::move(masks), std::move(pairs));
             },
             "n_words"_a, "input_mask"_a, "live_masks"_a, "absorptions"_a)
        .def(
            "add_closure",
            [](Transition& own, const std::vector<std::tuple<int, int, int>>& closed, const std::vector<std::tuple<int, int, int>>& added,
               const std::vector<std::tuple<int, int, int>>& targets, int contradiction, int n_atoms,
               std::vector<std::vector<std::pair<int, int>>> goals) {
                const std::size_t n_bits = 64 * own.n_words();
                if (contradiction < 1 || n_atoms <= contradiction) throw std::invalid_argument("atoms out of range");
                for (const auto* implications : {&closed, &added, &targets}) {
                    for (const auto& [bit, body, head] : *implications) {
                        if (bit < (implications == &added ? -1 : 0) || body >= contradiction) throw std::invalid_argument("an implication out of range");
                    }
                }
                for (const auto& goal : goals) {
                    for (const auto& [atom, bit] : goal) {
                        if (atom < 0 || atom >= contradiction || bit < 0 || bit >= static_cast<int>(n_bits)) throw std::invalid_argument("a goal out of range");
                    }
                }
                own.add_closure(Closure(own.n_words(), read_implications(closed, n_bits, n_atoms), read_implications(added, n_bits, n_atoms),
                                        read_implications(targets, n_bits, n_atoms), contradiction, n_atoms, std::move(goals)));
            },
            "closed"_a, "added"_a, "targets"_a, "contradiction"_a, "n_atoms"_a, "goals"_a, "Add a closure, see `Closure`; implications have numbers of bits.")
        .def(
            "add_effect",
            [](Transition& own, nb::bytes sets, nb::bytes forbids, nb::bytes moves, nb::bytes targets) {
                const std::size_t n = own.n_words();
                std::vector<Word> moved = read_bits(moves, n);
                std::size_t n_moves = 0;
                for_each_bit(moved.data(), n, [&](std::size_t) { ++n_moves; });
                return own.add_effect(read_bits(sets, n), read_bits(forbids, n), std::move(moved), read_bits(targets, n * n_moves));
            },
            "sets"_a, "forbids"_a, "moves"_a, "targets"_a, "Add an effect; return its number. targets: of each bit of `moves`.")
        .def(
            "add_choices",
            [](Transition& own, nb::bytes inputs, const std::vector<std::pair<Index, Index>>& choices) {
                std::vector<Choice> read;
                for (const auto& [effect, outcome] : choices) read.push_back({effect, outcome});
                own.add_choices(read_bits(inputs, own.n_words()), std::move(read));
            },
            "inputs"_a, "choices"_a, "Add the pairs (effect, label) of the outcomes in a state of the input bits.")
        .def(
            "advance",
            [](Transition& own, nb::bytes state, Index effect) -> std::optional<nb::bytes> {
                if (effect >= own.n_effects()) throw std::invalid_argument("an effect that the transition does not have");
                const std::vector<Word> before = read_bits(state, own.n_words());
                std::vector<Word> after(own.n_words());
                if (!own.advance(before.data(), effect, after.data())) return std::nullopt;
                return write_bits(after.data(), after.size());
            },
            "state"_a, "effect"_a, "Compute the state after an outcome, for all branches; None if it is impossible.");

    nb::class_<Layers>(m, "Layers", "The layers of an arithmetic circuit.")
        .def(nb::new_([](const std::vector<StoredLayer>& stored) { return std::make_shared<Layers>(read_layers(stored)); }), "stored"_a, "Raises ValueError if the layers do not fit.")
        .def("__len__", [](const Layers& own) { return own.layers().size(); })
        .def("__reduce__", [](nb::handle own) { return nb::make_tuple(own.type(), nb::make_tuple(own.attr("store")())); },
             nb::sig("def __reduce__(self) -> tuple[object, ...]"))
        .def("store", &Layers::store, nb::sig("def store(self) -> list[tuple[object, ...]]"), "Return the layers as arrays.")
        .def(
            "weigh_outcomes",
            [](Layers& own, int query) { return own.weigh_outcomes(query); },
            "query"_a, "Compute the weight of each outcome of a term without evidence; only the ratios matter.")
        .def("weigh", &Layers::weigh, "codes"_a, "columns"_a, "queries"_a,
             nb::sig("def weigh(self, codes: NDArray[numpy.int64], columns: Sequence[tuple[int, NDArray[numpy.float64]]], "
                     "queries: Sequence[int]) -> tuple[list[NDArray[numpy.float64]], NDArray[numpy.float64]]"),
             "Compute (B, outcomes) joint weights of the evidence and each outcome of the queried terms, scaled to a maximum\n"
             "of 1, and (B,) the logarithms of the weights of the evidence.\n\n"
             "Args:\n"
             "    codes: (B, terms) the outcome of each term, -1 for no evidence; or a row of the weights of the term.\n"
             "    columns: the weights (labels, outcomes) of terms.");

    m.def(
        "improve_order",
        [](std::vector<double> bits, std::vector<std::vector<int>> needs, const std::vector<std::pair<int, std::vector<std::vector<int>>>>& groups,
           const std::vector<std::vector<std::tuple<std::vector<int>, int, int>>>& recursions, std::vector<int> order, double max_work) {
            StepGraph graph{std::move(bits), std::move(needs), {}, {}};
            for (const auto& [child, bodies] : groups) graph.groups.push_back({child, bodies});
            for (const auto& edges : recursions) {
                graph.recursions.emplace_back();
                for (const auto& [inputs, body, head] : edges) graph.recursions.back().push_back({inputs, body, head});
            }
            OrderSearch search(std::move(graph));
            const double before = search.estimate(order);
            if (!(max_work >= 0.0 && max_work < 1e15)) throw std::invalid_argument("the work of a search out of range");
            InterruptCheck check;
            const double n_moves = max_work / static_cast<double>(search.size() + order.size());
            const double after = search.improve(order, static_cast<std::size_t>(n_moves), check);
            return std::make_tuple(order, before, after);
        },
        "bits"_a, "needs"_a, "groups"_a, "recursions"_a, "order"_a, "max_work"_a,
        "Improve an order of steps; return it, and the estimates (logarithms of the number of states) before and after. The\n"
        "result depends on the arguments only.\n\n"
        "Args:\n"
        "    bits: of the outcomes of each step.\n"
        "    needs: the steps that must come before each.\n"
        "    groups: (step, -1 for constraints; the steps of each body) of rules with the same head.\n"
        "    recursions: (steps of the inputs, atom of the body or -1, atom of the head or -1) of each rule.\n"
        "    max_work: the number of steps and literals that the search visits.");

    nb::class_<Diagram>(m, "Diagram", "The arcs of a decision diagram.")
        .def(nb::init<std::vector<std::vector<int>>, std::vector<int>, std::size_t, bool>(), "children"_a, "roots"_a, "n_words"_a, "is_consistent"_a)
        .def(
            "enter",
            [](Diagram& own, std::shared_ptr<Transition> transition, bool is_shared) {
                nb::list inputs;
                for (const auto& state : own.enter(std::move(transition), is_shared)) inputs.append(write_bits(state.data(), state.size()));
                return inputs;
            },
            "transition"_a, "is_shared"_a, nb::sig("def enter(self, transition: CompiledTransition, is_shared: bool) -> list[bytes]"),
            "Enter the next step; return the states of its input bits that have no choices yet.")
        .def(
            "expand",
            [](Diagram& own, std::size_t max_bytes) {
                InterruptCheck check;
                return own.expand(max_bytes, check);
            },
            "max_bytes"_a, "Expand the step that was entered; return whether the diagram is within the limit.")
        .def("prune", &Diagram::prune, "Drop nodes without a world, and those that no arc reaches.")
        .def_prop_ro("has_dead_ends", &Diagram::has_dead_ends, "Whether a node has no arcs.")
        .def_prop_ro("n_arcs", &Diagram::n_arcs, "The number of arcs.")
        .def_prop_ro(
            "sizes",
            [](const Diagram& own) {
                std::vector<std::size_t> sizes;
                for (std::size_t step = 0; step < own.n_steps(); ++step) sizes.push_back(own.arcs(step).n_nodes());
                return sizes;
            },
            "The number of nodes of each step.")
        .def(
            "list_arcs",
            [](const Diagram& own, std::size_t step) {
                if (step >= own.n_steps()) throw std::invalid_argument("a step out of range");
                const Arcs& arcs = own.arcs(step);
                std::vector<Index> sources;
                for (std::size_t node = 0; node < arcs.n_nodes(); ++node) sources.insert(sources.end(), arcs.first[node + 1] - arcs.first[node], static_cast<Index>(node));
                return std::make_tuple(sources, arcs.targets, arcs.outcomes);
            },
            "step"_a, "List the sources, targets in each branch and labels of the arcs of a step.")
        .def(
            "list_labels",
            [](const Diagram& own, std::size_t step) {
                if (step >= own.n_steps()) throw std::invalid_argument("a step out of range");
                std::vector<Index> labels = own.arcs(step).outcomes;
                std::sort(labels.begin(), labels.end());
                labels.erase(std::unique(labels.begin(), labels.end()), labels.end());
                return labels;
            },
            "step"_a, "List the different labels of the arcs of a step, sorted.")
        .def("build_layers", &build_layers, "weights"_a, "exponents"_a, "observed"_a, "selections"_a, "max_bytes"_a,
             nb::sig("def build_layers(self, weights: Sequence[float], exponents: Sequence[int], "
                     "observed: Sequence[tuple[int, int, int, Sequence[int], Sequence[int]]], "
                     "selections: Sequence[tuple[int, Sequence[int]]], max_bytes: int) -> Layers | None"),
             "Sum out all terms but the observed ones; return None if the layers take more memory.\n\n"
             "Args:\n"
             "    weights: of the labels of arcs; exponents: of 2, by which they are multiplied; may be empty.\n"
             "    observed: (step, variable, number of outcomes, sorted labels, the outcome for each label).\n"
             "    selections: (step, sorted labels of the arcs that worlds may have).");
}
