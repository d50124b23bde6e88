// Sums out all terms of a decision diagram but the observed ones, from its leaves to its roots.
#pragma once

#include <algorithm>
#include <exception>
#include <numeric>

#include "diagram.hpp"
#include "layers.hpp"

namespace lcorpp {

// Smaller weights are not computed in floating point: products of two such numbers underflow.
constexpr double min_weight = 1e-150;

// A weight is so small that digits may be lost.
struct Underflow : std::exception {};

// The layers, or the sums from which they are built, take more memory than the limit.
struct OutOfBytes : std::exception {};

// A term that evidence may name or a question reads.
struct ObservedTerm {
    std::size_t step;
    int variable;
    std::size_t n_outcomes;
    std::vector<Index> labels, codes;  // the outcome of the term for each label of the arcs of the step; labels are sorted
};

// The labels of arcs of a step that agree with evidence that does not change.
struct Selection {
    std::size_t step;
    std::vector<Index> labels;  // sorted
};

template <typename T>
class LayerBuilder {
  public:
    // weights: of the labels of arcs. selections: at most one for each step.
    LayerBuilder(const Diagram& diagram, std::vector<T> weights, std::vector<ObservedTerm> observed,
                 std::vector<Selection> selections, std::size_t max_bytes)
        : diagram_(diagram), weights_(std::move(weights)), max_bytes_(max_bytes), observed_(diagram.n_steps()), selected_(diagram.n_steps(), nullptr),
          terms_(std::move(observed)), selections_(std::move(selections)) {
        for (const ObservedTerm& term : terms_) observed_[term.step].push_back(&term);
        for (const Selection& selection : selections_) selected_[selection.step] = &selection;
    }

    // Return the layers, each after its sources; the last one has one output. `check` is called from time to time.
    template <typename Check>
    std::vector<Layer> build(Check& check) {
        std::vector<Part> parts(diagram_.n_steps());
        for (std::size_t step = diagram_.n_steps(); step-- > 0;) {
            std::vector<Part> branches;
            for (const int child : diagram_.children()[step]) branches.push_back(std::move(parts[static_cast<std::size_t>(child)]));
            check(diagram_.arcs(step).size());
            parts[step] = sum_step(step, std::move(branches));
        }
        std::vector<Part> roots;
        for (const int root : diagram_.roots()) roots.push_back(std::move(parts[static_cast<std::size_t>(root)]));
        std::vector<T> weights{T(1.0)};
        std::vector<Index> row_of;
        std::vector<std::vector<Index>> targets(roots.size(), {0});
        Part part = multiply(weights, row_of, targets, std::move(roots));
        Part root;
        root.sources = std::move(part.sources);
        root.n_inputs = part.n_inputs;
        for (Index k = part.first[row_of[0]]; k < part.first[row_of[0] + 1]; ++k) {
            root.inputs.push_back(part.inputs[k]);
            root.weights.push_back(part.weights[k] * weights[0]);
        }
        root.first = {0, static_cast<Index>(root.inputs.size())};
        append_product(std::move(root));
        return std::move(layers_);
    }

  private:
    // The nodes of a step: numbers, or weighted sums of inputs, one row for each node.
    struct Part {
        bool is_numbers = false;
        std::vector<T> numbers;
        std::vector<Index> first, inputs;
        std::vector<T> weights;
        std::vector<Source> sources;
        std::size_t n_inputs = 0, n_arcs = 0;  // n_arcs: of all diagrams' steps that the rows multiply
        double lowest = 1.0;                   // a lower bound of the weights
    };
    struct Entry {
        Index output, outcome, input;
        T weight;
    };

    static bool is_positive(const T& number) { return !is_zero(number); }

    static void check_number(const T& number) {
        if constexpr (std::is_same_v<T, double>) {
            if (number > 0.0 && number < min_weight) throw Underflow();
        }
    }

    // Check that the layers and some more memory are within the limit.
    void check_memory(std::size_t more) const {
        if (memory_ + more > max_bytes_) throw OutOfBytes();
    }

    Part sum_step(std::size_t step, std::vector<Part> branches) {
        const Arcs& arcs = diagram_.arcs(step);
        const std::size_t n_nodes = std::max<std::size_t>(arcs.n_nodes(), 1);  // one without arcs if there is no world
        std::vector<T> weights(arcs.size());
        for (std::size_t arc = 0; arc < arcs.size(); ++arc) {
            weights[arc] = weights_[arcs.outcomes[arc]];
            check_number(weights[arc]);
        }
        if (const Selection* selection = selected_[step]) {
            for (std::size_t arc = 0; arc < arcs.size(); ++arc) {
                if (!std::binary_search(selection->labels.begin(), selection->labels.end(), arcs.outcomes[arc])) weights[arc] = T(0.0);
            }
        }
        std::vector<Index> row_of;
        Part part = multiply(weights, row_of, arcs.targets, std::move(branches));
        const auto& observed = observed_[step];
        if (observed.empty() && part.sources.empty()) {
            Part sums;
            sums.is_numbers = true;
            sums.numbers.assign(n_nodes, T(0.0));
            for (std::size_t node = 0; node < arcs.n_nodes(); ++node) {
                for (Index arc = arcs.first[node]; arc < arcs.first[node + 1]; ++arc) sums.numbers[node] += weights[arc];
                check_number(sums.numbers[node]);
            }
            return sums;
        }
        if (!observed.empty()) return sum_observed(arcs, n_nodes, weights, row_of, std::move(part), observed);
        Part result;
        result.first.reserve(n_nodes + 1);
        result.first.push_back(0);
        Accumulator sums(part.n_inputs);
        std::size_t n_kept = 0;
        double smallest = 1.0;
        for (std::size_t node = 0; node < n_nodes; ++node) {
            for (Index arc = node < arcs.n_nodes() ? arcs.first[node] : 0; node < arcs.n_nodes() && arc < arcs.first[node + 1]; ++arc) {
                if (!is_positive(weights[arc])) continue;
                ++n_kept;
                if constexpr (std::is_same_v<T, double>) smallest = std::min(smallest, weights[arc]);
                sums.add(part.first, part.inputs, part.weights, row_of[arc], weights[arc]);
            }
            sums.flush([&](Index input, const T& weight) {
                result.inputs.push_back(input);
                result.weights.push_back(weight);
            });
            check_memory(result.inputs.size() * (sizeof(Index) + sizeof(T)));
            result.first.push_back(static_cast<Index>(result.inputs.size()));
        }
        result.sources = std::move(part.sources);
        result.n_inputs = part.n_inputs;
        result.n_arcs = part.n_arcs + n_kept;
        result.lowest = part.lowest * smallest;
        if constexpr (std::is_same_v<T, double>) {
            if (result.lowest < min_weight) {
                result.lowest = 1.0;
                for (const double weight : result.weights) {
                    check_number(weight);
                    result.lowest = std::min(result.lowest, weight);
                }
            }
        }
        if (result.n_inputs > 1 && result.inputs.size() > 4 * result.n_arcs + 64) {  // the product becomes dense
            return append_product(std::move(result));
        }
        return result;
    }

    // Sums rows of one node.
    class Accumulator {
      public:
        explicit Accumulator(std::size_t size) : sums_(size, T(0.0)), is_used_(size, 0) {}

        void add(const std::vector<Index>& first, const std::vector<Index>& inputs, const std::vector<T>& weights, Index row,
                 const T& factor) {
            for (Index k = first[row]; k < first[row + 1]; ++k) {
                const Index input = inputs[k];
                if (!is_used_[input]) {
                    is_used_[input] = 1;
                    used_.push_back(input);
                }
                sums_[input] += weights[k] * factor;
            }
        }

        template <typename Function>
        void flush(Function function) {
            std::sort(used_.begin(), used_.end());
            for (const Index input : used_) {
                function(input, sums_[input]);
                sums_[input] = T(0.0);
                is_used_[input] = 0;
            }
            used_.clear();
        }

      private:
        std::vector<T> sums_;
        std::vector<char> is_used_;
        std::vector<Index> used_;
    };

    // Append a layer for each observed term of a step; return the outputs of the last.
    Part sum_observed(const Arcs& arcs, std::size_t n_nodes, const std::vector<T>& weights, const std::vector<Index>& row_of,
                      Part part, const std::vector<const ObservedTerm*>& observed) {
        const std::size_t n_terms = observed.size();
        std::vector<Index> codes(arcs.size() * n_terms);  // of each arc
        for (std::size_t t = 0; t < n_terms; ++t) {
            const ObservedTerm& term = *observed[t];
            for (std::size_t arc = 0; arc < arcs.size(); ++arc) {
                const auto at = std::lower_bound(term.labels.begin(), term.labels.end(), arcs.outcomes[arc]);
                codes[arc * n_terms + t] = term.codes[static_cast<std::size_t>(at - term.labels.begin())];
            }
        }
        const auto compare = [&](Index a, Index b) {
            return std::lexicographical_compare(codes.begin() + a * n_terms, codes.begin() + (a + 1) * n_terms,
                                                codes.begin() + b * n_terms, codes.begin() + (b + 1) * n_terms);
        };
        struct Sum {
            Index node, arc;  // an arc with the codes
        };
        std::vector<Sum> sums;
        std::vector<Entry> entries;  // `output` is an index of a sum
        Accumulator accumulator(part.n_inputs);
        std::vector<Index> own;
        for (std::size_t node = 0; node < arcs.n_nodes(); ++node) {
            own.clear();
            for (Index arc = arcs.first[node]; arc < arcs.first[node + 1]; ++arc) {
                if (is_positive(weights[arc])) own.push_back(arc);
            }
            std::stable_sort(own.begin(), own.end(), compare);
            for (std::size_t i = 0; i < own.size();) {
                const std::size_t start = i;
                for (; i < own.size() && !compare(own[start], own[i]); ++i) {
                    accumulator.add(part.first, part.inputs, part.weights, row_of[own[i]], weights[own[i]]);
                }
                const auto number = static_cast<Index>(sums.size());
                sums.push_back({static_cast<Index>(node), own[start]});
                accumulator.flush([&](Index input, const T& weight) { entries.push_back({number, 0, input, weight}); });
                check_memory(entries.size() * sizeof(Entry));
            }
        }
        std::vector<Source> sources = std::move(part.sources);
        std::size_t n_inputs = part.n_inputs;
        Part result;
        for (std::size_t t = 0; t < n_terms; ++t) {
            // the outputs: the node, and the codes of the terms that follow
            std::vector<Sum> outputs;
            std::vector<Index> output_of(sums.size());
            if (t + 1 == n_terms) {
                for (std::size_t i = 0; i < sums.size(); ++i) output_of[i] = sums[i].node;
            } else {
                std::vector<Index> order(sums.size());
                std::iota(order.begin(), order.end(), Index{0});
                const auto rest = [&](Index i) { return codes.begin() + static_cast<std::ptrdiff_t>(sums[i].arc * n_terms + t + 1); };
                const auto length = static_cast<std::ptrdiff_t>(n_terms - t - 1);
                const auto is_less = [&](Index a, Index b) {
                    if (sums[a].node != sums[b].node) return sums[a].node < sums[b].node;
                    return std::lexicographical_compare(rest(a), rest(a) + length, rest(b), rest(b) + length);
                };
                std::stable_sort(order.begin(), order.end(), is_less);
                for (std::size_t k = 0; k < order.size(); ++k) {
                    if (k == 0 || is_less(order[k - 1], order[k])) outputs.push_back(sums[order[k]]);
                    output_of[order[k]] = static_cast<Index>(outputs.size() - 1);
                }
            }
            for (Entry& entry : entries) {
                entry.outcome = codes[sums[entry.output].arc * n_terms + t];
                entry.output = output_of[entry.output];
            }
            const std::size_t n_outputs = t + 1 == n_terms ? n_nodes : std::max<std::size_t>(outputs.size(), 1);
            result = append(observed[t]->variable, std::move(sources), n_outputs, observed[t]->n_outcomes, n_inputs, std::move(entries));
            sources = result.sources;
            n_inputs = n_outputs;
            entries.clear();
            for (std::size_t i = 0; i < outputs.size(); ++i) {
                entries.push_back({static_cast<Index>(i), 0, static_cast<Index>(i), T(1.0)});
            }
            sums = std::move(outputs);
        }
        return result;
    }

    // Multiply the weights of arcs by the nodes to which they lead: by numbers here; the product of other nodes is a part
    // with a row for each arc.
    Part multiply(std::vector<T>& weights, std::vector<Index>& row_of, const std::vector<std::vector<Index>>& targets,
                  std::vector<Part> branches) {
        std::vector<std::size_t> varying;
        for (std::size_t branch = 0; branch < branches.size(); ++branch) {
            if (!branches[branch].is_numbers) {
                varying.push_back(branch);
                continue;
            }
            for (std::size_t arc = 0; arc < weights.size(); ++arc) {
                weights[arc] *= branches[branch].numbers[targets[branch][arc]];
                check_number(weights[arc]);
            }
        }
        if (varying.empty()) {
            row_of.assign(weights.size(), 0);
            return make_identity(1);
        }
        if (varying.size() == 1) {
            row_of = targets[varying[0]];
            return std::move(branches[varying[0]]);
        }
        std::vector<Source> sources;
        for (const std::size_t branch : varying) sources.push_back(append_product(std::move(branches[branch])).sources[0]);
        StateSet joint((varying.size() + 1) / 2);  // the nodes of all branches, two in a word
        std::vector<Word> nodes((varying.size() + 1) / 2);
        std::vector<std::vector<Index>> columns(varying.size());
        row_of.assign(weights.size(), 0);
        for (std::size_t arc = 0; arc < weights.size(); ++arc) {
            if (!is_positive(weights[arc])) continue;
            std::fill(nodes.begin(), nodes.end(), 0);
            for (std::size_t k = 0; k < varying.size(); ++k) nodes[k / 2] |= static_cast<Word>(targets[varying[k]][arc]) << (32 * (k % 2));
            const std::size_t known = joint.size();
            row_of[arc] = joint.insert(nodes.data());
            if (joint.size() == known) continue;
            for (std::size_t k = 0; k < varying.size(); ++k) columns[k].push_back(sources[k].nodes[targets[varying[k]][arc]]);
        }
        Part part = make_identity(std::max<std::size_t>(joint.size(), 1));
        for (std::size_t k = 0; k < varying.size(); ++k) {
            if (columns[k].empty()) columns[k].push_back(0);
            part.sources.push_back({sources[k].layer, std::move(columns[k])});
        }
        return part;
    }

    static Part make_identity(std::size_t size) {
        Part part;
        part.first.resize(size + 1);
        std::iota(part.first.begin(), part.first.end(), Index{0});
        part.inputs.resize(size);
        std::iota(part.inputs.begin(), part.inputs.end(), Index{0});
        part.weights.assign(size, T(1.0));
        part.n_inputs = size;
        return part;
    }

    // Append a layer whose outputs are the nodes of a part, unless it already has them; return them.
    Part append_product(Part part) {
        const std::size_t n_nodes = part.first.size() - 1;
        bool is_done = part.sources.size() == 1 && n_nodes == part.n_inputs && part.inputs.size() == n_nodes &&
                       layers_[part.sources[0].layer].n_outputs == part.n_inputs;
        for (std::size_t i = 0; is_done && i < n_nodes; ++i) {
            is_done = part.first[i] == i && part.inputs[i] == i && part.sources[0].nodes[i] == i && !(part.weights[i] < T(1.0)) &&
                      !(T(1.0) < part.weights[i]);
        }
        if (is_done) return part;
        check_memory(part.inputs.size() * sizeof(Entry));
        std::vector<Entry> entries;
        entries.reserve(part.inputs.size());
        for (std::size_t node = 0; node < n_nodes; ++node) {
            for (Index k = part.first[node]; k < part.first[node + 1]; ++k) {
                entries.push_back({static_cast<Index>(node), 0, part.inputs[k], part.weights[k]});
            }
        }
        return append(-1, std::move(part.sources), n_nodes, 1, part.n_inputs, std::move(entries));
    }

    // Append a layer; return its outputs.
    Part append(int variable, std::vector<Source> sources, std::size_t n_outputs, std::size_t n_outcomes, std::size_t n_inputs,
                std::vector<Entry> entries) {
        const auto is_less = [](const Entry& a, const Entry& b) {
            if (a.output != b.output) return a.output < b.output;
            return a.outcome != b.outcome ? a.outcome < b.outcome : a.input < b.input;
        };
        if (!std::is_sorted(entries.begin(), entries.end(), is_less)) std::sort(entries.begin(), entries.end(), is_less);
        Layer layer{variable, n_outputs, n_outcomes, n_inputs, std::move(sources), {}, {}, {}, {}, {}};
        layer.first.assign(n_outputs + 1, 0);
        bool is_wide = false;  // whether a weight is too small for floating point
        if constexpr (!std::is_same_v<T, double>) {
            for (const Entry& entry : entries) is_wide |= entry.weight < T(min_number);
        }
        for (const Entry& entry : entries) {
            ++layer.first[entry.output + 1];
            layer.outcomes.push_back(entry.outcome);
            layer.inputs.push_back(entry.input);
            if constexpr (std::is_same_v<T, double>) {
                layer.weights.push_back(entry.weight);
            } else if (is_wide) {
                layer.weights.push_back(entry.weight.mantissa());
                layer.exponents.push_back(entry.weight.exponent());
            } else {
                layer.weights.push_back(entry.weight.divide_by(T(1.0)));
            }
        }
        std::partial_sum(layer.first.begin(), layer.first.end(), layer.first.begin());
        memory_ += entries.size() * (2 * sizeof(Index) + sizeof(double)) + layer.first.size() * sizeof(Index);
        layers_.push_back(std::move(layer));
        Part part = make_identity(n_outputs);
        Source source{layers_.size() - 1, std::vector<Index>(n_outputs)};
        std::iota(source.nodes.begin(), source.nodes.end(), Index{0});
        part.sources.push_back(std::move(source));
        return part;
    }

    const Diagram& diagram_;
    std::vector<T> weights_;
    std::size_t max_bytes_, memory_ = 0;
    std::vector<std::vector<const ObservedTerm*>> observed_;  // of each step
    std::vector<const Selection*> selected_;
    std::vector<ObservedTerm> terms_;
    std::vector<Selection> selections_;
    std::vector<Layer> layers_;
};

}  // namespace lcorpp
