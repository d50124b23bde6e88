// The LSTM as Python sees it: lcorpp.learning.lstm._kernels. Shapes and indices are checked here; whatever is
// wrong with them becomes a ValueError, never a read beyond an array.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "clock.hpp"
#include "network.hpp"

namespace nb = nanobind;
using namespace lcorpp;
using namespace lcorpp::lstm;
using namespace nb::literals;

namespace {

template <typename T, int N>
using In = nb::ndarray<const T, nb::ndim<N>, nb::c_contig, nb::device::cpu>;
template <int N>
using InOut = nb::ndarray<float, nb::ndim<N>, nb::c_contig, nb::device::cpu>;
using Made = nb::ndarray<nb::numpy, float>;

void expect(bool holds, const char* message) {
    if (!holds) throw std::invalid_argument(message);
}

template <typename A>
Index length(const A& array, std::size_t axis) {
    return static_cast<Index>(array.shape(axis));
}

template <typename A>
auto copied(const A& given) {
    using T = std::remove_const_t<typename A::Scalar>;
    return std::vector<T>(given.data(), given.data() + given.size());
}

Made made(std::vector<float> values, const std::vector<std::size_t>& shape) {
    auto* kept = new std::vector<float>(std::move(values));
    nb::capsule owner(kept, [](void* pointer) noexcept { delete static_cast<std::vector<float>*>(pointer); });
    return Made(kept->data(), shape.size(), shape.data(), owner);
}

const Kernels& chosen(const std::optional<std::string>& level) {
    const Kernels* kernels = level ? kernels_named(level->c_str()) : best_kernels();
    expect(kernels != nullptr, "this machine has no such level");
    return *kernels;
}

using Matrix = In<float, 2>;
using Row = In<float, 1>;

Shape shape_of(const Matrix& inputs, const Matrix& recurrent, const Row& bias, const Matrix& dense, const Row& dense_bias) {
    const Shape shape{length(inputs, 1), length(recurrent, 1), length(dense, 0)};
    const Index gates = 4 * shape.units;
    expect(shape.channels > 0 && shape.units > 0 && shape.outputs > 0 && length(inputs, 0) == gates &&
               length(recurrent, 0) == gates && length(bias, 0) == gates && length(dense, 1) == shape.units &&
               length(dense_bias, 0) == shape.outputs,
           "the weights do not fit each other");
    return shape;
}

}  // namespace

NB_MODULE(_kernels, m) {
    m.doc() = "The LSTM in C++: training, prediction, one more time point; beside it lie its twins of torch and numpy.";
    nb::set_leak_warnings(false);  // a classifier may well live until Python ends

    m.def("levels", [] {
        std::vector<std::string> names;
        for (const char* name : {"v4", "v3", "base"}) {
            if (kernels_named(name)) names.emplace_back(name);
        }
        return names;
    });

    nb::class_<Network>(m, "Network")
        .def(
            "__init__",
            [](Network* self, Matrix inputs, Matrix recurrent, Row bias, Matrix dense, Row dense_bias,
               const std::optional<std::string>& level) {
                const Shape shape = shape_of(inputs, recurrent, bias, dense, dense_bias);
                new (self) Network(chosen(level), shape,
                                   {inputs.data(), recurrent.data(), bias.data(), dense.data(), dense_bias.data()});
            },
            "inputs"_a, "recurrent"_a, "bias"_a, "dense"_a, "dense_bias"_a, "level"_a = nb::none())
        .def("scores",
             [](const Network& network, In<float, 3> tracks) {
                 const Index n = length(tracks, 0), outputs = network.shape().outputs;
                 expect(length(tracks, 2) == network.shape().channels, "tracks of other channels");
                 std::vector<float> scores(static_cast<std::size_t>(n * outputs));
                 {
                     nb::gil_scoped_release free;
                     network.scores(n, length(tracks, 1), tracks.data(), scores.data());
                 }
                 return made(std::move(scores), {tracks.shape(0), static_cast<std::size_t>(outputs)});
             })
        // The GIL stays: a step takes microseconds.
        .def("step",
             [](const Network& network, InOut<2> hidden, InOut<2> cell, In<float, 2> points) {
                 const Index n = length(points, 0), units = network.shape().units, outputs = network.shape().outputs;
                 expect(length(points, 1) == network.shape().channels && length(hidden, 0) == n && length(cell, 0) == n &&
                            length(hidden, 1) == units && length(cell, 1) == units,
                        "state and points do not fit");
                 std::vector<float> scores(static_cast<std::size_t>(n * outputs));
                 network.step(n, points.data(), hidden.data(), cell.data(), scores.data());
                 return made(std::move(scores), {points.shape(0), static_cast<std::size_t>(outputs)});
             },
             "hidden"_a.noconvert(), "cell"_a.noconvert(), "points"_a);

    nb::class_<Trainer>(m, "Trainer")
        .def(
            "__init__",
            [](Trainer* self, Matrix inputs, Matrix recurrent, Row bias, Matrix dense, Row dense_bias, In<float, 3> tracks,
               In<std::int32_t, 1> targets, In<float, 1> weights, Index batch, double keep,
               const std::optional<std::string>& level) {
                const Shape shape = shape_of(inputs, recurrent, bias, dense, dense_bias);
                const Index n = length(tracks, 0), times = length(tracks, 1);
                expect(n > 0 && times > 0 && length(tracks, 2) == shape.channels && length(targets, 0) == n &&
                           length(weights, 0) == n,
                       "tracks, targets and weights do not fit");
                expect(batch > 0 && keep > 0 && keep <= 1, "batch and keep are positive, keep at most 1");
                const std::int32_t classes = shape.outputs == 1 ? 2 : static_cast<std::int32_t>(shape.outputs);
                for (Index i = 0; i < n; ++i) {
                    expect(targets.data()[i] >= 0 && targets.data()[i] < classes, "there is no such class");
                }
                new (self) Trainer(chosen(level), shape,
                                   {inputs.data(), recurrent.data(), bias.data(), dense.data(), dense_bias.data()},
                                   TrainingSet{n, times, copied(tracks), copied(targets), copied(weights)}, batch,
                                   static_cast<float>(keep));
            },
            "inputs"_a, "recurrent"_a, "bias"_a, "dense"_a, "dense_bias"_a, "tracks"_a, "targets"_a, "weights"_a, "batch"_a,
            "keep"_a, "level"_a = nb::none())
        .def("epoch",
             [](Trainer& trainer, In<std::int64_t, 1> order, In<bool, 2> kept, In<double, 1> rates) {
                 const Index n = trainer.cases().n;
                 expect(length(order, 0) == n && length(kept, 0) == n && length(kept, 1) == trainer.shape().units &&
                            length(rates, 0) == trainer.batches(),
                        "order, kept and rates do not fit");
                 for (Index i = 0; i < n; ++i) {
                     expect(order.data()[i] >= 0 && order.data()[i] < n, "there is no such case");
                 }
                 Clock clock(std::numeric_limits<double>::infinity(), [] {
                     nb::gil_scoped_acquire held;
                     if (PyErr_CheckSignals() != 0) throw nb::python_error();
                 });
                 nb::gil_scoped_release free;
                 trainer.epoch(order.data(), kept.data(), rates.data(), [&] { clock.over(); });
             })
        .def("weights", [](const Trainer& trainer) {
            const Shape& shape = trainer.shape();
            const auto U = static_cast<std::size_t>(shape.units), C = static_cast<std::size_t>(shape.channels),
                       O = static_cast<std::size_t>(shape.outputs);
            std::vector<float> inputs(4 * U * C), recurrent(4 * U * U), bias(4 * U), dense(O * U), dense_bias(O);
            trainer.weights({inputs.data(), recurrent.data(), bias.data(), dense.data(), dense_bias.data()});
            return std::make_tuple(made(std::move(inputs), {4 * U, C}), made(std::move(recurrent), {4 * U, U}),
                                   made(std::move(bias), {4 * U}), made(std::move(dense), {O, U}),
                                   made(std::move(dense_bias), {O}));
        });
}
