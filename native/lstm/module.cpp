// The Python binding of the LSTM: lcorpp.learning.lstm._kernels. It checks shapes and indices and raises ValueError, so
// no kernel reads beyond an array.

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

// Types of the Python stub, which `make stubs` generates from the signatures below.
#define FLOATS "numpy.typing.NDArray[numpy.float32]"
#define LENGTHS "numpy.typing.NDArray[numpy.int64]"
#define WEIGHTS \
    "inputs: " FLOATS ", recurrent: " FLOATS ", bias: " FLOATS ", dense: " FLOATS ", dense_bias: " FLOATS ", "

namespace {

template <typename T, int N>
using In = nb::ndarray<const T, nb::ndim<N>, nb::c_contig, nb::device::cpu>;
template <int N>
using InOut = nb::ndarray<float, nb::ndim<N>, nb::c_contig, nb::device::cpu>;
using Out = nb::ndarray<nb::numpy, float>;

void expect(bool condition, const char* message) {
    if (!condition) throw std::invalid_argument(message);
}

template <typename A>
Index length(const A& array, std::size_t axis) {
    return static_cast<Index>(array.shape(axis));
}

// Expects (cases) numbers of time points from 1 to `times`.
void expect_lengths(const In<std::int64_t, 1>& lengths, Index cases, Index times) {
    expect(length(lengths, 0) == cases, "tracks and lengths do not match");
    for (Index i = 0; i < cases; ++i) {
        expect(lengths.data()[i] > 0 && lengths.data()[i] <= times, "a track has no time point, or more than there are");
    }
}

template <typename A>
auto to_vector(const A& array) {
    using T = std::remove_const_t<typename A::Scalar>;
    return std::vector<T>(array.data(), array.data() + array.size());
}

Out to_numpy(std::vector<float> values, const std::vector<std::size_t>& shape) {
    auto* owned = new std::vector<float>(std::move(values));
    nb::capsule owner(owned, [](void* pointer) noexcept { delete static_cast<std::vector<float>*>(pointer); });
    return Out(owned->data(), shape.size(), shape.data(), owner);
}

const Kernels& select_kernels(const std::optional<std::string>& instruction_set) {
    const Kernels* kernels = instruction_set ? find_kernels(instruction_set->c_str()) : find_best_kernels();
    expect(kernels != nullptr, "this machine does not support that instruction set");
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
           "the weights do not match each other");
    return shape;
}

}  // namespace

NB_MODULE(_kernels, m) {
    m.doc() = "LSTM kernels in C++: training and prediction; see lcorpp.learning.lstm.network and trainer.";
    nb::set_leak_warnings(false);  // a classifier may live until Python exits

    m.def(
        "instruction_sets",
        [] {
            std::vector<std::string> names;
            for (const char* name : {"v4", "v3", "base"}) {
                if (find_kernels(name)) names.emplace_back(name);
            }
            return names;
        },
        "Return the instruction sets that this machine supports, the fastest first.");

    nb::class_<Network>(m, "Network", "The forward pass with fixed weights; see `network.Network`.")
        .def(
            "__init__",
            [](Network* self, Matrix inputs, Matrix recurrent, Row bias, Matrix dense, Row dense_bias,
               const std::optional<std::string>& instruction_set) {
                const Shape shape = shape_of(inputs, recurrent, bias, dense, dense_bias);
                new (self) Network(select_kernels(instruction_set), shape,
                                   {inputs.data(), recurrent.data(), bias.data(), dense.data(), dense_bias.data()});
            },
            "inputs"_a, "recurrent"_a, "bias"_a, "dense"_a, "dense_bias"_a, "instruction_set"_a = nb::none(),
            nb::sig("def __init__(self, " WEIGHTS "instruction_set: str | None = None) -> None"))
        .def("scores",
             [](const Network& network, In<float, 3> tracks, In<std::int64_t, 1> lengths) {
                 const Index n = length(tracks, 0), outputs = network.shape().outputs;
                 expect(length(tracks, 2) == network.shape().channels, "the tracks have other channels");
                 expect_lengths(lengths, n, length(tracks, 1));
                 std::vector<float> scores(static_cast<std::size_t>(n * outputs));
                 {
                     nb::gil_scoped_release unlock;
                     network.scores(n, length(tracks, 1), tracks.data(), lengths.data(), scores.data());
                 }
                 return to_numpy(std::move(scores), {tracks.shape(0), static_cast<std::size_t>(outputs)});
             },
             "tracks"_a, "lengths"_a, nb::sig("def scores(self, tracks: " FLOATS ", lengths: " LENGTHS ") -> " FLOATS),
             "Return the scores (n, O) after the last of the `lengths` (n,) time points of tracks (n, time points, C).")
        // A step keeps the GIL, because it takes microseconds.
        .def("step",
             [](const Network& network, InOut<2> hidden, InOut<2> cell, In<float, 2> points) {
                 const Index n = length(points, 0), units = network.shape().units, outputs = network.shape().outputs;
                 expect(length(points, 1) == network.shape().channels && length(hidden, 0) == n && length(cell, 0) == n &&
                            length(hidden, 1) == units && length(cell, 1) == units,
                        "state and points do not match");
                 std::vector<float> scores(static_cast<std::size_t>(n * outputs));
                 network.step(n, points.data(), hidden.data(), cell.data(), scores.data());
                 return to_numpy(std::move(scores), {points.shape(0), static_cast<std::size_t>(outputs)});
             },
             "hidden"_a.noconvert(), "cell"_a.noconvert(), "points"_a,
             nb::sig("def step(self, hidden: " FLOATS ", cell: " FLOATS ", points: " FLOATS ") -> " FLOATS),
             "Return the scores (n, O) after one more time point (n, C); updates hidden and cell (n, U) in place.");

    nb::class_<Trainer>(m, "Trainer", "A training: the current weights and the moments of Adam.")
        .def(
            "__init__",
            [](Trainer* self, Matrix inputs, Matrix recurrent, Row bias, Matrix dense, Row dense_bias, In<float, 3> tracks,
               In<std::int64_t, 1> lengths, In<std::int32_t, 1> targets, In<float, 1> weights, Index batch, double keep,
               const std::optional<std::string>& instruction_set) {
                const Shape shape = shape_of(inputs, recurrent, bias, dense, dense_bias);
                const Index n = length(tracks, 0), times = length(tracks, 1);
                expect(n > 0 && times > 0 && length(tracks, 2) == shape.channels && length(targets, 0) == n &&
                           length(weights, 0) == n,
                       "tracks, targets and weights do not match");
                expect(batch > 0 && keep > 0 && keep <= 1, "batch and keep must be positive, keep at most 1");
                expect_lengths(lengths, n, times);
                const std::int32_t classes = shape.outputs == 1 ? 2 : static_cast<std::int32_t>(shape.outputs);
                for (Index i = 0; i < n; ++i) {
                    expect(targets.data()[i] >= 0 && targets.data()[i] < classes, "there is no such class");
                }
                new (self) Trainer(select_kernels(instruction_set), shape,
                                   {inputs.data(), recurrent.data(), bias.data(), dense.data(), dense_bias.data()},
                                   TrainingSet{n, times, to_vector(tracks), to_vector(lengths), to_vector(targets), to_vector(weights)},
                                   batch, static_cast<float>(keep));
            },
            "inputs"_a, "recurrent"_a, "bias"_a, "dense"_a, "dense_bias"_a, "tracks"_a, "lengths"_a, "targets"_a, "weights"_a, "batch"_a,
            "keep"_a, "instruction_set"_a = nb::none(),
            nb::sig("def __init__(self, " WEIGHTS "tracks: " FLOATS ", lengths: " LENGTHS ", targets: numpy.typing.NDArray[numpy.int32], weights: " FLOATS
                    ", batch: int, keep: float, instruction_set: str | None = None) -> None"))
        .def("epoch",
             [](Trainer& trainer, In<std::int64_t, 1> order, In<bool, 2> mask, In<double, 1> rates) {
                 const Index n = trainer.cases().n;
                 expect(length(order, 0) == n && length(mask, 0) == n && length(mask, 1) == trainer.shape().units &&
                            length(rates, 0) == trainer.batches(),
                        "order, dropout mask and rates do not match");
                 for (Index i = 0; i < n; ++i) {
                     expect(order.data()[i] >= 0 && order.data()[i] < n, "there is no such case");
                 }
                 Clock clock(std::numeric_limits<double>::infinity(), [] {
                     nb::gil_scoped_acquire lock;
                     if (PyErr_CheckSignals() != 0) throw nb::python_error();
                 });
                 nb::gil_scoped_release unlock;
                 trainer.epoch(order.data(), mask.data(), rates.data(), [&] { clock.expired(); });
             },
             "order"_a, "dropout_mask"_a, "rates"_a,
             nb::sig("def epoch(self, order: numpy.typing.NDArray[numpy.int64], dropout_mask: numpy.typing.NDArray[numpy.bool_],"
                     " rates: numpy.typing.NDArray[numpy.float64]) -> None"),
             "Train on all cases once: order (n,), dropout mask (n, U) of the outputs kept, rates (batches,).")
        .def("weights",
             [](const Trainer& trainer) {
            const Shape& shape = trainer.shape();
            const auto U = static_cast<std::size_t>(shape.units), C = static_cast<std::size_t>(shape.channels),
                       O = static_cast<std::size_t>(shape.outputs);
            std::vector<float> inputs(4 * U * C), recurrent(4 * U * U), bias(4 * U), dense(O * U), dense_bias(O);
            trainer.weights({inputs.data(), recurrent.data(), bias.data(), dense.data(), dense_bias.data()});
            return std::make_tuple(to_numpy(std::move(inputs), {4 * U, C}), to_numpy(std::move(recurrent), {4 * U, U}),
                                   to_numpy(std::move(bias), {4 * U}), to_numpy(std::move(dense), {O, U}),
                                   to_numpy(std::move(dense_bias), {O}));
        }, "Return the current weights: inputs, recurrent, bias, dense, dense_bias.");
}
