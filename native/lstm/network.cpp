// The forward pass: cases are copied into the lanes of blocks of kLanes, which the kernels compute together.

#include "network.hpp"

#include <algorithm>
#include <utility>

namespace lcorpp::lstm {

namespace {

// Calls visit(index, weight) for every weight, with its index in Layout and its place in a numpy array. The gates are
// interleaved in Layout and consecutive in numpy; their K = U + C + 1 rows are hidden units, input channels, bias.
template <typename T, typename Visit>
void for_each_weight(Shape shape, const NumpyArrays<T>& arrays, Visit visit) {
    const Index U = shape.units, C = shape.channels, K = shape.rows(), O = shape.outputs;
    const Layout layout{shape};
    for (Index gate = 0; gate < 4; ++gate) {
        for (Index u = 0; u < U; ++u) {
            const Index row = gate * U + u;
            const auto index = [&](Index k) { return (k * U + u) * 4 + gate; };
            for (Index k = 0; k < U; ++k) visit(index(k), arrays.recurrent[row * U + k]);
            for (Index c = 0; c < C; ++c) visit(index(U + c), arrays.inputs[row * C + c]);
            visit(index(K - 1), arrays.bias[row]);
        }
    }
    for (Index i = 0; i < O * U; ++i) visit(layout.dense() + i, arrays.dense[i]);
    for (Index i = 0; i < O; ++i) visit(layout.dense_bias() + i, arrays.dense_bias[i]);
}

}  // namespace

Floats from_numpy_arrays(Shape shape, const NumpyArrays<const float>& arrays) {
    Floats weights(Layout{shape}.size());
    for_each_weight(shape, arrays, [&](Index index, const float& weight) { weights[index] = weight; });
    return weights;
}

void to_numpy_arrays(Shape shape, const float* weights, const NumpyArrays<float>& arrays) {
    for_each_weight(shape, arrays, [&](Index index, float& weight) { weight = weights[index]; });
}

Network::Network(const Kernels& kernels, Shape shape, const NumpyArrays<const float>& arrays)
    : kernels_(kernels),
      layout_{shape},
      weights_(from_numpy_arrays(shape, arrays)),
      forward_(kernels.forward_size(shape)) {
    Floats backward(kernels.backward_size(shape));  // only a training reads it
    kernels_.pack(shape, weights_.data(), forward_.data(), backward.data());
}

void Network::scores(Index n, Index times, const float* tracks, const std::int64_t* lengths, float* scores) const {
    const Index U = shape().units, C = shape().channels, K = shape().rows();
    // Two buffers of rows (K, kLanes), used alternately: the state before and after a time point.
    Floats rows(2 * K * kLanes), cells(U * kLanes), gates(4 * U * kLanes), last(U * kLanes);
    float *now = rows.data(), *next = now + K * kLanes;
    for (Index begin = 0; begin < n; begin += kLanes) {
        const Index cases = std::min(n - begin, kLanes);
        std::fill_n(now, (K - 1) * kLanes, 0.0f);
        std::fill_n(cells.data(), U * kLanes, 0.0f);
        for (float* buffer : {now, next}) std::fill_n(buffer + (K - 1) * kLanes, kLanes, 1.0f);  // for the bias
        const std::int64_t* const ends = lengths + begin;
        for (Index t = 0, longest = *std::max_element(ends, ends + cases); t < longest; ++t) {
            for (Index i = 0; i < cases; ++i) {
                for (Index c = 0; c < C; ++c) now[(U + c) * kLanes + i] = tracks[((begin + i) * times + t) * C + c];
            }
            kernels_.step(shape(), forward_.data(), cases, now, cells.data(), gates.data(), cells.data(), next);
            std::swap(now, next);
            for (Index i = 0; i < cases; ++i) {
                if (ends[i] != t + 1) continue;
                for (Index u = 0; u < U; ++u) last[u * kLanes + i] = now[u * kLanes + i];
            }
        }
        apply_dense(cases, last.data(), scores + begin * shape().outputs);
    }
}

void Network::step(Index n, const float* points, float* hidden, float* cell, float* scores) const {
    const Index U = shape().units, C = shape().channels, K = shape().rows();
    Floats rows(K * kLanes), cells(U * kLanes), gates(4 * U * kLanes), next_hidden(U * kLanes);
    std::fill_n(rows.data() + (K - 1) * kLanes, kLanes, 1.0f);  // for the bias
    for (Index begin = 0; begin < n; begin += kLanes) {
        const Index cases = std::min(n - begin, kLanes);
        for (Index i = 0; i < cases; ++i) {
            for (Index u = 0; u < U; ++u) {
                rows[u * kLanes + i] = hidden[(begin + i) * U + u];
                cells[u * kLanes + i] = cell[(begin + i) * U + u];
            }
            for (Index c = 0; c < C; ++c) rows[(U + c) * kLanes + i] = points[(begin + i) * C + c];
        }
        kernels_.step(shape(), forward_.data(), cases, rows.data(), cells.data(), gates.data(), cells.data(),
                      next_hidden.data());
        for (Index i = 0; i < cases; ++i) {
            for (Index u = 0; u < U; ++u) {
                hidden[(begin + i) * U + u] = next_hidden[u * kLanes + i];
                cell[(begin + i) * U + u] = cells[u * kLanes + i];
            }
        }
        apply_dense(cases, next_hidden.data(), scores + begin * shape().outputs);
    }
}

void Network::apply_dense(Index cases, const float* outputs, float* scores) const {
    const Index U = shape().units, O = shape().outputs;
    const float* dense = weights_.data() + layout_.dense();
    const float* bias = weights_.data() + layout_.dense_bias();
    for (Index i = 0; i < cases; ++i) {
        for (Index o = 0; o < O; ++o) {
            float sum = bias[o];
            for (Index u = 0; u < U; ++u) sum += dense[o * U + u] * outputs[u * kLanes + i];
            scores[i * O + o] = sum;
        }
    }
}

}  // namespace lcorpp::lstm
