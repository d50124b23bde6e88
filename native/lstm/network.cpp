#include "network.hpp"

#include <algorithm>

namespace lcorpp::lstm {

namespace {

// Calls visit(layout_index, numpy_index, array) for every weight: its index in Layout, and its index in one of the numpy
// arrays, in the order of ConstArrays: 0 inputs, 1 recurrent, 2 bias, 3 dense, 4 dense bias.
// A column of the gates has K = U + C + 1 rows: hidden units, input channels, bias.
template <typename Visit>
void for_each_weight(Shape shape, Visit visit) {
    const Index U = shape.units, C = shape.channels, K = shape.rows();
    const Layout layout{shape};
    for (Index gate = 0; gate < 4; ++gate) {
        for (Index u = 0; u < U; ++u) {
            const Index row = gate * U + u;
            const auto layout_index = [&](Index k) { return (k * U + u) * 4 + gate; };
            for (Index k = 0; k < U; ++k) visit(layout_index(k), row * U + k, 1);
            for (Index c = 0; c < C; ++c) visit(layout_index(U + c), row * C + c, 0);
            visit(layout_index(K - 1), row, 2);
        }
    }
    for (Index i = layout.gates(); i < layout.dense(); ++i) visit(i, i - layout.gates(), 3);
    for (Index i = layout.dense(); i < layout.all(); ++i) visit(i, i - layout.dense(), 4);
}

}  // namespace

Floats gather(Shape shape, const ConstArrays& arrays) {
    Floats weights(Layout{shape}.all());
    const float* const parts[] = {arrays.inputs, arrays.recurrent, arrays.bias, arrays.dense, arrays.dense_bias};
    for_each_weight(shape, [&](Index layout_index, Index numpy_index, int array) {
        weights.data()[layout_index] = parts[array][numpy_index];
    });
    return weights;
}

void scatter(Shape shape, const float* weights, const Arrays& arrays) {
    float* const parts[] = {arrays.inputs, arrays.recurrent, arrays.bias, arrays.dense, arrays.dense_bias};
    for_each_weight(shape, [&](Index layout_index, Index numpy_index, int array) {
        parts[array][numpy_index] = weights[layout_index];
    });
}

Network::Network(const Kernels& kernels, Shape shape, const ConstArrays& arrays)
    : kernels_(kernels),
      layout_{shape},
      weights_(gather(shape, arrays)),
      forward_(kernels.forward_size(shape)),
      backward_(kernels.backward_size(shape)) {
    kernels_.pack(shape, weights_.data(), forward_.data(), backward_.data());
}

void Network::scores(Index n, Index times, const float* tracks, float* scores) const {
    const Index U = shape().units, C = shape().channels, K = shape().rows();
    // Two buffers of rows (K, kLanes) and of cells (U, kLanes), used alternately: the state before and after a time point.
    Floats rows(2 * K * kLanes), cells(2 * U * kLanes), gates(4 * U * kLanes);
    for (Index begin = 0; begin < n; begin += kLanes) {
        const Index cases = std::min(n - begin, kLanes);
        std::fill_n(rows.data(), 2 * K * kLanes, 0.0f);
        std::fill_n(cells.data(), 2 * U * kLanes, 0.0f);
        for (Index buffer = 0; buffer < 2; ++buffer) std::fill_n(rows.data() + (buffer * K + K - 1) * kLanes, kLanes, 1.0f);
        for (Index t = 0; t < times; ++t) {
            float* now = rows.data() + t % 2 * K * kLanes;
            float* next = rows.data() + (t + 1) % 2 * K * kLanes;
            for (Index i = 0; i < cases; ++i) {
                for (Index c = 0; c < C; ++c) now[(U + c) * kLanes + i] = tracks[((begin + i) * times + t) * C + c];
            }
            kernels_.step(shape(), forward_.data(), cases, now, cells.data() + t % 2 * U * kLanes, gates.data(),
                          cells.data() + (t + 1) % 2 * U * kLanes, next);
        }
        dense(cases, rows.data() + times % 2 * K * kLanes, scores + begin * shape().outputs);
    }
}

void Network::step(Index n, const float* points, float* hidden, float* cell, float* scores) const {
    const Index U = shape().units, C = shape().channels, K = shape().rows();
    Floats rows(K * kLanes), cells(U * kLanes), gates(4 * U * kLanes), outputs(U * kLanes);
    std::fill_n(rows.data() + (K - 1) * kLanes, kLanes, 1.0f);
    for (Index begin = 0; begin < n; begin += kLanes) {
        const Index cases = std::min(n - begin, kLanes);
        for (Index i = 0; i < cases; ++i) {
            for (Index u = 0; u < U; ++u) {
                rows.data()[u * kLanes + i] = hidden[(begin + i) * U + u];
                cells.data()[u * kLanes + i] = cell[(begin + i) * U + u];
            }
            for (Index c = 0; c < C; ++c) rows.data()[(U + c) * kLanes + i] = points[(begin + i) * C + c];
        }
        kernels_.step(shape(), forward_.data(), cases, rows.data(), cells.data(), gates.data(), cells.data(),
                      outputs.data());
        for (Index i = 0; i < cases; ++i) {
            for (Index u = 0; u < U; ++u) {
                hidden[(begin + i) * U + u] = outputs.data()[u * kLanes + i];
                cell[(begin + i) * U + u] = cells.data()[u * kLanes + i];
            }
        }
        dense(cases, outputs.data(), scores + begin * shape().outputs);
    }
}

void Network::dense(Index cases, const float* outputs, float* scores) const {
    const Index U = shape().units, O = shape().outputs;
    const float* table = weights_.data() + layout_.gates();
    const float* bias = weights_.data() + layout_.dense();
    for (Index i = 0; i < cases; ++i) {
        for (Index o = 0; o < O; ++o) {
            float sum = bias[o];
            for (Index u = 0; u < U; ++u) sum += table[o * U + u] * outputs[u * kLanes + i];
            scores[i * O + o] = sum;
        }
    }
}

}  // namespace lcorpp::lstm
