#include "graph/renamings.hpp"

#include <cmath>
#include <utility>

namespace lcorpp {

namespace {

// Weights that differ by less count as equal.
constexpr double kTie = 1e-11;

// Largest number of passes over the renamings.
constexpr int kMaxRenamingPasses = 64;

}  // namespace

Renamings::Renamings(Index states, std::vector<std::vector<Index>> images) : dense_(as_size(states), 0.0) {
    for (const std::vector<Index>& image : images) {
        std::vector<Move> moves;
        for (Index s = 0; s < states; ++s) {
            if (image[as_size(s)] != s) moves.push_back({s, image[as_size(s)]});
        }
        if (!moves.empty()) moved_.push_back(std::move(moves));
    }
}

void Renamings::normalise(Weights& belief) {
    if (moved_.empty() || belief.size() == 0) return;
    for (std::size_t i = 0; i < belief.size(); ++i) dense_[as_size(belief.state[i])] = belief.weight[i];
    bool is_changed = true, any = false;
    for (int pass = 0; is_changed && pass < kMaxRenamingPasses; ++pass) {
        is_changed = false;
        for (const std::vector<Move>& moves : moved_) {
            bool raises = false;
            for (const Move& move : moves) {
                const double difference = dense_[as_size(move.source)] - dense_[as_size(move.state)];
                if (std::abs(difference) > kTie) {
                    raises = difference > 0;
                    break;
                }
            }
            if (!raises) continue;
            taken_.clear();
            for (const Move& move : moves) taken_.push_back(dense_[as_size(move.source)]);
            for (std::size_t i = 0; i < moves.size(); ++i) dense_[as_size(moves[i].state)] = taken_[i];
            is_changed = any = true;
        }
    }
    if (any) {
        belief.clear();
        for (std::size_t s = 0; s < dense_.size(); ++s) {
            if (dense_[s] == 0.0) continue;
            belief.state.push_back(static_cast<Index>(s));
            belief.weight.push_back(dense_[s]);
        }
    }
    for (const Index s : belief.state) dense_[as_size(s)] = 0.0;
}

}  // namespace lcorpp
