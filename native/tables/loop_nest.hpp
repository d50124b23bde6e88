// Sum-product of tables: out[s] = sum over the other axes of the product of all operands.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace lcorpp {

using Offset = std::int64_t;

// A loop over the axes of a clique. Axes that all operands store next to each other become one; the one with the longest
// runs of memory is the inner loop. Operands without the inner axis are factors of whole runs, multiplied once for each
// value of the axes that they have; a run with a factor 0 is skipped.
template <typename T>
class LoopNest {
  public:
    LoopNest() = default;

    // sizes: of the axes. out_strides, strides: of the result, and of each operand, by axis; 0 if it lacks the axis.
    LoopNest(std::vector<Offset> sizes, std::vector<Offset> out_strides, std::vector<std::vector<Offset>> strides)
        : sizes_(std::move(sizes)), out_strides_(std::move(out_strides)), strides_(std::move(strides)) {
        merge_axes();
        order_axes();
        const std::size_t outer = sizes_.size() - 1;
        scalars_.resize(outer + 1);
        vectors_.resize(outer + 1);
        moving_.resize(outer);
        for (std::size_t operand = 0; operand < strides_.size(); ++operand) {
            std::size_t level = 0;  // 0 for none of the outer axes
            for (std::size_t axis = 0; axis < outer; ++axis) {
                if (strides_[operand][axis] == 0) continue;
                level = axis + 1;
                moving_[axis].push_back(operand);
            }
            (strides_[operand].back() == 0 ? scalars_ : vectors_)[level].push_back(operand);
        }
    }

    // Estimate the cycles of a run. An entry takes one and a half for each jump in memory, an inner loop some to begin.
    double estimate() const {
        double entries = 1.0;
        for (const Offset size : sizes_) entries *= static_cast<double>(size);
        int jumps = out_strides_.back() > 1;
        for (const auto& own : strides_) jumps += own.back() > 1;
        return entries * (0.6 + jumps + 20.0 / static_cast<double>(sizes_.back()));
    }

    // Add to `out`, given a pointer to the first entry of each operand; the pointers are the same afterwards.
    void run(T* out, std::vector<const T*>& operands, std::vector<T>& buffer) const {
        const std::size_t needed = static_cast<std::size_t>(sizes_.back()) * sizes_.size();
        if (buffer.size() < needed) buffer.resize(needed);
        enter(0, out, T(1.0), {nullptr, 0}, buffer.data(), operands.data());
    }

  private:
    // A product of operands along the inner axis; null if there are none.
    struct Run {
        const T* values;
        Offset stride;
    };

    void merge_axes() {
        const auto fits = [](const std::vector<Offset>& own, std::size_t a, std::size_t b, Offset size) {
            return own[a] == own[b] * size;
        };
        for (std::size_t a = 0; a < sizes_.size(); ++a) {
            for (std::size_t b = 0; b < sizes_.size() && sizes_.size() > 1; ++b) {
                if (a == b) continue;
                bool can_merge = sizes_[a] == 1 || fits(out_strides_, a, b, sizes_[b]);
                for (std::size_t i = 0; can_merge && sizes_[a] > 1 && i < strides_.size(); ++i) {
                    can_merge = fits(strides_[i], a, b, sizes_[b]);
                }
                if (!can_merge) continue;
                sizes_[b] *= sizes_[a];
                const auto at = static_cast<std::ptrdiff_t>(a);
                sizes_.erase(sizes_.begin() + at);
                out_strides_.erase(out_strides_.begin() + at);
                for (auto& own : strides_) own.erase(own.begin() + at);
                a = static_cast<std::size_t>(-1);  // from the start, as the merged axis may fit others now
                break;
            }
        }
    }

    void order_axes() {
        std::vector<std::size_t> order(sizes_.size());
        std::vector<int> users(sizes_.size(), 0);
        std::size_t inner = 0;
        double best = -1.0;
        for (std::size_t axis = 0; axis < sizes_.size(); ++axis) {
            order[axis] = axis;
            int jumps = out_strides_[axis] > 1;
            for (const auto& own : strides_) {
                users[axis] += own[axis] != 0;
                jumps += own[axis] > 1;
            }
            // beyond 64 entries a run is not faster; each operand and each jump in memory makes it slower
            const double length = static_cast<double>(std::min<Offset>(sizes_[axis], 64));
            const double value = length / (1.0 + 0.5 * jumps) / (1.0 + 0.25 * users[axis]);
            if (value > best) {
                best = value;
                inner = axis;
            }
        }
        std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
            if ((a == inner) != (b == inner)) return b == inner;
            return users[a] != users[b] ? users[a] > users[b] : sizes_[a] < sizes_[b];
        });
        const auto sort = [&](std::vector<Offset>& own) {
            std::vector<Offset> sorted;
            for (const std::size_t axis : order) sorted.push_back(own[axis]);
            own = std::move(sorted);
        };
        sort(sizes_);
        sort(out_strides_);
        for (auto& own : strides_) sort(own);
    }

    // Multiply the operands of a level, then loop over the next axis.
    void enter(std::size_t level, T* out, T factor, Run run, T* buffer, const T** operands) const {
        for (const std::size_t operand : scalars_[level]) factor *= *operands[operand];
        if (is_zero(factor)) return;
        for (const std::size_t operand : vectors_[level]) {
            multiply(run, {operands[operand], strides_[operand].back()}, buffer);
        }
        if (level + 1 == sizes_.size()) {  // no outer axis at all
            add(out, factor, run);
            return;
        }
        if (run.values == buffer) buffer += sizes_.back();
        if (level + 2 == sizes_.size()) {
            sweep(level, out, factor, run, buffer, operands);
            return;
        }
        const Offset size = sizes_[level], out_stride = out_strides_[level];
        const std::vector<std::size_t>& moving = moving_[level];
        for (Offset i = 0; i < size; ++i, out += out_stride) {
            enter(level + 1, out, factor, run, buffer, operands);
            for (const std::size_t operand : moving) operands[operand] += strides_[operand][level];
        }
        for (const std::size_t operand : moving) operands[operand] -= size * strides_[operand][level];
    }

    // Loop over the last outer axis; the operands that have it are those of the level after it.
    void sweep(std::size_t axis, T* out, const T factor, const Run run, T* buffer, const T* const* operands) const {
        const std::vector<std::size_t>&scalars = scalars_[axis + 1], &vectors = vectors_[axis + 1];
        const Offset size = sizes_[axis], out_stride = out_strides_[axis];
        for (Offset i = 0; i < size; ++i, out += out_stride) {
            T own = factor;
            for (const std::size_t operand : scalars) own *= operands[operand][i * strides_[operand][axis]];
            if (is_zero(own)) continue;
            Run product = run;
            std::size_t k = 0;
            const auto next = [&]() -> Run {
                const std::size_t operand = vectors[k];
                return {operands[operand] + i * strides_[operand][axis], strides_[operand].back()};
            };
            for (; k + 1 < vectors.size(); ++k) multiply(product, next(), buffer);
            if (k == vectors.size()) {
                add(out, own, product);
            } else if (!product.values) {
                add(out, own, next());
            } else {
                add_product(out, own, product, next());
            }
        }
    }

    // Multiply a run by another, in the buffer if both are there.
    void multiply(Run& run, Run next, T* buffer) const {
        if (!run.values) {
            run = next;
            return;
        }
        const Offset inner = sizes_.back();
        for (Offset k = 0; k < inner; ++k) buffer[k] = run.values[k * run.stride] * next.values[k * next.stride];
        run = {buffer, 1};
    }

    void add(T* out, T factor, Run run) const {
        const Offset inner = sizes_.back(), stride = out_strides_.back();
        if (!run.values) {  // only factors
            if (stride == 0) {
                *out += factor * T(static_cast<double>(inner));
            } else {
                for (Offset k = 0; k < inner; ++k) out[k * stride] += factor;
            }
        } else if (stride == 0) {
            T sum(0.0);
            if (run.stride == 1) {
                for (Offset k = 0; k < inner; ++k) sum += run.values[k];
            } else {
                for (Offset k = 0; k < inner; ++k) sum += run.values[k * run.stride];
            }
            *out += factor * sum;
        } else if (stride == 1 && run.stride == 1) {
            for (Offset k = 0; k < inner; ++k) out[k] += factor * run.values[k];
        } else {
            for (Offset k = 0; k < inner; ++k) out[k * stride] += factor * run.values[k * run.stride];
        }
    }

    void add_product(T* out, T factor, Run a, Run b) const {
        const Offset inner = sizes_.back(), stride = out_strides_.back();
        if (stride == 0) {
            T sum(0.0);
            if (a.stride == 1 && b.stride == 1) {
                for (Offset k = 0; k < inner; ++k) sum += a.values[k] * b.values[k];
            } else {
                for (Offset k = 0; k < inner; ++k) sum += a.values[k * a.stride] * b.values[k * b.stride];
            }
            *out += factor * sum;
        } else if (stride == 1 && a.stride == 1 && b.stride == 1) {
            for (Offset k = 0; k < inner; ++k) out[k] += factor * a.values[k] * b.values[k];
        } else {
            for (Offset k = 0; k < inner; ++k) out[k * stride] += factor * a.values[k * a.stride] * b.values[k * b.stride];
        }
    }

    std::vector<Offset> sizes_, out_strides_;
    std::vector<std::vector<Offset>> strides_;
    // level -> the operands whose deepest outer axis is level - 1: without the inner axis, and with it
    std::vector<std::vector<std::size_t>> scalars_, vectors_;
    std::vector<std::vector<std::size_t>> moving_;  // outer axis -> the operands that have it
};

}  // namespace lcorpp
