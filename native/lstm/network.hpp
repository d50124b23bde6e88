// The LSTM: prediction, time steps and training.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <new>
#include <vector>

#include "lstm.hpp"

namespace lcorpp::lstm {

// An array of floats, zero at first and aligned for the widest vectors.
class Floats {
  public:
    explicit Floats(Index n) : size_(n), data_(new (std::align_val_t(kAlign)) float[static_cast<std::size_t>(n)]()) {}
    float* data() { return data_.get(); }
    const float* data() const { return data_.get(); }
    float& operator[](Index i) { return data_[static_cast<std::size_t>(i)]; }
    Index size() const { return size_; }

  private:
    struct Free {
        void operator()(float* at) const { ::operator delete[](at, std::align_val_t(kAlign)); }
    };
    Index size_;
    std::unique_ptr<float[], Free> data_;
};

// The layout of all weights, and of their gradients, in one array: gates (K, U, 4), dense (O, U), dense bias (O), with
// K = U + C + 1 rows: hidden units, input channels, bias.
struct Layout {
    Shape shape;
    // The indices of the first weight of the dense layer and of its first bias, and the number of all weights.
    Index dense() const { return shape.rows() * shape.units * 4; }
    Index dense_bias() const { return dense() + shape.outputs * shape.units; }
    Index size() const { return dense_bias() + shape.outputs; }
};

// The weights as numpy arrays: inputs (4 U, C), recurrent (4 U, U), bias (4 U), dense (O, U), dense bias (O).
template <typename T>
struct NumpyArrays {
    T *inputs, *recurrent, *bias, *dense, *dense_bias;
};

// Copies the weights from numpy arrays, and to them.
Floats from_numpy_arrays(Shape shape, const NumpyArrays<const float>& arrays);
void to_numpy_arrays(Shape shape, const float* weights, const NumpyArrays<float>& arrays);

// The forward pass with fixed weights.
class Network {
  public:
    Network(const Kernels& kernels, Shape shape, const NumpyArrays<const float>& arrays);

    const Shape& shape() const { return layout_.shape; }

    // The scores (n, O) after the last time point of tracks (n, times, C) with `lengths` (n) time points.
    void scores(Index n, Index times, const float* tracks, const std::int64_t* lengths, float* scores) const;

    // The scores (n, O) after one more time point (n, C); updates hidden and cell (n, U).
    void step(Index n, const float* points, float* hidden, float* cell, float* scores) const;

  private:
    // The scores (cases, O) of the outputs (U, kLanes) of the units, by the dense layer.
    void apply_dense(Index cases, const float* outputs, float* scores) const;

    const Kernels& kernels_;
    Layout layout_;
    Floats weights_, forward_;
};

// The training set: tracks (n, times, C), the number of time points of each, finite numbers after them, the class of
// each, and its weight in the loss.
struct TrainingSet {
    Index n, times;
    std::vector<float> tracks;
    std::vector<std::int64_t> lengths;
    std::vector<std::int32_t> targets;
    std::vector<float> weights;
};

// A training: the current weights and the moments of Adam.
class Trainer {
  public:
    Trainer(const Kernels& kernels, Shape shape, const NumpyArrays<const float>& arrays, TrainingSet cases, Index batch, float keep);

    const Shape& shape() const { return layout_.shape; }
    const TrainingSet& cases() const { return cases_; }
    Index batches() const { return (cases_.n + batch_ - 1) / batch_; }

    // One epoch: order (n) of the cases, dropout mask (n, U) of the outputs kept, learning rates (batches).
    // `check` is called before every update.
    void epoch(const std::int64_t* order, const bool* mask, const double* rates, const std::function<void()>& check);

    void weights(const NumpyArrays<float>& arrays) const { to_numpy_arrays(layout_.shape, weights_.data(), arrays); }

  private:
    void add_gradients(Index cases, const std::int64_t* order, const bool* mask, Index batch);
    void update(double rate);

    const Kernels& kernels_;
    Layout layout_;
    TrainingSet cases_;
    Index batch_;
    float keep_;
    Floats weights_, gradients_, first_, second_, forward_, backward_;
    Floats rows_, cells_, gates_, last_, last_gradients_, hidden_, cell_, masks_;
    double first_decay_ = 1.0, second_decay_ = 1.0;
};

}  // namespace lcorpp::lstm
