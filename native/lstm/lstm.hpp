// Kernels of an LSTM with one layer and a dense layer on its last output: their arguments and results.
//
// Cases lie in lanes: a row of an array "(rows, lanes)" contains one number of each of up to kLanes cases, so no size
// of the network has to be a multiple of the vector width. The rows of a time point are the outputs of the units, then
// the inputs, then a 1 for the bias: K = U + C + 1 rows.
#pragma once

#include <cstddef>
#include <cstdint>

namespace lcorpp::lstm {

using Index = std::ptrdiff_t;

constexpr Index kLanes = 32;  // cases that are computed together, a multiple of the width of all vector types
constexpr Index kAlign = 64;  // alignment of arrays in bytes: that of the widest vectors, AVX-512

// The sizes of the network: channels C, units U, outputs O.
struct Shape {
    Index channels, units, outputs;
    Index rows() const { return units + channels + 1; }  // K
};

// The activations of up to kLanes cases over T time points.
//
// rows: (T + 1, K, kLanes); input: the inputs and ones of the first T, and the outputs of the first.
// cells: (T + 1, U, kLanes); input: the first.
// gates: (T, U, 4, kLanes), input, forget, cell and output; the backward pass overwrites them by their gradients.
// last: (U, kLanes), input: the gradients of the output at the last time point of each case.
// hidden, cell: (U, kLanes), in the backward pass the gradients of the output and the cell at a time point; input: 0.
struct Pass {
    float* rows;
    float* cells;
    float* gates;
    const float* last;
    float* hidden;
    float* cell;
};

// The kernels for one instruction set. Lanes from `cases` on are unused; their numbers are arbitrary.
struct Kernels {
    const char* name;
    // The weights of the gates (K, U, 4) in the orders in which `step` and `back` read them, and their sizes in floats:
    // forward: for each group of units, for each row, all gates of the group.
    // backward: for each group of the U output rows, for each gate of each unit, all rows of the group.
    Index (*forward_size)(Shape);
    Index (*backward_size)(Shape);
    void (*pack)(Shape, const float* gates, float* forward, float* backward);
    // One time step: computes gates, cells and outputs from the rows and cells before it. new_cells may be cells.
    void (*step)(Shape, const float* forward, Index cases, const float* rows, const float* cells, float* gates,
                 float* new_cells, float* outputs);
    // Backpropagation through time; adds the gradient of the weights to `gradient` (K, U, 4). lengths: (cases) the time
    // points of each case, at most `times`; what comes after has no effect.
    void (*back)(Shape, const float* backward, Index cases, Index times, const Index* lengths, Pass, float* gradient);
    // Updates n weights by Adam and sets their gradients to 0.
    void (*adam)(Index n, float size, float correction, float* weights, float* gradients, float* first,
                 float* second);
};

// The fastest kernels that this machine supports; and those of an instruction set, null if it is not supported.
const Kernels* find_best_kernels();
const Kernels* find_kernels(const char* name);

// Flushes denormal numbers to 0 during its lifetime: they are negligible here and take a hundred times longer.
class NoDenormals {
  public:
    NoDenormals();
    ~NoDenormals();
    NoDenormals(const NoDenormals&) = delete;
    NoDenormals& operator=(const NoDenormals&) = delete;

  private:
    std::uint64_t before_;
};

}  // namespace lcorpp::lstm
