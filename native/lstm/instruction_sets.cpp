#include <cstring>

#include "lstm.hpp"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace lcorpp::lstm {

// One per compilation of kernels.cpp, see CMakeLists.txt.
namespace base {
extern const Kernels kernels;
}
#ifdef LCORPP_INSTRUCTION_SETS
namespace v3 {
extern const Kernels kernels;
}
namespace v4 {
extern const Kernels kernels;
}
#endif

namespace {

// From the fastest to the most portable.
const Kernels* const kAll[] = {
#ifdef LCORPP_INSTRUCTION_SETS
    &v4::kernels, &v3::kernels,
#endif
    &base::kernels};

bool is_supported([[maybe_unused]] const Kernels& kernels) {
#ifdef LCORPP_INSTRUCTION_SETS
    const auto is = [&](const char* name) { return std::strcmp(kernels.name, name) == 0; };
    __builtin_cpu_init();
    const bool v3 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2");
    if (is("v3")) return v3;
    if (is("v4")) {
        return v3 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
               __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") &&
               __builtin_cpu_supports("avx512vl");
    }
#endif
    return true;
}

}  // namespace

const Kernels* find_best_kernels() {
    for (const Kernels* kernels : kAll) {
        if (is_supported(*kernels)) return kernels;
    }
    return nullptr;  // unreachable: the base kernels run everywhere
}

const Kernels* find_kernels(const char* name) {
    for (const Kernels* kernels : kAll) {
        if (std::strcmp(kernels->name, name) == 0 && is_supported(*kernels)) return kernels;
    }
    return nullptr;
}

#if defined(__x86_64__)
NoDenormals::NoDenormals() : before_(_mm_getcsr()) { _mm_setcsr(static_cast<unsigned>(before_) | 0x8040u); }
NoDenormals::~NoDenormals() { _mm_setcsr(static_cast<unsigned>(before_)); }
#else
NoDenormals::NoDenormals() : before_(0) {}
NoDenormals::~NoDenormals() { static_cast<void>(before_); }
#endif

}  // namespace lcorpp::lstm
