// Work passed from one thread to a waiting one, through one word of memory while that thread spins: waking a sleeping
// thread takes longer than some of this work.
#pragma once
#include "ticks.h"

extern "C" int sched_yield(void);

namespace team {

using namespace given;

inline long long load(const long long* box) { return __atomic_load_n(box + MAIL_STATE, __ATOMIC_ACQUIRE); }
inline bool swap(long long* box, long long from, long long to) {
    return __atomic_compare_exchange_n(box + MAIL_STATE, &from, to, false, __ATOMIC_ACQ_REL, __ATOMIC_ACQUIRE);
}

inline void pause() {
#if defined(__x86_64__)
    __builtin_ia32_pause();
#elif defined(__aarch64__)
    asm volatile("yield");
#endif
}

// A helper's loop: it runs posted work, and parks when none has come for some time.
inline void serve(long long* box, long long patience_us) {
    const long long patience = patience_us * ticks::per_microsecond();
    while (true) {
        const long long since = ticks::now();
        for (int turn = 0; load(box) != POSTED; ++turn) {
            // The swap from `IDLE` to `PARKED` fails if work has been posted meanwhile; then that is done first.
            const bool waits = ticks::now() - since <= patience && !__atomic_load_n(box + MAIL_REST, __ATOMIC_RELAXED);
            if (!waits && swap(box, IDLE, PARKED)) return;
            pause();
            if (turn % 64 == 63) sched_yield();  // another thread may need this core
        }
        if (!swap(box, POSTED, RUNNING)) continue;  // the work has been taken back
        ((void (*)(void*, void*))box[MAIL_FUNCTION])((void*)box[MAIL_BOUNDS], (void*)box[MAIL_ARGUMENTS]);
        __atomic_store_n(box + MAIL_STATE, (long long)IDLE, __ATOMIC_RELEASE);
    }
}

// Posts a launch. The answer is 1 if the helper is parked and must be woken.
inline void post(long long* box, long long function, long long bounds, long long arguments) {
    box[MAIL_FUNCTION] = function, box[MAIL_BOUNDS] = bounds, box[MAIL_ARGUMENTS] = arguments;
    box[MAIL_ANSWER] = __atomic_exchange_n(box + MAIL_STATE, (long long)POSTED, __ATOMIC_ACQ_REL) == PARKED;
}

// Waits for the launch. The answer is 1 if the helper has not begun it: then it never will, and the caller does the
// work.
inline void join(long long* box) {
    while (true) {
        const long long state = load(box);
        if (state == POSTED && swap(box, POSTED, IDLE)) {
            box[MAIL_ANSWER] = 1;
            return;
        }
        if (state == IDLE || state == PARKED) {
            box[MAIL_ANSWER] = 0;
            return;
        }
        pause();
    }
}

}  // namespace team
