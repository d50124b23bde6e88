#include "instruction_set.hpp"

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
    static const InstructionSet widest = find_instruction_set();
    if (std::strcmp(kernels.name, "v3") == 0) return widest >= InstructionSet::v3;
    if (std::strcmp(kernels.name, "v4") == 0) return widest >= InstructionSet::v4;
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
