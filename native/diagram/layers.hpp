// The layers of an arithmetic circuit, and the passes that answer questions; see diagram/layers.py.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <utility>
#include <vector>

#include "number.hpp"
#include "states.hpp"

namespace lcorpp {

// Products of four numbers that are not smaller do not underflow.
constexpr double min_number = 1e-70;

// Outputs of an earlier layer that are factors of the inputs: input i has the factor `nodes[i]`.
struct Source {
    std::size_t layer;
    std::vector<Index> nodes;
};

// Each output is a sum over its entries: weight * evidence about the outcome * input.
struct Layer {
    int variable;  // the observed term, -1 for none
    std::size_t n_outputs, n_outcomes, n_inputs;
    std::vector<Source> sources;           // without sources there is one input, 1
    std::vector<Index> first;              // entry of each output, and the end
    std::vector<Index> outcomes, inputs;   // of each entry; sorted within an output
    std::vector<double> weights;
    std::vector<std::int64_t> exponents;   // weights are multiplied by 2 to this power; none if all are 0
};

// Evidence of one row about a term: weights of its outcomes, or a code, -1 for no evidence.
struct TermEvidence {
    const double* weights = nullptr;
    std::int64_t code = -1;
};

// An upward and a downward pass, for one type of numbers; memory is kept from row to row.
template <typename T>
class Pass {
  public:
    explicit Pass(const std::vector<Layer>& layers) : layers_(layers), inputs_(layers.size()), outputs_(layers.size()),
                                                      derivatives_(layers.size()), weights_(layers.size()) {
        for (std::size_t i = 0; i < layers.size(); ++i) {
            inputs_[i].resize(layers[i].n_inputs);
            outputs_[i].resize(layers[i].n_outputs);
            if (std::is_same_v<T, double>) continue;  // the weights of the layers
            for (std::size_t k = 0; k < layers[i].weights.size(); ++k) {
                weights_[i].push_back(make_number(layers[i].weights[k], layers[i].exponents.empty() ? 0 : layers[i].exponents[k]));
            }
        }
    }

    static T make_number(double mantissa, std::int64_t exponent) {
        if constexpr (std::is_same_v<T, double>) {
            return mantissa;
        } else {
            return T(mantissa).shift(exponent);
        }
    }

    // Return whether the evidence is possible; `logarithm` is that of its weight. `is_extreme`: digits may be lost.
    bool go_up(const std::vector<TermEvidence>& evidence, double& logarithm, bool& is_extreme) {
        logarithm = 0.0;
        for (std::size_t i = 0; i < layers_.size(); ++i) {
            const Layer& layer = layers_[i];
            read_inputs(i, is_extreme);
            const TermEvidence own = layer.variable < 0 ? TermEvidence{} : evidence[static_cast<std::size_t>(layer.variable)];
            const std::vector<T>& inputs = inputs_[i];
            const std::vector<T>& weights = get_weights(i);
            T largest(0.0);
            for (std::size_t output = 0; output < layer.n_outputs; ++output) {
                T sum(0.0);
                for (Index k = layer.first[output]; k < layer.first[output + 1]; ++k) {
                    if (own.weights != nullptr) {
                        sum += weights[k] * inputs[layer.inputs[k]] * T(own.weights[layer.outcomes[k]]);
                    } else if (own.code < 0 || own.code == static_cast<std::int64_t>(layer.outcomes[k])) {
                        sum += weights[k] * inputs[layer.inputs[k]];
                    }
                }
                outputs_[i][output] = sum;
                if (largest < sum) largest = sum;
            }
            if (own.weights != nullptr) {
                for (std::size_t k = 0; k < layer.n_outcomes; ++k) check(T(own.weights[k]), is_extreme);
            }
            if (is_zero(largest)) return false;
            logarithm += scale(outputs_[i], largest, is_extreme);
            if (is_extreme) return true;
        }
        return true;
    }

    // Write the joint weights of the evidence and each outcome of the queried terms, each scaled to a maximum of 1.
    // leads: whether a layer is queried, or one of those before it is; results: of each layer, or nullptr.
    void go_down(const std::vector<TermEvidence>& evidence, const std::vector<char>& leads, const std::vector<double*>& results,
                 bool& is_extreme) {
        derivatives_.back().assign(1, T(1.0));
        for (std::size_t i = layers_.size(); i-- > 0 && !is_extreme;) {
            if (!leads[i]) continue;
            const Layer& layer = layers_[i];
            std::vector<T>& derivative = derivatives_[i];
            T largest = find_largest(derivative);
            if (!is_zero(largest)) scale(derivative, largest, is_extreme);
            const TermEvidence own = layer.variable < 0 ? TermEvidence{} : evidence[static_cast<std::size_t>(layer.variable)];
            const std::vector<T>& weights = get_weights(i);
            by_input_.assign(layer.n_inputs, T(0.0));
            by_outcome_.assign(layer.n_outcomes, T(0.0));
            for (std::size_t output = 0; output < layer.n_outputs; ++output) {
                const T& factor = derivative[output];
                if (is_zero(factor)) continue;
                for (Index k = layer.first[output]; k < layer.first[output + 1]; ++k) {
                    T product = factor * weights[k];
                    if (own.weights != nullptr) {
                        product *= T(own.weights[layer.outcomes[k]]);
                    } else if (own.code >= 0 && own.code != static_cast<std::int64_t>(layer.outcomes[k])) {
                        continue;
                    }
                    by_input_[layer.inputs[k]] += product;
                    by_outcome_[layer.outcomes[k]] += product * inputs_[i][layer.inputs[k]];
                }
            }
            if (results[i] != nullptr) write(by_outcome_, results[i]);
            largest = find_largest(by_input_);
            bool ignored = false;  // no two of these numbers are multiplied
            if (!is_zero(largest)) scale(by_input_, largest, ignored);
            pass_down(layer, leads, is_extreme);
        }
    }

  private:
    const std::vector<T>& get_weights(std::size_t i) const {
        if constexpr (std::is_same_v<T, double>) {
            return layers_[i].weights;
        } else {
            return weights_[i];
        }
    }

    static void check(const T& number, bool& is_extreme) {
        if constexpr (std::is_same_v<T, double>) is_extreme |= number > 0.0 && number < min_number;
    }

    static T find_largest(const std::vector<T>& numbers) {
        T largest(0.0);
        for (const T& number : numbers) largest = largest < number ? number : largest;
        return largest;
    }

    // Divide numbers by the largest; return its logarithm.
    static double scale(std::vector<T>& numbers, const T& largest, bool& is_extreme) {
        if constexpr (std::is_same_v<T, double>) {
            for (T& number : numbers) {
                number /= largest;
                check(number, is_extreme);
            }
            return std::log(largest);
        } else {
            const T factor = largest.inverse();
            const double logarithm = largest.log();
            for (T& number : numbers) number *= factor;
            return logarithm;
        }
    }

    void read_inputs(std::size_t i, bool& is_extreme) {
        const Layer& layer = layers_[i];
        std::vector<T>& inputs = inputs_[i];
        if (layer.sources.empty()) {
            inputs[0] = T(1.0);
            return;
        }
        for (std::size_t s = 0; s < layer.sources.size(); ++s) {
            const Source& source = layer.sources[s];
            const std::vector<T>& outputs = outputs_[source.layer];
            for (std::size_t k = 0; k < inputs.size(); ++k) {
                if (s == 0) {
                    inputs[k] = outputs[source.nodes[k]];
                } else {
                    inputs[k] *= outputs[source.nodes[k]];
                    check(inputs[k], is_extreme);
                }
            }
        }
    }

    // Multiply the derivatives of the inputs by all factors but one, for each source that leads to a queried term.
    void pass_down(const Layer& layer, const std::vector<char>& leads, bool& is_extreme) {
        for (std::size_t s = 0; s < layer.sources.size(); ++s) {
            const Source& source = layer.sources[s];
            if (!leads[source.layer]) continue;
            std::vector<T>& derivative = derivatives_[source.layer];
            derivative.assign(layers_[source.layer].n_outputs, T(0.0));
            for (std::size_t k = 0; k < layer.n_inputs; ++k) {
                T product = by_input_[k];
                if (is_zero(product)) continue;
                for (std::size_t other = 0; other < layer.sources.size(); ++other) {
                    if (other == s) continue;
                    product *= outputs_[layer.sources[other].layer][layer.sources[other].nodes[k]];
                    check(product, is_extreme);
                }
                derivative[source.nodes[k]] += product;
            }
        }
    }

    static void write(const std::vector<T>& numbers, double* result) {
        const T largest = find_largest(numbers);
        for (std::size_t k = 0; k < numbers.size(); ++k) {
            if constexpr (std::is_same_v<T, double>) {
                result[k] = largest > 0.0 ? numbers[k] / largest : 0.0;
            } else {
                result[k] = is_zero(largest) ? 0.0 : numbers[k].divide_by(largest);
            }
        }
    }

    const std::vector<Layer>& layers_;
    std::vector<std::vector<T>> inputs_, outputs_, derivatives_, weights_;
    std::vector<T> by_input_, by_outcome_;
};

}  // namespace lcorpp
