// Numbers that do not underflow, for products that would.
#pragma once

#include <cmath>
#include <cstdint>

namespace lcorpp {

// mantissa * 2^exponent with a mantissa in [.5, 1), or 0; never negative.
class WideNumber {
  public:
    WideNumber(double value = 0.0) : mantissa_(value) { normalise(); }

    WideNumber& operator+=(const WideNumber& other) {
        if (other.mantissa_ == 0.0) return *this;
        if (mantissa_ == 0.0) return *this = other;
        const std::int64_t shift = other.exponent_ - exponent_;
        if (shift > 60) return *this = other;
        if (shift < -60) return *this;
        mantissa_ += std::ldexp(other.mantissa_, static_cast<int>(shift));
        normalise();
        return *this;
    }
    WideNumber& operator*=(const WideNumber& other) {
        mantissa_ *= other.mantissa_;
        exponent_ += other.exponent_;
        normalise();
        return *this;
    }
    friend WideNumber operator*(WideNumber a, const WideNumber& b) { return a *= b; }
    friend bool operator<(const WideNumber& a, const WideNumber& b) {
        if (a.mantissa_ == 0.0 || b.mantissa_ == 0.0) return a.mantissa_ < b.mantissa_;
        return a.exponent_ != b.exponent_ ? a.exponent_ < b.exponent_ : a.mantissa_ < b.mantissa_;
    }

    // The quotient as floating point, 0 if it is too small.
    double divide_by(const WideNumber& other) const {
        const std::int64_t shift = exponent_ - other.exponent_;
        return shift < -2000 ? 0.0 : std::ldexp(mantissa_ / other.mantissa_, static_cast<int>(shift));
    }
    double log() const { return std::log(mantissa_) + static_cast<double>(exponent_) * std::log(2.0); }
    WideNumber inverse() const {
        WideNumber result(1.0 / mantissa_);
        result.exponent_ -= exponent_;
        return result;
    }
    bool is_zero() const { return mantissa_ == 0.0; }
    double mantissa() const { return mantissa_; }
    std::int64_t exponent() const { return exponent_; }

    // The number multiplied by a power of 2.
    WideNumber shift(std::int64_t exponent) const {
        WideNumber result = *this;
        if (mantissa_ != 0.0) result.exponent_ += exponent;
        return result;
    }

  private:
    void normalise() {
        if (mantissa_ == 0.0) {
            exponent_ = 0;
            return;
        }
        int shift = 0;
        mantissa_ = std::frexp(mantissa_, &shift);
        exponent_ += shift;
    }

    double mantissa_ = 0.0;
    std::int64_t exponent_ = 0;
};

inline bool is_zero(double number) { return number == 0.0; }
inline bool is_zero(const WideNumber& number) { return number.is_zero(); }

}  // namespace lcorpp
