// Copies of tables with their axes in another order.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace lcorpp {

// Two axes are the inner loops: the one along which the source is contiguous, and the one along which the copy is. They are
// divided into squares, so that both stay in the cache.
class Reorder {
  public:
    using Offset = std::int64_t;

    Reorder() = default;

    // sizes: of the axes. out_strides, strides: of the copy and of the source, by axis.
    Reorder(const std::vector<Offset>& sizes, const std::vector<Offset>& out_strides, const std::vector<Offset>& strides) {
        for (std::size_t axis = 0; axis < sizes.size(); ++axis) {
            if (sizes[axis] > 1) axes_.push_back({sizes[axis], out_strides[axis], strides[axis]});
        }
        std::sort(axes_.begin(), axes_.end(), [](const Axis& a, const Axis& b) { return a.out > b.out; });
        for (std::size_t k = axes_.size(); k-- > 1;) {  // axes that are next to each other in both become one
            Axis &a = axes_[k - 1], &b = axes_[k];
            if (a.out != b.out * b.size || a.in != b.in * b.size) continue;
            a = {a.size * b.size, b.out, b.in};
            axes_.erase(axes_.begin() + static_cast<std::ptrdiff_t>(k));
        }
        if (axes_.empty()) axes_.push_back({1, 1, 1});
        last_ = axes_.back();
        axes_.pop_back();
        if (last_.in == 1) return;
        const auto contiguous = std::find_if(axes_.begin(), axes_.end(), [](const Axis& axis) { return axis.in == 1; });
        if (contiguous == axes_.end()) return;
        other_ = *contiguous;
        axes_.erase(contiguous);
    }

    double estimate() const {
        double entries = static_cast<double>(last_.size * other_.size);
        const double tile = std::min<double>(entries, side * side);
        for (const Axis& axis : axes_) entries *= static_cast<double>(axis.size);
        return entries * (1.2 + 20.0 / tile);
    }

    void run(double* out, const double* in) const { enter(0, out, in); }

  private:
    struct Axis {
        Offset size = 1, out = 0, in = 0;
    };
    static constexpr Offset side = 16;  // of the squares

    void enter(std::size_t level, double* out, const double* in) const {
        if (level == axes_.size()) {
            copy_plane(out, in);
            return;
        }
        const Axis& axis = axes_[level];
        for (Offset i = 0; i < axis.size; ++i, out += axis.out, in += axis.in) enter(level + 1, out, in);
    }

    void copy_plane(double* out, const double* in) const {
        if (last_.in == 1) {
            std::copy_n(in, last_.size, out);
            return;
        }
        for (Offset i = 0; i < other_.size; i += side) {
            const Offset end_i = std::min(i + side, other_.size);
            for (Offset j = 0; j < last_.size; j += side) {
                const Offset end_j = std::min(j + side, last_.size);
                for (Offset k = i; k < end_i; ++k) {
                    double* to = out + k * other_.out;
                    const double* from = in + k * other_.in;
                    for (Offset l = j; l < end_j; ++l) to[l] = from[l * last_.in];
                }
            }
        }
    }

    std::vector<Axis> axes_;  // the outer loops
    Axis last_, other_;       // the copy is contiguous along the one, the source along the other
};

}  // namespace lcorpp
