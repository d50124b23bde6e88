// How long a kernel may run, and whether the user wants it to stop.
#pragma once

#include <chrono>
#include <functional>
#include <utility>

namespace lcorpp {

// Looks at the time whenever it is asked, and a few times a second at the user's interrupt, which comes as an
// exception from `check`. It is asked between two changes of what is kept, so that nothing is left half done.
class Clock {
  public:
    explicit Clock(double seconds, std::function<void()> check = {})
        : began_(Now::now()), checked_(began_), seconds_(seconds), check_(std::move(check)) {}

    bool over() {
        const auto now = Now::now();
        if (check_ && std::chrono::duration<double>(now - checked_).count() > 0.1) {
            checked_ = now;
            check_();
        }
        return std::chrono::duration<double>(now - began_).count() >= seconds_;
    }

  private:
    using Now = std::chrono::steady_clock;
    Now::time_point began_, checked_;
    double seconds_;
    std::function<void()> check_;
};

}  // namespace lcorpp
