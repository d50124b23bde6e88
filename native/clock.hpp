// Time limit of a kernel, with a check for the user's interrupt.
#pragma once

#include <chrono>
#include <functional>
#include <utility>

namespace lcorpp {

// `expired` compares the elapsed time with the limit. At most ten times a second it also calls `check`, which throws
// if the user interrupts. Kernels call it only between two complete updates, so an interrupt leaves no partial state.
class Clock {
  public:
    explicit Clock(double seconds, std::function<void()> check = {})
        : start_(SteadyClock::now()), last_check_(start_), seconds_(seconds), check_(std::move(check)) {}

    bool expired() {
        const auto now = SteadyClock::now();
        if (check_ && std::chrono::duration<double>(now - last_check_).count() > 0.1) {
            last_check_ = now;
            check_();
        }
        return std::chrono::duration<double>(now - start_).count() >= seconds_;
    }

  private:
    using SteadyClock = std::chrono::steady_clock;
    SteadyClock::time_point start_, last_check_;
    double seconds_;
    std::function<void()> check_;
};

}  // namespace lcorpp
