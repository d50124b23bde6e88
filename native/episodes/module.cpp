// Python bindings: lcorpp.model_learning._episodes. `make stubs` writes the stub from them.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/tuple.h>

#include <optional>
#include <stdexcept>
#include <tuple>

#include "arrays.hpp"
#include "forward_backward.hpp"

using namespace lcorpp;
using namespace nb::literals;

namespace {

using Vector = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Matrix = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Tables = nb::ndarray<const double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using Places = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Flags = nb::ndarray<const bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

void check_places(const Places& places, std::size_t end) {
    for (std::size_t i = 0; i < places.shape(0); ++i) {
        if (places(i) < 0 || static_cast<std::size_t>(places(i)) >= end) throw std::invalid_argument("an index out of range");
    }
}

auto expect(Vector start, Tables transition, Tables observation, Tables reward, Places actions, Places observations,
            Places rewards, Places begins, Flags ended, std::optional<Matrix> evidence, std::optional<Vector> random) {
    const std::size_t K = start.shape(0), A = transition.shape(0), O = observation.shape(2), V = reward.shape(2);
    if (transition.shape(1) != K || transition.shape(2) != K + 1 || observation.shape(0) != A ||
        observation.shape(1) != K + 1 || reward.shape(0) != A || reward.shape(1) != K) {
        throw std::invalid_argument("tables whose shapes do not fit");
    }
    const std::size_t steps = actions.shape(0), episodes = ended.shape(0);
    if (observations.shape(0) != steps || rewards.shape(0) != steps || begins.shape(0) != episodes + 1 || begins(0) != 0 ||
        static_cast<std::size_t>(begins(episodes)) != steps) {
        throw std::invalid_argument("steps whose numbers do not fit");
    }
    check_places(actions, A);
    check_places(observations, O);
    check_places(rewards, V);
    for (std::size_t i = 0; i < episodes; ++i) {
        if (begins(i) >= begins(i + 1)) throw std::invalid_argument("an episode without steps");
    }
    if (random && random->shape(0) != steps + episodes) throw std::invalid_argument("expected a random number for each state");
    if (evidence && (evidence->shape(0) != episodes || evidence->shape(1) != K)) {
        throw std::invalid_argument("expected evidence about each episode and state");
    }
    Counts counts(K, A, O, V);
    std::vector<double> logs(episodes);
    {
        nb::gil_scoped_release unlocked;
        ForwardBackward pass({K, A, O, V, start.data(), transition.data(), observation.data(), reward.data()});
        for (std::size_t i = 0; i < episodes; ++i) {
            const std::size_t first = begins(i), count = begins(i + 1) - begins(i);
            const Steps own{count,    actions.data() + first, observations.data() + first, rewards.data() + first,
                            ended(i), evidence ? evidence->data() + i * K : nullptr};
            logs[i] = random ? pass.sample(own, random->data() + first + i, counts) : pass.add(own, counts);
        }
    }
    return std::make_tuple(make_array(std::move(counts.start)), make_array(std::move(counts.transition), {A, K, K + 1}),
                           make_array(std::move(counts.observation), {A, K + 1, O}),
                           make_array(std::move(counts.reward), {A, K, V}), make_array(std::move(logs)));
}

}  // namespace

NB_MODULE(_episodes, m) {
    m.doc() = "Expected counts of episodes, for `baum_welch.py`. `make stubs` generates the stub.";
    m.def("expect", &expect, "start"_a, "transition"_a, "observation"_a, "reward"_a, "actions"_a, "observations"_a,
          "rewards"_a, "begins"_a, "ended"_a, "evidence"_a = nb::none(), "random"_a = nb::none(),
          "Return the expected counts of start, transitions, observations and rewards, and the log-likelihood of each\n"
          "episode. The shapes are those of `Parameters` and `Episodes`; evidence is (N, K), the likelihood of what\n"
          "else is known of an episode, given its first state. With a uniform random number for each state\n"
          "(M + N,) the counts are those of paths that are drawn given the episodes.");
}
