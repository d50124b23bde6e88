// The widest of the x86-64 instruction sets that kernels are compiled for and this machine supports.
#pragma once

#if defined(__x86_64__) && defined(__GNUC__)
#define LCORPP_X86_64
#include <cpuid.h>
#endif

namespace lcorpp {

// The levels of the psABI for x86-64; `base` is the code for every machine.
enum class InstructionSet { base, v3, v4 };

// By cpuid: __builtin_cpu_supports reads a table that not every compiler's runtime library fills in (zig's does not).
inline InstructionSet find_instruction_set() {
#ifdef LCORPP_X86_64
    const auto contains = [](unsigned bits, unsigned mask) { return (bits & mask) == mask; };
    unsigned a, b, c, d;
    // AVX, F16C, FMA, MOVBE, and OSXSAVE: the operating system has set xgetbv's register.
    if (!__get_cpuid(1, &a, &b, &c, &d) || !contains(c, 1u << 28 | 1u << 29 | 1u << 12 | 1u << 22 | 1u << 27)) {
        return InstructionSet::base;
    }
    unsigned saved, high;  // the registers that the operating system saves
    __asm__ volatile("xgetbv" : "=a"(saved), "=d"(high) : "c"(0));
    // LZCNT
    if (!contains(saved, 0x06) || !__get_cpuid(0x80000001, &a, &b, &c, &d) || !contains(c, 1u << 5)) {
        return InstructionSet::base;
    }
    // AVX2, BMI1, BMI2
    if (!__get_cpuid_count(7, 0, &a, &b, &c, &d) || !contains(b, 1u << 5 | 1u << 3 | 1u << 8)) {
        return InstructionSet::base;
    }
    // AVX512F, DQ, CD, BW, VL
    const unsigned avx512 = 1u << 16 | 1u << 17 | 1u << 28 | 1u << 30 | 1u << 31;
    return contains(saved, 0xe6) && contains(b, avx512) ? InstructionSet::v4 : InstructionSet::v3;
#else
    return InstructionSet::base;
#endif
}

}  // namespace lcorpp
