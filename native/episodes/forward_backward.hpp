// The forward-backward algorithm for a POMDP whose actions, observations and rewards were recorded.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace lcorpp {

// Tables of K states, A actions, O observations and V different rewards, see `Parameters` in baum_welch.py.
struct EpisodeTables {
    std::size_t K, A, O, V;
    const double* start;
    const double* transition;
    const double* observation;
    const double* reward;
};

// The steps of an episode, and whether the decision was over after the last one.
// evidence: likelihood of what else is known, given each of the K states at the start; null without.
struct Steps {
    std::size_t count;
    const std::int64_t* actions;
    const std::int64_t* observations;
    const std::int64_t* rewards;
    bool ended;
    const double* evidence;
};

// Sums of expected counts, in the shapes of the tables.
struct Counts {
    Counts(std::size_t K, std::size_t A, std::size_t O, std::size_t V)
        : start(K), transition(A * K * (K + 1)), observation(A * (K + 1) * O), reward(A * K * V) {}
    std::vector<double> start, transition, observation, reward;
};

class ForwardBackward {
public:
    explicit ForwardBackward(const EpisodeTables& tables)
        : tables_(tables), backward_(tables.K + 1), after_(tables.K + 1), earlier_(tables.K) {}

    // Add the expected counts of an episode, and return its log-likelihood; an impossible one adds nothing.
    double add(const Steps& steps, Counts& counts);

    // Add the counts of a path of states that is drawn given the episode, and return the log-likelihood.
    // random: a uniform number for each step, and one more.
    double sample(const Steps& steps, const double* random, Counts& counts);

private:
    // Compute the probabilities of the states after each step, and return the log-likelihood.
    double filter(const Steps& steps);

    // Probability of the step's observation in each next state; states that its end rules out have 0.
    void weigh_next(const Steps& steps, std::size_t t);

    EpisodeTables tables_;
    std::vector<double> forward_, scales_, backward_, after_, earlier_;
};

}  // namespace lcorpp
