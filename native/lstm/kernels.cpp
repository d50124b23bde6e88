// The kernels of the LSTM. This file is compiled once for each instruction set, see CMakeLists.txt. It does not use
// the standard library, because the linker could merge a function with instructions that a machine lacks.

#include "lstm.hpp"

#ifndef LCORPP_INSTRUCTION_SET
#define LCORPP_INSTRUCTION_SET base
#endif
#define LCORPP_TEXT_(x) #x
#define LCORPP_TEXT(x) LCORPP_TEXT_(x)

#define INLINE __attribute__((always_inline)) inline

namespace lcorpp::lstm::LCORPP_INSTRUCTION_SET {

namespace {

// The width of a vector, and the size of the tiles of sums in registers: vectors of lanes by rows.
#if defined(__AVX512F__)
constexpr Index kWide = 16, kVectors = 2, kUnits = 3, kBack = 10, kPanel = 6;
#elif defined(__AVX2__)
constexpr Index kWide = 8, kVectors = 2, kUnits = 1, kBack = 5, kPanel = 3;
#else
constexpr Index kWide = 4, kVectors = 2, kUnits = 1, kBack = 5, kPanel = 3;
#endif

typedef float Vector __attribute__((vector_size(kWide * sizeof(float)), aligned(kWide * sizeof(float)), may_alias));

INLINE Vector load(const float* at) { return *reinterpret_cast<const Vector*>(at); }
INLINE void store(float* at, Vector v) { *reinterpret_cast<Vector*>(at) = v; }
INLINE Vector all(float x) { return Vector{} + x; }

// The rational function of Eigen (Tanh in MathFunctionsImpl.h): within a few ulp in float32.
INLINE Vector tanh(Vector x) {
    const Vector limit = all(7.90531110763549805f);
    x = x > limit ? limit : x;
    x = x < -limit ? -limit : x;
    const Vector s = x * x;
    Vector p = s * -2.76076847742355e-16f + 2.00018790482477e-13f;
    p = p * s + -8.60467152213735e-11f;
    p = p * s + 5.12229709037114e-08f;
    p = p * s + 1.48572235717979e-05f;
    p = p * s + 6.37261928875436e-04f;
    p = p * s + 4.89352455891786e-03f;
    Vector q = s * 1.19825839466702e-06f + 1.18534705686654e-04f;
    q = q * s + 2.26843463243900e-03f;
    q = q * s + 4.89352518554385e-03f;
    return x * p / q;
}

INLINE Vector sigmoid(Vector x) { return tanh(x * 0.5f) * 0.5f + 0.5f; }

// n, rounded up to a multiple of `step`.
INLINE Index round_up(Index n, Index step) { return (n + step - 1) / step * step; }

Index forward_size(Shape shape) { return shape.rows() * round_up(shape.units, kUnits) * 4; }

Index backward_size(Shape shape) { return shape.units * 4 * round_up(shape.units, kBack); }

void pack(Shape shape, const float* gates, float* forward, float* backward) {
    const Index U = shape.units, K = shape.rows();
    for (Index first = 0; first < U; first += kUnits) {
        const Index n = (U - first < kUnits ? U - first : kUnits) * 4;
        for (Index k = 0; k < K; ++k, forward += kUnits * 4) {
            for (Index r = 0; r < n; ++r) forward[r] = gates[(k * U + first) * 4 + r];
        }
    }
    for (Index first = 0; first < U; first += kBack) {
        const Index n = U - first < kBack ? U - first : kBack;
        for (Index j = 0; j < 4 * U; ++j, backward += kBack) {
            for (Index r = 0; r < n; ++r) backward[r] = gates[(first + r) * U * 4 + j];
        }
    }
}

// The time step of `N` units for `V` vectors of lanes: sums over the rows, then the new cell and output.
template <Index N, Index V>
void step_tile(Index K, const float* weights, const float* rows, const float* cells, float* gates, float* new_cells,
               float* outputs) {
    Vector sums[N * 4][V];
#pragma GCC unroll 64
    for (Index r = 0; r < N * 4; ++r) {
#pragma GCC unroll 8
        for (Index v = 0; v < V; ++v) sums[r][v] = Vector{};
    }
    for (Index k = 0; k < K; ++k) {
        Vector row[V];
#pragma GCC unroll 8
        for (Index v = 0; v < V; ++v) row[v] = load(rows + k * kLanes + v * kWide);
#pragma GCC unroll 64
        for (Index r = 0; r < N * 4; ++r) {
#pragma GCC unroll 8
            for (Index v = 0; v < V; ++v) sums[r][v] += weights[k * kUnits * 4 + r] * row[v];
        }
    }
#pragma GCC unroll 8
    for (Index u = 0; u < N; ++u) {
#pragma GCC unroll 8
        for (Index v = 0; v < V; ++v) {
            const Index at = u * kLanes + v * kWide;
            const Vector i = sigmoid(sums[u * 4][v]), f = sigmoid(sums[u * 4 + 1][v]);
            const Vector g = tanh(sums[u * 4 + 2][v]), o = sigmoid(sums[u * 4 + 3][v]);
            const Vector c = f * load(cells + at) + i * g;
            float* gate = gates + u * 4 * kLanes + v * kWide;
            store(gate, i);
            store(gate + kLanes, f);
            store(gate + 2 * kLanes, g);
            store(gate + 3 * kLanes, o);
            store(new_cells + at, c);
            store(outputs + at, o * tanh(c));
        }
    }
}

// Calls tile(lane) for one or kVectors vectors of lanes at a time, until all cases are covered.
template <typename Many, typename One>
INLINE void for_each_lanes(Index cases, Many many, One one) {
    for (Index lane = 0; lane < cases;) {
        const bool full = cases - lane > (kVectors - 1) * kWide;
        full ? many(lane) : one(lane);
        lane += full ? kVectors * kWide : kWide;
    }
}

template <Index V>
void step_units(Index n, Index K, const float* weights, const float* rows, const float* cells, float* gates,
                float* new_cells, float* outputs) {
    switch (n) {
        case 1: return step_tile<1, V>(K, weights, rows, cells, gates, new_cells, outputs);
        case 2: return step_tile<(kUnits < 2 ? kUnits : 2), V>(K, weights, rows, cells, gates, new_cells, outputs);
        default: return step_tile<kUnits, V>(K, weights, rows, cells, gates, new_cells, outputs);
    }
}

void step(Shape shape, const float* forward, Index cases, const float* rows, const float* cells, float* gates,
          float* new_cells, float* outputs) {
    const Index U = shape.units, K = shape.rows();
    for (Index first = 0; first < U; first += kUnits, forward += K * kUnits * 4) {
        const auto run = [&](auto units, Index lane) {
            const Index at = first * kLanes + lane;
            units(U - first, K, forward, rows + lane, cells + at, gates + 4 * first * kLanes + lane, new_cells + at,
                  outputs + at);
        };
        for_each_lanes(
            cases, [&](Index lane) { run(step_units<kVectors>, lane); }, [&](Index lane) { run(step_units<1>, lane); });
    }
}

// Gradients of the gates of one time point from those of its output and cell. The gradient of the cell is replaced by
// that of the previous cell.
INLINE void back_gates(Index U, Index cases, const float* before, const float* after, float* gates, const float* hidden,
                       float* cell) {
    for (Index u = 0; u < U; ++u) {
        for (Index lane = 0; lane < cases; lane += kWide) {
            const Index at = u * kLanes + lane;
            float* gate = gates + 4 * u * kLanes + lane;
            const Vector i = load(gate), f = load(gate + kLanes), g = load(gate + 2 * kLanes), o = load(gate + 3 * kLanes);
            const Vector c = tanh(load(after + at)), dh = load(hidden + at);
            const Vector dc = load(cell + at) + dh * o * (1.0f - c * c);
            store(gate, dc * g * i * (1.0f - i));
            store(gate + kLanes, dc * load(before + at) * f * (1.0f - f));
            store(gate + 2 * kLanes, dc * i * (1.0f - g * g));
            store(gate + 3 * kLanes, dh * c * o * (1.0f - o));
            store(cell + at, dc * f);
        }
    }
}

// Gradients of `N` outputs for `V` vectors of lanes: sums over all gates.
template <Index N, Index V>
void back_tile(Index J, const float* weights, const float* gates, float* hidden) {
    Vector sums[N][V];
#pragma GCC unroll 64
    for (Index r = 0; r < N; ++r) {
#pragma GCC unroll 8
        for (Index v = 0; v < V; ++v) sums[r][v] = Vector{};
    }
    for (Index j = 0; j < J; ++j) {
        Vector gate[V];
#pragma GCC unroll 8
        for (Index v = 0; v < V; ++v) gate[v] = load(gates + j * kLanes + v * kWide);
#pragma GCC unroll 64
        for (Index r = 0; r < N; ++r) {
#pragma GCC unroll 8
            for (Index v = 0; v < V; ++v) sums[r][v] += weights[j * kBack + r] * gate[v];
        }
    }
#pragma GCC unroll 64
    for (Index r = 0; r < N; ++r) {
#pragma GCC unroll 8
        for (Index v = 0; v < V; ++v) store(hidden + r * kLanes + v * kWide, sums[r][v]);
    }
}

template <Index N, Index V>
void back_rows(Index n, Index J, const float* weights, const float* gates, float* hidden) {
    if constexpr (N > 1) {
        if (n < N) return back_rows<N - 1, V>(n, J, weights, gates, hidden);
    }
    back_tile<N, V>(J, weights, gates, hidden);
}

void back_hidden(Index U, const float* backward, Index cases, const float* gates, float* hidden) {
    for (Index first = 0; first < U; first += kBack, backward += 4 * U * kBack) {
        const auto run = [&](auto rows, Index lane) {
            rows(U - first, 4 * U, backward, gates + lane, hidden + first * kLanes + lane);
        };
        for_each_lanes(
            cases, [&](Index lane) { run(back_rows<kBack, kVectors>, lane); },
            [&](Index lane) { run(back_rows<kBack, 1>, lane); });
    }
}

typedef float Four __attribute__((vector_size(4 * sizeof(float)), aligned(sizeof(float)), may_alias));

// Folds the lanes to four: lane i of the result is the sum of the lanes i, i + 4, and so on.
INLINE Four fold(Vector v) {
#if defined(__AVX512F__)
    typedef float Eight __attribute__((vector_size(8 * sizeof(float))));
    const Eight half = __builtin_shufflevector(v, v, 0, 1, 2, 3, 4, 5, 6, 7) +
                       __builtin_shufflevector(v, v, 8, 9, 10, 11, 12, 13, 14, 15);
    return __builtin_shufflevector(half, half, 0, 1, 2, 3) + __builtin_shufflevector(half, half, 4, 5, 6, 7);
#elif defined(__AVX2__)
    return __builtin_shufflevector(v, v, 0, 1, 2, 3) + __builtin_shufflevector(v, v, 4, 5, 6, 7);
#else
    return v;
#endif
}

// Sums over the lanes of each of four vectors.
INLINE Four sum_lanes(const Vector* four) {
    const Four a = fold(four[0]), b = fold(four[1]), c = fold(four[2]), d = fold(four[3]);
    const Four ab = __builtin_shufflevector(a, b, 0, 4, 1, 5) + __builtin_shufflevector(a, b, 2, 6, 3, 7);
    const Four cd = __builtin_shufflevector(c, d, 0, 4, 1, 5) + __builtin_shufflevector(c, d, 2, 6, 3, 7);
    return __builtin_shufflevector(ab, cd, 0, 1, 4, 5) + __builtin_shufflevector(ab, cd, 2, 3, 6, 7);
}

// Weight gradients of the gates of one unit for `N` rows, summed over times and lanes.
template <Index N>
void weight_tile(Index U, Index K, Index cases, Index times, const float* rows, const float* gates, float* gradient) {
    Vector sums[N][4];
#pragma GCC unroll 16
    for (Index r = 0; r < N; ++r) {
#pragma GCC unroll 4
        for (Index g = 0; g < 4; ++g) sums[r][g] = Vector{};
    }
    for (Index t = 0; t < times; ++t, rows += K * kLanes, gates += 4 * U * kLanes) {
        for (Index lane = 0; lane < cases; lane += kWide) {
            Vector gate[4];
#pragma GCC unroll 4
            for (Index g = 0; g < 4; ++g) gate[g] = load(gates + g * kLanes + lane);
#pragma GCC unroll 16
            for (Index r = 0; r < N; ++r) {
                const Vector row = load(rows + r * kLanes + lane);
#pragma GCC unroll 4
                for (Index g = 0; g < 4; ++g) sums[r][g] += row * gate[g];
            }
        }
    }
#pragma GCC unroll 16
    for (Index r = 0; r < N; ++r) *reinterpret_cast<Four*>(gradient + r * U * 4) += sum_lanes(sums[r]);
}

template <Index N>
void weight_rows(Index n, Index U, Index K, Index cases, Index times, const float* rows, const float* gates,
                 float* gradient) {
    if constexpr (N > 1) {
        if (n < N) return weight_rows<N - 1>(n, U, K, cases, times, rows, gates, gradient);
    }
    weight_tile<N>(U, K, cases, times, rows, gates, gradient);
}

void back_weights(Index U, Index K, Index cases, Index times, const float* rows, const float* gates, float* gradient) {
    for (Index k = 0; k < K; k += kPanel) {
        for (Index u = 0; u < U; ++u) {
            weight_rows<kPanel>(K - k, U, K, cases, times, rows + k * kLanes, gates + 4 * u * kLanes,
                                gradient + (k * U + u) * 4);
        }
    }
}

void back(Shape shape, const float* backward, Index cases, Index times, const Index* lengths, Pass pass, float* gradient) {
    const Index U = shape.units, K = shape.rows();
    // Unused lanes must not count in sums over lanes: their gradients are 0 from the start.
    const Index used = round_up(cases, kWide);
    for (Index t = times - 1; t >= 0; --t) {
        float* gates = pass.gates + t * 4 * U * kLanes;
        for (Index i = 0; i < cases; ++i) {
            if (lengths[i] != t + 1) continue;  // until its last time point a case has gradients of 0
            for (Index u = 0; u < U; ++u) pass.hidden[u * kLanes + i] = pass.last[u * kLanes + i];
        }
        back_gates(U, used, pass.cells + t * U * kLanes, pass.cells + (t + 1) * U * kLanes, gates, pass.hidden, pass.cell);
        if (t > 0) back_hidden(U, backward, used, gates, pass.hidden);
    }
    back_weights(U, K, used, times, pass.rows, pass.gates, gradient);
}

void adam(Index n, float size, float correction, float* __restrict weights, float* __restrict gradients,
          float* __restrict first, float* __restrict second) {
    const float scale = 1.0f / correction;
    for (Index i = 0; i < n; ++i) {
        const float gradient = gradients[i];
        first[i] += 0.1f * (gradient - first[i]);
        second[i] = 0.999f * second[i] + 0.001f * gradient * gradient;
        weights[i] -= size * first[i] / (__builtin_sqrtf(second[i]) * scale + 1e-8f);
        gradients[i] = 0.0f;
    }
}

}  // namespace

extern const Kernels kernels;
const Kernels kernels{LCORPP_TEXT(LCORPP_INSTRUCTION_SET), forward_size, backward_size, pack, step, back, adam};

}  // namespace lcorpp::lstm::LCORPP_INSTRUCTION_SET
