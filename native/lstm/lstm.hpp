// An LSTM of one layer with a dense layer on its last output: what its kernels take and give.
//
// TrainingSet lie in lanes: an array "(rows, lanes)" holds one number of each of up to kLanes cases in a row, so that
// no length of the network has to be a multiple of anything. Rows of a time point are the outputs of the units,
// then the inputs, then a 1 for the bias: K = U + C + 1 of them.
#pragma once

#include <cstddef>
#include <cstdint>

namespace lcorpp::lstm {

using Index = std::ptrdiff_t;

constexpr Index kLanes = 32;
constexpr Index kAlign = 64;

// How many numbers there are of what: channels C, units U, outputs O.
struct Shape {
    Index channels, units, outputs;
    Index rows() const { return units + channels + 1; }
};

// What the kernels read of the weights of the LSTM; `kernels.pack` makes it of (K, U, 4) gates.
//
// forward: by groups of units, for each row all gates of the group.
// backward: by groups of the U rows of the outputs, for each gate of each unit all rows of the group.
struct Packed {
    const float* forward;
    const float* backward;
};

// What a pass through time leaves of up to kLanes cases and T time points.
//
// rows: (T + 1, K, kLanes); the inputs and the ones of the first T are given, and the outputs of the first.
// cells: (T + 1, U, kLanes); the first are given.
// gates: (T, U, 4, kLanes), input, forget, cell and output; on the way back their gradients take their place.
// hidden, cell: (U, kLanes), on the way back the gradients of the output and the cell; of the last output it
//   is given, that of the cell is 0.
struct Pass {
    float* rows;
    float* cells;
    float* gates;
    float* hidden;
    float* cell;
};

// One way to compute it, for one set of instructions. Lanes from `cases` on hold numbers, but nobody's.
struct Kernels {
    const char* name;
    // Floats that `forward` and `backward` of Packed take.
    Index (*forward_size)(Shape);
    Index (*backward_size)(Shape);
    void (*pack)(Shape, const float* gates, float* forward, float* backward);
    // One time point: gates, cells and outputs after it; rows and cells are those before it.
    void (*step)(Shape, const float* forward, Index cases, const float* rows, const float* cells, float* gates,
                 float* new_cells, float* outputs);
    // From the last time point to the first; adds the gradient of the weights to `gradient` (K, U, 4).
    void (*back)(Shape, const float* backward, Index cases, Index times, Pass, float* gradient);
    // Adam's move of n weights by their gradients, which are 0 afterwards.
    void (*adam)(Index n, float size, float correction, float* weights, float* gradients, float* first,
                 float* second);
};

// The best kernels that this machine can run, and those of a name; null where there are none.
const Kernels* best_kernels();
const Kernels* kernels_named(const char* name);

// Denormal numbers count as 0 while it lives: they are as good as 0 here, and take a hundred times longer.
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
