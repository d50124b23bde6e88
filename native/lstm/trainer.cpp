#include <algorithm>
#include <cmath>
#include <utility>

#include "network.hpp"

namespace lcorpp::lstm {

namespace {

// Replaces the scores (O, kLanes) of some cases by the gradients of their losses, times their factors. The loss is the
// cross-entropy: of a sigmoid for one score, which is that of class 1; of a softmax for several.
void replace_by_loss_gradients(Index outputs, Index cases, const std::int32_t* targets, const float* factors, float* scores) {
    for (Index i = 0; i < cases; ++i) {
        float* score = scores + i;
        if (outputs == 1) {
            const float p = 1.0f / (1.0f + std::exp(-score[0]));
            score[0] = (p - static_cast<float>(targets[i])) * factors[i];
            continue;
        }
        float max = score[0], sum = 0.0f;
        for (Index o = 1; o < outputs; ++o) max = std::max(max, score[o * kLanes]);
        for (Index o = 0; o < outputs; ++o) sum += score[o * kLanes] = std::exp(score[o * kLanes] - max);
        for (Index o = 0; o < outputs; ++o) {
            score[o * kLanes] = (score[o * kLanes] / sum - (o == targets[i] ? 1.0f : 0.0f)) * factors[i];
        }
    }
}

}  // namespace

Trainer::Trainer(const Kernels& kernels, Shape shape, const NumpyArrays<const float>& arrays, TrainingSet cases, Index batch, float keep)
    : kernels_(kernels),
      layout_{shape},
      cases_(std::move(cases)),
      batch_(batch),
      keep_(keep),
      weights_(from_numpy_arrays(shape, arrays)),
      gradients_(layout_.size()),
      first_(layout_.size()),
      second_(layout_.size()),
      forward_(kernels.forward_size(shape)),
      backward_(kernels.backward_size(shape)),
      rows_((cases_.times + 1) * shape.rows() * kLanes),
      cells_((cases_.times + 1) * shape.units * kLanes),
      gates_(cases_.times * shape.units * 4 * kLanes),
      last_(shape.units * kLanes),
      last_gradients_(shape.units * kLanes),
      hidden_(shape.units * kLanes),
      cell_(shape.units * kLanes),
      masks_(shape.units * kLanes) {
    for (Index t = 0; t <= cases_.times; ++t) {
        std::fill_n(rows_.data() + ((t + 1) * shape.rows() - 1) * kLanes, kLanes, 1.0f);
    }
}

void Trainer::epoch(const std::int64_t* order, const bool* mask, const double* rates,
                    const std::function<void()>& check) {
    const NoDenormals guard;
    for (Index begin = 0, update = 0; begin < cases_.n; begin += batch_, ++update) {
        check();
        const Index batch = std::min(batch_, cases_.n - begin);
        kernels_.pack(shape(), weights_.data(), forward_.data(), backward_.data());
        for (Index at = begin; at < begin + batch; at += kLanes) {
            add_gradients(std::min(kLanes, begin + batch - at), order + at, mask + at * shape().units, batch);
        }
        this->update(rates[update]);
    }
}

// Adds the gradients of up to kLanes cases of a batch.
void Trainer::add_gradients(Index cases, const std::int64_t* order, const bool* mask, Index batch) {
    const Index U = shape().units, C = shape().channels, K = shape().rows(), O = shape().outputs;
    std::int32_t targets[kLanes];
    Index lengths[kLanes], T = 0;
    float factors[kLanes];
    for (Index i = 0; i < cases; ++i) {
        lengths[i] = cases_.lengths[static_cast<std::size_t>(order[i])];
        T = std::max(T, lengths[i]);
    }
    for (Index i = 0; i < cases; ++i) {
        const float* track = cases_.tracks.data() + order[i] * cases_.times * C;
        for (Index t = 0; t < T; ++t) {
            for (Index c = 0; c < C; ++c) rows_[(t * K + U + c) * kLanes + i] = track[t * C + c];
        }
        for (Index u = 0; u < U; ++u) masks_[u * kLanes + i] = mask[i * U + u] ? 1.0f / keep_ : 0.0f;
        targets[i] = cases_.targets[static_cast<std::size_t>(order[i])];
        factors[i] = cases_.weights[static_cast<std::size_t>(order[i])] / static_cast<float>(batch);
    }
    for (Index t = 0; t < T; ++t) {
        kernels_.step(shape(), forward_.data(), cases, rows_.data() + t * K * kLanes, cells_.data() + t * U * kLanes,
                      gates_.data() + t * 4 * U * kLanes, cells_.data() + (t + 1) * U * kLanes,
                      rows_.data() + (t + 1) * K * kLanes);
    }

    for (Index u = 0; u < U; ++u) {
        for (Index i = 0; i < cases; ++i) {
            last_[u * kLanes + i] = rows_[(lengths[i] * K + u) * kLanes + i] * masks_[u * kLanes + i];
        }
    }
    const float* dense = weights_.data() + layout_.dense();
    const float* bias = weights_.data() + layout_.dense_bias();
    Floats scores(O * kLanes);
    for (Index o = 0; o < O; ++o) {
        float* score = scores.data() + o * kLanes;
        std::fill_n(score, kLanes, bias[o]);
        for (Index u = 0; u < U; ++u) {
            for (Index i = 0; i < kLanes; ++i) score[i] += dense[o * U + u] * last_[u * kLanes + i];
        }
    }
    replace_by_loss_gradients(O, cases, targets, factors, scores.data());

    // Unused lanes have gradients of 0, and so add nothing to any sum.
    float* const dense_gradient = gradients_.data() + layout_.dense();
    float* const bias_gradient = gradients_.data() + layout_.dense_bias();
    std::fill_n(last_gradients_.data(), U * kLanes, 0.0f);
    std::fill_n(hidden_.data(), U * kLanes, 0.0f);
    std::fill_n(cell_.data(), U * kLanes, 0.0f);
    for (Index o = 0; o < O; ++o) {
        const float* score = scores.data() + o * kLanes;
        for (Index i = 0; i < cases; ++i) bias_gradient[o] += score[i];
        for (Index u = 0; u < U; ++u) {
            const Index at = u * kLanes;
            float sum = 0.0f;
            for (Index i = 0; i < cases; ++i) {
                sum += score[i] * last_[at + i];
                last_gradients_[at + i] += score[i] * dense[o * U + u] * masks_[at + i];
            }
            dense_gradient[o * U + u] += sum;
        }
    }
    const Pass pass{rows_.data(),           cells_.data(),  gates_.data(),
                    last_gradients_.data(), hidden_.data(), cell_.data()};
    kernels_.back(shape(), backward_.data(), cases, T, lengths, pass, gradients_.data());
}

// Adam: Kingma and Ba 2015, algorithm 1, with its decay rates.
void Trainer::update(double rate) {
    first_decay_ *= 0.9;
    second_decay_ *= 0.999;
    kernels_.adam(layout_.size(), static_cast<float>(rate / (1 - first_decay_)),
                  static_cast<float>(std::sqrt(1 - second_decay_)), weights_.data(), gradients_.data(), first_.data(),
                  second_.data());
}

}  // namespace lcorpp::lstm
