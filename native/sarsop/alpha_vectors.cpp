#include "alpha_vectors.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "instruction_set.hpp"

namespace lcorpp {

namespace {

// Number of rows whose sums stay in registers during one pass over the states.
constexpr std::size_t kRun = 32;

#if defined(__GNUC__)
#define LCORPP_INLINE inline __attribute__((always_inline))
#else
#define LCORPP_INLINE inline
#endif

// out[k] = sum over i of weights[i] * table[positions[i]][row + k]
LCORPP_INLINE void sum_rows(const double* table, std::size_t capacity, const Index* positions, const double* weights,
                            std::size_t n, std::size_t row, double* out) {
    double sums[kRun] = {0.0};
    for (std::size_t i = 0; i < n; ++i) {
        const double* run = table + as_size(positions[i]) * capacity + row;
        const double weight = weights[i];
        for (std::size_t k = 0; k < kRun; ++k) sums[k] += weight * run[k];
    }
    for (std::size_t k = 0; k < kRun; ++k) out[k] = sums[k];
}

using SumRows = void (*)(const double*, std::size_t, const Index*, const double*, std::size_t, std::size_t, double*);

void sum_rows_base(const double* table, std::size_t capacity, const Index* positions, const double* weights,
                   std::size_t n, std::size_t row, double* out) {
    sum_rows(table, capacity, positions, weights, n, row, out);
}

#ifdef LCORPP_X86_64
__attribute__((target("arch=x86-64-v3"))) void sum_rows_v3(const double* table, std::size_t capacity,
                                                           const Index* positions, const double* weights,
                                                           std::size_t n, std::size_t row, double* out) {
    sum_rows(table, capacity, positions, weights, n, row, out);
}

__attribute__((target("arch=x86-64-v4"))) void sum_rows_v4(const double* table, std::size_t capacity,
                                                           const Index* positions, const double* weights,
                                                           std::size_t n, std::size_t row, double* out) {
    sum_rows(table, capacity, positions, weights, n, row, out);
}
#endif

// The widest for this machine; each gives the same sums, as products and sums are not contracted.
SumRows find_sum_rows() {
#ifdef LCORPP_X86_64
    switch (find_instruction_set()) {
        case InstructionSet::v4: return sum_rows_v4;
        case InstructionSet::v3: return sum_rows_v3;
        case InstructionSet::base: break;
    }
#endif
    return sum_rows_base;
}

const SumRows dot_run = find_sum_rows();

}  // namespace

std::size_t VectorSet::first_since(Stamp stamp) const {
    if (stamps_.empty() || stamps_.back() < stamp) return stamps_.size();
    return as_size(std::lower_bound(stamps_.begin(), stamps_.end(), stamp) - stamps_.begin());
}

Index VectorSet::find(Stamp stamp) const {
    const std::size_t row = first_since(stamp);
    return row < stamps_.size() && stamps_[row] == stamp ? static_cast<Index>(row) : -1;
}

Best VectorSet::best(const Index* positions, const double* weights, std::size_t n, std::size_t first) const {
    Best best{-1, -std::numeric_limits<double>::infinity()};
    double sums[kRun];
    // Rows from count() up to the capacity, a multiple of the run, are zeros and are ignored.
    for (std::size_t row = first - first % kRun; row < count(); row += kRun) {
        dot_run(table_.data(), capacity_, positions, weights, n, row, sums);
        const std::size_t end = std::min(count() - row, kRun);
        for (std::size_t k = row < first ? first - row : 0; k < end; ++k) {
            if (sums[k] > best.value) best = {static_cast<Index>(row + k), sums[k]};
        }
    }
    return best;
}

void VectorSet::values(const Index* positions, const double* weights, std::size_t n, std::vector<double>& out) const {
    out.resize(capacity_);
    for (std::size_t row = 0; row < count(); row += kRun) {
        dot_run(table_.data(), capacity_, positions, weights, n, row, out.data() + row);
    }
    out.resize(count());
}

void VectorSet::distances(std::size_t from, std::vector<double>& out) const {
    out.assign(count(), 0.0);
    for (std::size_t s = 0; s < states_; ++s) {
        const double* run = table_.data() + s * capacity_;
        const double own = run[from];
        for (std::size_t row = 0; row < out.size(); ++row) out[row] += (run[row] - own) * (run[row] - own);
    }
    for (double& distance : out) distance = std::sqrt(distance);
}

Index VectorSet::find_dominating(std::size_t row, const std::vector<char>& kept, double slack) const {
    std::vector<std::size_t> candidates;
    for (std::size_t other = 0; other < count(); ++other) {
        if (kept[other] && sums_[other] >= sums_[row] - slack * static_cast<double>(states_)) candidates.push_back(other);
    }
    for (std::size_t s = 0; s < states_ && !candidates.empty(); ++s) {
        const double* run = table_.data() + s * capacity_;
        const double lowest = run[row] - slack;
        candidates.erase(std::remove_if(candidates.begin(), candidates.end(),
                                        [&](std::size_t other) { return run[other] < lowest; }),
                         candidates.end());
    }
    return candidates.empty() ? -1 : static_cast<Index>(candidates.front());
}

void VectorSet::add(const std::vector<double>& vector, Index action, Stamp stamp) {
    if (count() == capacity_) grow();
    const std::size_t row = count();
    double sum = 0.0;
    for (std::size_t s = 0; s < states_; ++s) {
        table_[s * capacity_ + row] = vector[s];
        sum += vector[s];
    }
    actions_.push_back(action);
    sums_.push_back(sum);
    stamps_.push_back(stamp);
    if (central_ < 0 || sum > sums_[as_size(central_)]) central_ = static_cast<Index>(row);
}

void VectorSet::keep(const std::vector<char>& kept) {
    std::vector<std::size_t> rows;
    for (std::size_t row = 0; row < count(); ++row) {
        if (kept[row]) rows.push_back(row);
    }
    for (std::size_t s = 0; s < states_; ++s) {
        double* run = table_.data() + s * capacity_;
        for (std::size_t i = 0; i < rows.size(); ++i) run[i] = run[rows[i]];
        std::fill(run + rows.size(), run + count(), 0.0);
    }
    for (std::size_t i = 0; i < rows.size(); ++i) {
        actions_[i] = actions_[rows[i]];
        stamps_[i] = stamps_[rows[i]];
        sums_[i] = sums_[rows[i]];
    }
    actions_.resize(rows.size());
    stamps_.resize(rows.size());
    sums_.resize(rows.size());
    find_central();
}

void VectorSet::grow() {
    // A multiple of the run; half as much again limits the memory that is not used.
    const std::size_t capacity = (capacity_ + capacity_ / 2 + kRun) / kRun * kRun;
    std::vector<double> table(states_ * capacity, 0.0);
    for (std::size_t s = 0; s < states_; ++s) {
        std::copy_n(table_.data() + s * capacity_, count(), table.data() + s * capacity);
    }
    table_.swap(table);
    capacity_ = capacity;
}

void VectorSet::find_central() {
    const auto best = std::max_element(sums_.begin(), sums_.end());
    central_ = best == sums_.end() ? -1 : static_cast<Index>(best - sums_.begin());
}

}  // namespace lcorpp
