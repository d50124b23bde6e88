// The passes of `Plan`, for both types of numbers.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace lcorpp {

constexpr double min_product = -650.0;  // the logarithm of the smallest product that is certain not to underflow
constexpr double max_kept_memory = 67'108'864.0;  // of messages, in bytes; larger plans release those that are read
constexpr std::size_t min_messages = 5;  // of a step, for products that all derivatives share
constexpr std::size_t max_clique_numbers = 4'000'000;  // of these products
constexpr double min_scale = 1e-20;     // tables with a smaller largest number are scaled to a largest number of 1

template <typename T>
LoopNest<T> Plan::make_nest(const Step& step, const std::vector<int>& out,
                            const std::vector<const Operand*>& operands) const {
    std::vector<int> axes = step.scope;
    if (step.variable >= 0) axes.push_back(step.variable);
    const bool has_axes = !axes.empty();
    std::vector<Offset> sizes;
    for (const int v : axes) sizes.push_back(network_->sizes[v]);
    if (!has_axes) sizes.push_back(1);
    std::vector<Offset> out_strides(sizes.size(), 0);
    const std::vector<Offset> own = list_strides(out);
    for (std::size_t k = 0; k < out.size(); ++k) {
        const auto axis = std::find(axes.begin(), axes.end(), out[k]) - axes.begin();
        out_strides[static_cast<std::size_t>(axis)] = own[k];
    }
    std::vector<std::vector<Offset>> strides;
    for (const Operand* operand : operands) {
        strides.emplace_back(sizes.size(), 0);
        for (std::size_t k = 0; k < operand->scope.size(); ++k) {
            const auto axis = std::find(axes.begin(), axes.end(), operand->scope[k]) - axes.begin();
            strides.back()[static_cast<std::size_t>(axis)] = operand->strides[k];
        }
    }
    return LoopNest<T>(std::move(sizes), std::move(out_strides), std::move(strides));
}

template <>
inline const LoopNest<double>& Plan::get_nest<double>(const Step& step) {
    return step.nest;
}

template <>
inline const LoopNest<WideNumber>& Plan::get_nest<WideNumber>(const Step& step) {
    return step.wide_nest;
}

// The first entry of an operand that agrees with the evidence.
template <typename T>
const T* Plan::locate(const Numbers<T>& numbers, const Operand& operand, const Evidence* evidence,
                      const std::vector<T>& weights) const {
    const auto i = static_cast<std::size_t>(operand.index);
    if (operand.kind == Kind::weights) return weights.data() + weight_offsets_[i];
    const T* values;
    if (operand.kind == Kind::message) {
        values = numbers.messages[i].data();
    } else if constexpr (std::is_same_v<T, double>) {
        values = network_->tables[i].data();
    } else {
        values = numbers.tables[i].data();
    }
    for (const auto& [index, stride] : operand.observed) values += stride * evidence->values[index];
    return values;
}

// The largest number, and the smallest positive one; 0 and infinity if there is none.
inline std::pair<double, double> find_range(const std::vector<double>& numbers) {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    constexpr std::size_t n_lanes = 8;  // independent of each other, so that they are found at once
    double largest[n_lanes], smallest[n_lanes];
    std::fill_n(largest, n_lanes, 0.0);
    std::fill_n(smallest, n_lanes, infinity);
    const auto include = [&](std::size_t lane, double number) {
        const double positive = number > 0.0 ? number : infinity;
        largest[lane] = number > largest[lane] ? number : largest[lane];
        smallest[lane] = positive < smallest[lane] ? positive : smallest[lane];
    };
    std::size_t i = 0;
    for (; i + n_lanes <= numbers.size(); i += n_lanes) {
        for (std::size_t lane = 0; lane < n_lanes; ++lane) include(lane, numbers[i + lane]);
    }
    for (; i < numbers.size(); ++i) include(0, numbers[i]);
    return {*std::max_element(largest, largest + n_lanes), *std::min_element(smallest, smallest + n_lanes)};
}

// Scale numbers unless the largest is near 1; find the logarithm of the smallest positive one.
template <typename T>
void Plan::scale(std::vector<T>& numbers, double& logarithm, double& lowest) {
    logarithm = lowest = 0.0;
    if constexpr (std::is_same_v<T, double>) {
        const auto [largest, smallest] = find_range(numbers);
        if (largest == 0.0) {
            logarithm = -std::numeric_limits<double>::infinity();
            return;
        }
        lowest = std::log(smallest);
        if (numbers.size() > 1 && largest >= min_scale && largest <= 1.0) return;
        logarithm = std::log(largest);
        lowest -= logarithm;
        for (double& number : numbers) number /= largest;
    } else {
        T largest(0.0);
        for (const T& number : numbers) largest = largest < number ? number : largest;
        if (largest.is_zero()) {
            logarithm = -std::numeric_limits<double>::infinity();
            return;
        }
        logarithm = largest.log();
        const T factor = largest.inverse();
        for (T& number : numbers) number *= factor;
    }
}

// Compute a message; return whether a product may underflow, and it needs wide numbers.
template <typename T, typename Check>
bool Plan::compute(Numbers<T>& numbers, std::size_t index, const Evidence* evidence, const std::vector<T>& weights,
                   std::vector<T>& buffer, Check& check) {
    const Step& step = steps_[index];
    check(step.size * static_cast<std::size_t>(step.variable >= 0 ? network_->sizes[step.variable] : 1));
    std::vector<const T*> operands;
    double lowest = 0.0;
    for (const Operand& operand : step.operands) {
        operands.push_back(locate(numbers, operand, evidence, weights));
        const auto i = static_cast<std::size_t>(operand.index);
        lowest += operand.kind == Kind::table     ? network_->lowest[i]
                  : operand.kind == Kind::message ? numbers.lowest[i]
                                                  : lowest_weight_;
    }
    if (std::is_same_v<T, double> && lowest < min_product) return true;
    std::vector<T>& message = numbers.messages[index];
    message.assign(step.size, T(0.0));
    bool is_copied = false;
    if constexpr (std::is_same_v<T, double>) {
        if (step.is_copied) {
            is_copied = true;
            numbers.written.assign(step.size, 0.0);
            step.nest.run(numbers.written.data(), operands, buffer);
            step.copy.run(message.data(), numbers.written.data());
        }
    }
    if (!is_copied) get_nest<T>(step).run(message.data(), operands, buffer);
    scale(message, numbers.logarithms[index], numbers.lowest[index]);
    return false;
}

// Release the messages that a step read, which no other step reads: the static ones, or those that evidence changes.
template <typename T>
void Plan::release_messages(Numbers<T>& numbers, const Step& step, bool is_static) const {
    for (const Operand& operand : step.operands) {
        const auto i = static_cast<std::size_t>(operand.index);
        if (operand.kind == Kind::message && steps_[i].is_static == is_static) std::vector<T>().swap(numbers.messages[i]);
    }
}

template <typename T, typename Check>
void Plan::prepare_all(Numbers<T>& numbers, Check& check) {
    numbers.messages.resize(steps_.size());
    numbers.logarithms.assign(steps_.size(), 0.0);
    numbers.lowest.assign(steps_.size(), 0.0);
    if constexpr (std::is_same_v<T, WideNumber>) {
        numbers.tables.clear();
        for (const auto& table : network_->tables) numbers.tables.emplace_back(table.begin(), table.end());
        for (Step& step : steps_) {
            std::vector<const Operand*> all;
            for (const Operand& operand : step.operands) all.push_back(&operand);
            step.wide_nest = make_nest<T>(step, step.scope, all);
        }
    }
    std::vector<T> buffer;
    const std::vector<T> no_weights;
    for (std::size_t i = 0; i < steps_.size(); ++i) {
        if (!steps_[i].is_static) continue;
        if (compute(numbers, i, nullptr, no_weights, buffer, check)) {
            is_extreme_ = true;
            return;
        }
        if (!question_.marginals) release_messages(numbers, steps_[i], true);
    }
}

template <typename T, typename Check>
double Plan::run(Numbers<T>& numbers, const Evidence& evidence, double* result, bool& is_extreme, Check& check) {
    const std::vector<T> weights(evidence.weights, evidence.weights + n_weights_);
    if constexpr (std::is_same_v<T, double>) {
        double smallest = 1.0;
        for (const double weight : weights) smallest = std::min(smallest, weight == 0.0 ? smallest : weight);
        lowest_weight_ = std::log(smallest);
    }
    std::vector<T> buffer;
    double logarithm = 0.0;
    std::fill(result, result + result_size_, 0.0);
    for (std::size_t i = 0; i < steps_.size(); ++i) {
        if (!steps_[i].is_static && compute(numbers, i, &evidence, weights, buffer, check)) {
            is_extreme = true;
            return 0.0;
        }
        logarithm += numbers.logarithms[i];
        if (std::isinf(numbers.logarithms[i])) return logarithm;
        if (!question_.marginals && memory_ > max_kept_memory) release_messages(numbers, steps_[i], false);
    }
    if (question_.marginals) {
        is_extreme = derive(numbers, evidence, weights, result, check);
        return logarithm;
    }
    const std::vector<T>& last = numbers.messages.back();
    for (std::size_t k = 0; k < last.size(); ++k) {
        if constexpr (std::is_same_v<T, double>) {
            result[k] = last[k];
        } else {
            result[k] = last[k].divide_by(T(1.0));
        }
    }
    return logarithm;
}

// For each message that a step reads the product of all its other operands, as a table over its clique; nothing if there
// are few messages, or the tables would be large. Products of those before and behind each message take linear time.
template <typename T>
std::vector<std::vector<T>> Plan::multiply_others(const Numbers<T>& numbers, const Step& step, const Operand& own,
                                                  const std::vector<T>& derivative, const Evidence& evidence,
                                                  const std::vector<T>& weights) const {
    std::vector<const Operand*> rest{&own}, messages;
    std::vector<const T*> values{derivative.data()};
    for (const Operand& operand : step.operands) {
        if (operand.kind == Kind::message) {
            messages.push_back(&operand);
        } else {
            rest.push_back(&operand);
            values.push_back(locate(numbers, operand, &evidence, weights));
        }
    }
    const std::size_t size = step.size * static_cast<std::size_t>(step.variable >= 0 ? network_->sizes[step.variable] : 1);
    if (messages.size() < min_messages || size * messages.size() > max_clique_numbers) return {};
    const Operand clique = make_clique(step);
    std::vector<T> buffer, before(size, T(0.0));
    make_nest<T>(step, clique.scope, rest).run(before.data(), values, buffer);
    const auto multiply = [&](const std::vector<T>& table, const Operand& operand) {
        std::vector<T> product(size, T(0.0));
        std::vector<const T*> pair{table.data(), locate(numbers, operand, &evidence, weights)};
        make_nest<T>(step, clique.scope, {&clique, &operand}).run(product.data(), pair, buffer);
        return product;
    };
    std::vector<std::vector<T>> others(messages.size());
    others.back().assign(size, T(1.0));  // first the products of those behind
    for (std::size_t k = messages.size() - 1; k-- > 0;) others[k] = multiply(others[k + 1], *messages[k + 1]);
    for (std::size_t k = 0; k < messages.size(); ++k) {
        for (std::size_t entry = 0; entry < size; ++entry) others[k][entry] *= before[entry];
        if (k + 1 < messages.size()) before = multiply(before, *messages[k]);
    }
    return others;
}

// An operand with all variables of a step.
inline Plan::Operand Plan::make_clique(const Step& step) const {
    std::vector<int> scope = step.scope;
    if (step.variable >= 0) scope.push_back(step.variable);
    return {Kind::derivative, 0, scope, list_strides(scope), {}};
}

// From the last step to the first: the derivatives of the total with respect to each message, and the marginals. Source:
// Darwiche, "A differential approach to inference in Bayesian networks", J. ACM 50(3), 2003.
template <typename T, typename Check>
bool Plan::derive(Numbers<T>& numbers, const Evidence& evidence, const std::vector<T>& weights, double* result,
                  Check& check) {
    std::vector<std::vector<T>> derivatives(steps_.size());
    derivatives.back().assign(1, T(1.0));
    std::vector<double> lowest(steps_.size(), 0.0);
    std::vector<Offset> offsets(network_->sizes.size(), 0);
    for (std::size_t v = 1; v < offsets.size(); ++v) offsets[v] = offsets[v - 1] + network_->sizes[v - 1];
    std::vector<T> buffer, marginal;
    bool is_extreme = false;
    double ignored = 0.0;
    for (std::size_t i = steps_.size(); i-- > 0;) {
        const Step& step = steps_[i];
        check(3 * step.size);
        const Operand own{Kind::derivative, static_cast<int>(i), step.scope, list_strides(step.scope), {}};
        // The product of all operands but one, summed over the variables that are not in `out`.
        const auto sum = [&](const std::vector<int>& out, const Operand* omitted, std::vector<T>& target) {
            std::vector<const Operand*> factors{&own};
            std::vector<const T*> values{derivatives[i].data()};
            for (const Operand& operand : step.operands) {
                if (&operand == omitted) continue;
                factors.push_back(&operand);
                values.push_back(locate(numbers, operand, &evidence, weights));
            }
            make_nest<T>(step, out, factors).run(target.data(), values, buffer);
            double own_lowest = 0.0;
            scale(target, ignored, own_lowest);
            return own_lowest;
        };
        double product = lowest[i];
        for (const Operand& operand : step.operands) {
            const auto k = static_cast<std::size_t>(operand.index);
            product += operand.kind == Kind::table     ? network_->lowest[k]
                       : operand.kind == Kind::message ? numbers.lowest[k]
                                                       : lowest_weight_;
        }
        is_extreme |= std::is_same_v<T, double> && product < min_product;
        const std::vector<std::vector<T>> others = multiply_others(numbers, step, own, derivatives[i], evidence, weights);
        std::size_t n_messages = 0;
        const std::vector<T>* summed = nullptr;  // a message and its derivative, whose product has the marginal
        const std::vector<T>* message = nullptr;
        std::size_t run = 1;  // the stride of the variable in the message
        for (const Operand& operand : step.operands) {
            if (operand.kind != Kind::message) continue;
            const auto child = static_cast<std::size_t>(operand.index);
            derivatives[child].assign(steps_[child].size, T(0.0));
            if (others.empty()) {
                lowest[child] = sum(steps_[child].scope, &operand, derivatives[child]);
            } else {
                const Operand clique = make_clique(step);
                std::vector<const T*> values{others[n_messages].data()};
                make_nest<T>(step, steps_[child].scope, {&clique}).run(derivatives[child].data(), values, buffer);
                scale(derivatives[child], ignored, lowest[child]);
            }
            ++n_messages;
            is_extreme |= std::is_same_v<T, double> && lowest[child] + numbers.lowest[child] < min_product;
            if (!summed || derivatives[child].size() < summed->size()) {
                summed = &derivatives[child];
                message = &numbers.messages[child];
                const auto& scope = operand.scope;
                const auto at = std::find(scope.begin(), scope.end(), step.variable) - scope.begin();
                run = step.variable < 0 ? 1 : static_cast<std::size_t>(operand.strides[static_cast<std::size_t>(at)]);
            }
        }
        if (step.variable < 0) continue;
        const auto size = static_cast<std::size_t>(network_->sizes[step.variable]);
        marginal.assign(size, T(0.0));
        if (summed) {
            for (std::size_t k = 0; k < summed->size(); ++k) marginal[k / run % size] += (*summed)[k] * (*message)[k];
            double own_lowest = 0.0;
            scale(marginal, ignored, own_lowest);
        } else {
            sum({step.variable}, nullptr, marginal);
        }
        for (std::size_t k = 0; k < size; ++k) {
            if constexpr (std::is_same_v<T, double>) {
                result[static_cast<std::size_t>(offsets[step.variable]) + k] = marginal[k];
            } else {
                result[static_cast<std::size_t>(offsets[step.variable]) + k] = marginal[k].divide_by(T(1.0));
            }
        }
        std::vector<T>().swap(derivatives[i]);
    }
    for (std::size_t i = 0; i < question_.observed.size(); ++i) {
        result[offsets[question_.observed[i]] + evidence.values[i]] = 1.0;
    }
    return is_extreme;
}

}  // namespace lcorpp
