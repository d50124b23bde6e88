// BACKUP: both bounds are improved at one belief by one step of looking ahead.
// Source: Kurniawati, Hsu and Lee, RSS 2008, algorithm 3.

#include <algorithm>
#include <utility>

#include "tree.hpp"

namespace lcorpp {

void Tree::backup(Index number) {
    refresh(number);
    Node& node = nodes[static_cast<std::size_t>(number)];
    Index action = best_lower_action(number);
    for (int again = 0; again < 2; ++again) {
        Branch& branch = node.branches[static_cast<std::size_t>(action)];
        const bool pruned = std::any_of(branch.children.begin(), branch.children.end(), [&](const Child& child) {
            return sets[static_cast<std::size_t>(child.group)].row(child.best) < 0;
        });
        if (!pruned) break;
        for (Branch& other : node.branches) {  // look at all vectors again: a remembered one was pruned
            for (Child& child : other.children) child.lower = -kInfinity;
            other.lower = -kInfinity;
            other.seen_vectors = 0;
        }
        refresh(number);
        action = best_lower_action(number);
    }
    witness(node);
    if (node.branches[static_cast<std::size_t>(action)].lower > node.held + kGain * scale) {
        std::vector<Stamp> from;
        const std::vector<double> made = vector(node, action, from);
        // What the vector is worth here, not what looking ahead said: their rounding differs.
        const bool local = static_cast<std::size_t>(node.group) < model.members.size();
        double value = 0.0;
        for (std::size_t i = 0; i < node.belief.size(); ++i) {
            const auto s = static_cast<std::size_t>(node.belief.state[i]);
            value += node.belief.weight[i] * made[local ? static_cast<std::size_t>(model.local[s]) : s];
        }
        if (value > node.held) {
            node.witness = next_vector_;
            node.held = value;
            origins.note(next_vector_, std::move(from));
            sets[static_cast<std::size_t>(node.group)].add(made, action, next_vector_++);
        }
    }
    node.low = node.held;
    upper_at(number);
    if (node.high < node.surface - kGain * scale) {
        const Stamp old = node.point;
        node.point = sawtooth.add(node.belief, node.group, node.high);
        if (old >= 0) sawtooth.retire(old);
    }
}

// R(a) + gamma sum over o of T Z (the best vector at the child of a and o), over the states of the node's
// group. Where an observation is impossible from this belief, the vector that is best after the action alone
// is taken: any vector is right there, this one serves the neighbouring beliefs.
std::vector<double> Tree::vector(Node& node, Index action, std::vector<Stamp>& from) {
    const Branch& branch = node.branches[static_cast<std::size_t>(action)];
    const Rows& T = model.transition;
    const Rows& Z = model.observation;
    std::vector<Index> row(static_cast<std::size_t>(model.observations), -1);
    for (std::size_t c = 0; c < branch.children.size(); ++c) {
        const Child& child = branch.children[c];
        from.push_back(child.best);
        row[static_cast<std::size_t>(child.observation)] = sets[static_cast<std::size_t>(child.group)].row(child.best);
    }
    std::vector<Index> usual(model.members.size(), -1);
    const auto usual_row = [&](Index block) {
        Index& found = usual[static_cast<std::size_t>(block)];
        if (found >= 0) return found;
        Weights part;
        const Weights& spread = successors_.spread(node.belief, action);
        for (std::size_t i = 0; i < spread.size(); ++i) {
            if (model.block[static_cast<std::size_t>(spread.state[i])] != block) continue;
            part.state.push_back(spread.state[i]);
            part.weight.push_back(spread.weight[i]);
        }
        found = part.size() ? best(block, part.state.data(), part.weight.data(), part.size(), 0).row
                            : sets[static_cast<std::size_t>(block)].central();
        from.push_back(sets[static_cast<std::size_t>(block)].stamp(static_cast<std::size_t>(found)));
        return found;
    };
    std::fill(future_.begin(), future_.end(), kInfinity);
    const std::vector<Index>& states = states_of(node.group);
    std::vector<double> made(states.size());
    for (std::size_t i = 0; i < states.size(); ++i) {
        double sum = 0.0;
        for (std::size_t j = T.begin(action, states[i]); j < T.end(action, states[i]); ++j) {
            const auto next = static_cast<std::size_t>(T.column[j]);
            double& future = future_[next];
            if (future == kInfinity) {
                const VectorSet& set = sets[static_cast<std::size_t>(model.block[next])];
                future = 0.0;
                for (std::size_t k = Z.begin(action, T.column[j]); k < Z.end(action, T.column[j]); ++k) {
                    Index chosen = row[static_cast<std::size_t>(Z.column[k])];
                    if (chosen < 0) chosen = usual_row(model.block[next]);
                    future += Z.value[k] * set.at(static_cast<std::size_t>(chosen), static_cast<std::size_t>(model.local[next]));
                }
            }
            sum += T.value[j] * future;
        }
        made[i] = model.reward_of(action, states[i]) + model.discount * sum;
    }
    return made;
}

}  // namespace lcorpp
