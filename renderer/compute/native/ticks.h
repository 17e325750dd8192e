// A clock with negligible cost: the time of a launch is divided among its stages in proportion to their ticks.
#pragma once

namespace ticks {

inline long long now() {
#if defined(__x86_64__)
    return (long long)__builtin_ia32_rdtsc();
#elif defined(__aarch64__)
    long long value;
    asm volatile("mrs %0, cntvct_el0" : "=r"(value));
    return value;
#else
    return (long long)__builtin_readcyclecounter();
#endif
}

// An estimate on x86, where the rate is unknown: 2 to 4 billion ticks per second.
inline long long per_microsecond() {
#if defined(__aarch64__)
    long long hertz;
    asm volatile("mrs %0, cntfrq_el0" : "=r"(hertz));
    return hertz / 1000000 + 1;
#else
    return 2500;
#endif
}

}  // namespace ticks
