// The LSTM as its users see it: predictions, one more time point, and training.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <new>
#include <vector>

#include "lstm.hpp"

namespace lcorpp::lstm {

// Numbers that begin where the widest vectors want them to; zeros at first.
class Floats {
  public:
    explicit Floats(Index n) : size_(n), data_(new (std::align_val_t(kAlign)) float[static_cast<std::size_t>(n)]()) {}
    float* data() { return data_.get(); }
    const float* data() const { return data_.get(); }
    Index size() const { return size_; }

  private:
    struct Free {
        void operator()(float* at) const { ::operator delete[](at, std::align_val_t(kAlign)); }
    };
    Index size_;
    std::unique_ptr<float[], Free> data_;
};

// All weights in one row of numbers: (K, U, 4) gates, (O, U) dense, (O,) its bias; so are their gradients.
struct Layout {
    Shape shape;
    Index gates() const { return shape.rows() * shape.units * 4; }
    Index dense() const { return gates() + shape.outputs * shape.units; }
    Index all() const { return dense() + shape.outputs; }
};

// Weights as numpy has them: inputs (4 U, C), recurrent (4 U, U), bias (4 U), dense (O, U), dense bias (O).
struct Given {
    const float *inputs, *recurrent, *bias, *dense, *dense_bias;
};
struct Taken {
    float *inputs, *recurrent, *bias, *dense, *dense_bias;
};

Floats gathered(Shape shape, const Given& given);
void scattered(Shape shape, const float* weights, const Taken& taken);

// Weights that do not change, and what they make of tracks.
class Network {
  public:
    Network(const Kernels& kernels, Shape shape, const Given& given);

    const Shape& shape() const { return layout_.shape; }

    // scores (n, O) after the last time point of tracks (n, times, C).
    void scores(Index n, Index times, const float* tracks, float* scores) const;

    // scores (n, O) after one more time point (n, C); hidden and cell (n, U) are changed.
    void step(Index n, const float* points, float* hidden, float* cell, float* scores) const;

  private:
    void dense(Index cases, const float* outputs, float* scores) const;

    const Kernels& kernels_;
    Layout layout_;
    Floats weights_, forward_, backward_;
};

// What is learnt from: tracks (n, times, C), the class of each, and how much each counts.
struct TrainingSet {
    Index n, times;
    std::vector<float> tracks;
    std::vector<std::int32_t> targets;
    std::vector<float> weights;
};

// Weights on their way, with Adam's memory.
class Trainer {
  public:
    Trainer(const Kernels& kernels, Shape shape, const Given& given, TrainingSet cases, Index batch, float keep);

    const Shape& shape() const { return layout_.shape; }
    const TrainingSet& cases() const { return cases_; }
    Index batches() const { return (cases_.n + batch_ - 1) / batch_; }

    // One pass over all cases in an order (n); kept (n, U) are the outputs that are not silenced, and rates
    // (batches) the learning rates. `check` is called now and then, between two updates.
    void epoch(const std::int64_t* order, const bool* kept, const double* rates, const std::function<void()>& check);

    void weights(const Taken& taken) const { scattered(layout_.shape, weights_.data(), taken); }

  private:
    void learn(Index cases, const std::int64_t* order, const bool* kept, Index batch);
    void move(double rate);

    const Kernels& kernels_;
    Layout layout_;
    TrainingSet cases_;
    Index batch_;
    float keep_;
    Floats weights_, gradients_, first_, second_, forward_, backward_;
    Floats rows_, cells_, gates_, hidden_, cell_, masks_;
    double first_decay_ = 1.0, second_decay_ = 1.0;
};

}  // namespace lcorpp::lstm
