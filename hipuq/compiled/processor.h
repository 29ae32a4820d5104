/* What the processor and the operating system support. __builtin_cpu_supports would do, but the
   runtime library of zig cc answers no to all of it. */
#ifndef PROCESSOR_H
#define PROCESSOR_H
#if defined(__x86_64__)
#include <cpuid.h>

enum { HAS_AVX2 = 1, HAS_AVX512 = 2 };

/* The registers that the operating system saves and restores: XCR0. */
static inline unsigned saved_registers(void)
{
    unsigned low, high;
    __asm__ volatile("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    return low;
}

static inline int processor_has(void)
{
    const unsigned vectors = 0x06, wide = 0xe6; /* XMM and YMM; with opmask and ZMM */
    const unsigned avx512 = bit_AVX512F | bit_AVX512DQ | bit_AVX512BW | bit_AVX512VL;
    unsigned a, b, c, d;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & bit_OSXSAVE) || !(c & bit_AVX) || !(c & bit_FMA)
        || (saved_registers() & vectors) != vectors)
        return 0;
    if (!__get_cpuid_count(7, 0, &a, &b, &c, &d) || !(b & bit_AVX2))
        return 0;
    return HAS_AVX2 | ((b & avx512) == avx512 && (saved_registers() & wide) == wide ? HAS_AVX512 : 0);
}
#endif
#endif
