#include "tree.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace lcorpp {

namespace {

// Beliefs that agree to this share a node. The lower bound of a node is used at its own belief only; the upper
// one also at a parent's next belief, with what the two may be apart.
constexpr double kAlike = 1e10;

constexpr int kEntropyBins = 32;

std::uint64_t hash_of(const Weights& belief) {
    std::uint64_t hash = 0x9E3779B97F4A7C15ull;
    for (std::size_t i = 0; i < belief.size(); ++i) {
        const auto weight = static_cast<std::uint64_t>(std::llround(belief.weight[i] * kAlike));
        if (weight == 0) continue;
        for (const std::uint64_t part : {static_cast<std::uint64_t>(belief.state[i]), weight}) {
            hash ^= part + 0x9E3779B97F4A7C15ull + (hash << 6) + (hash >> 2);
            hash *= 0xBF58476D1CE4E5B9ull;
            hash ^= hash >> 31;
        }
    }
    return hash;
}

bool alike(const Weights& a, const Weights& b) {
    std::size_t i = 0, j = 0;
    while (true) {
        while (i < a.size() && std::llround(a.weight[i] * kAlike) == 0) ++i;
        while (j < b.size() && std::llround(b.weight[j] * kAlike) == 0) ++j;
        if (i == a.size() || j == b.size()) return i == a.size() && j == b.size();
        if (a.state[i] != b.state[j] || std::llround(a.weight[i] * kAlike) != std::llround(b.weight[j] * kAlike)) {
            return false;
        }
        ++i;
        ++j;
    }
}

// The sum over the states of |a - b|.
double distance(const Weights& a, const Weights& b) {
    double sum = 0.0;
    std::size_t i = 0, j = 0;
    while (i < a.size() || j < b.size()) {
        if (j == b.size() || (i < a.size() && a.state[i] < b.state[j])) {
            sum += a.weight[i++];
        } else if (i == a.size() || b.state[j] < a.state[i]) {
            sum += b.weight[j++];
        } else {
            sum += std::abs(a.weight[i++] - b.weight[j++]);
        }
    }
    return sum;
}

std::vector<double> by_state(const Model& model, const std::vector<double>& table) {
    const auto states = static_cast<std::size_t>(model.states), actions = static_cast<std::size_t>(model.actions);
    std::vector<double> turned(states * actions);
    for (std::size_t a = 0; a < actions; ++a) {
        for (std::size_t s = 0; s < states; ++s) turned[s * actions + a] = table[a * states + s];
    }
    return turned;
}

}  // namespace

Tree::Tree(const Model& model_, const std::vector<double>& informed, const std::vector<double>& blind)
    : model(model_),
      origins(model_.actions),
      sawtooth(model_, by_state(model_, informed), model_.members.size() + 1),
      successors_(model_),
      everything_(static_cast<std::size_t>(model_.states)),
      future_(static_cast<std::size_t>(model_.states)) {
    std::iota(everything_.begin(), everything_.end(), 0);
    for (const double value : blind) scale = std::max(scale, std::abs(value));
    for (const double value : informed) scale = std::max(scale, std::abs(value));
    const std::size_t groups = model.members.size() + 1;
    for (std::size_t g = 0; g < groups; ++g) {
        const std::vector<Index>& states = states_of(static_cast<Index>(g));
        sets.emplace_back(states.size());
        if (groups == 2 && g == 1) break;  // one block: no belief is over several
        for (Index a = 0; a < model.actions; ++a) {
            std::vector<double> part;
            for (const Index s : states) {
                part.push_back(blind[static_cast<std::size_t>(a) * static_cast<std::size_t>(model.states) +
                                     static_cast<std::size_t>(s)]);
            }
            sets.back().add(part, a, a);
        }
    }
    next_vector_ = model.actions;
    for (const VectorSet& set : sets) kept_.push_back(set.count());
}

void Tree::add_vector(Index group, const std::vector<double>& vector, Index action) {
    origins.note_foreign(next_vector_);
    sets[static_cast<std::size_t>(group)].add(vector, action, next_vector_++);
}

void Tree::add_point(const Weights& belief, double value) { sawtooth.add(belief, group_of(belief), value); }

std::size_t Tree::vectors() const {
    std::size_t count = 0;
    for (const VectorSet& set : sets) count += set.count();
    return count;
}

Index Tree::group_of(const Weights& belief) const {
    const Index block = model.block[static_cast<std::size_t>(belief.state[0])];
    for (const Index s : belief.state) {
        if (model.block[static_cast<std::size_t>(s)] != block) return static_cast<Index>(model.members.size());
    }
    return block;
}

Best Tree::best(Index group, const Index* states, const double* weights, std::size_t n, std::size_t first) {
    const VectorSet& set = sets[static_cast<std::size_t>(group)];
    if (first >= set.count()) return {-1, -kInfinity};
    if (static_cast<std::size_t>(group) == model.members.size()) return set.best(states, weights, n, first);
    places_.resize(n);
    for (std::size_t i = 0; i < n; ++i) places_[i] = model.local[static_cast<std::size_t>(states[i])];
    return set.best(places_.data(), weights, n, first);
}

Index Tree::node(Weights belief) {
    const std::uint64_t hash = hash_of(belief);
    const auto range = known_.equal_range(hash);
    for (auto found = range.first; found != range.second; ++found) {
        if (alike(nodes[static_cast<std::size_t>(found->second)].belief, belief)) return found->second;
    }
    Node made;
    made.group = group_of(belief);
    made.branches.resize(static_cast<std::size_t>(model.actions));
    double entropy = 0.0;
    for (const double p : belief.weight) entropy -= p * std::log(p);
    const double most = std::log(static_cast<double>(model.states));
    made.entropy = std::clamp(static_cast<int>(most > 0 ? entropy / most * kEntropyBins : 0), 0, kEntropyBins - 1);
    made.belief = std::move(belief);
    for (Index a = 0; a < model.actions; ++a) {
        Branch& branch = made.branches[static_cast<std::size_t>(a)];
        for (std::size_t i = 0; i < made.belief.size(); ++i) {
            branch.immediate += made.belief.weight[i] * model.reward_of(a, made.belief.state[i]);
        }
        branch.upper = sawtooth.informed(made.belief, a);
        made.informed = a == 0 ? branch.upper : std::max(made.informed, branch.upper);
    }
    const Index index = static_cast<Index>(nodes.size());
    made.surface = sawtooth.bound(made.belief.state.data(), made.belief.weight.data(), made.belief.size(), made.group, 0);
    made.seen_surface = sawtooth.next_stamp();
    made.high = std::min(made.informed, made.surface);
    nodes.push_back(std::move(made));
    known_.emplace(hash, index);
    return index;
}

// Where an action leads from a node; the reference holds until the next call.
const Outcomes& Tree::outcomes(Node& node, Index action) {
    Branch& branch = node.branches[static_cast<std::size_t>(action)];
    if (branch.outcomes) return *branch.outcomes;
    const Outcomes& found = successors_.outcomes(node.belief, action);
    if (!branch.open) {
        branch.open = true;
        branch.children.resize(found.count());
        for (std::size_t c = 0; c < found.count(); ++c) {
            branch.children[c].observation = found.observation[c];
            branch.children[c].probability = found.probability[c];
            branch.children[c].group = model.block[static_cast<std::size_t>(found.states(c)[0])];
        }
        if (found.state.size() <= room_) {
            room_ -= found.state.size();
            branch.outcomes = std::make_unique<Outcomes>(found);
        }
    }
    return found;
}

Index Tree::child(Index number, Index action, std::size_t c) {
    Node& node = nodes[static_cast<std::size_t>(number)];
    Branch& branch = node.branches[static_cast<std::size_t>(action)];
    if (branch.children[c].link < 0) {
        const Outcomes& found = outcomes(node, action);
        Weights next;
        next.state.assign(found.states(c), found.states(c) + found.size(c));
        next.weight.assign(found.weights(c), found.weights(c) + found.size(c));
        for (double& weight : next.weight) weight /= found.probability[c];
        branch.children[c].link = this->node(next);
        // The values of two beliefs differ by no more than the largest value times their distance.
        branch.children[c].apart = scale * distance(next, nodes[static_cast<std::size_t>(branch.children[c].link)].belief);
    }
    return branch.children[c].link;
}

}  // namespace lcorpp
