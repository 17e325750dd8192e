// Work handed from one thread to another that waits for it: by one word of memory while the other is awake, for
// waking a sleeping thread takes longer than some of this work.
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

// A helper's loop: runs what is posted, and parks when nothing has come for some time.
inline void serve(long long* box, long long patience_us) {
    const long long patience = patience_us * ticks::per_microsecond();
    while (true) {
        const long long since = ticks::now();
        for (int turn = 0; load(box) != POSTED; ++turn) {
            // `IDLE` to `PARKED` fails where work has come meanwhile; then it is done first.
            const bool waits = ticks::now() - since <= patience && !__atomic_load_n(box + MAIL_REST, __ATOMIC_RELAXED);
            if (!waits && swap(box, IDLE, PARKED)) return;
            pause();
            if (turn % 64 == 63) sched_yield();  // somebody else may need this core
        }
        if (!swap(box, POSTED, RUNNING)) continue;  // it has been taken back
        ((void (*)(void*, void*))box[MAIL_FUNCTION])((void*)box[MAIL_BOUNDS], (void*)box[MAIL_ARGUMENTS]);
        __atomic_store_n(box + MAIL_STATE, (long long)IDLE, __ATOMIC_RELEASE);
    }
}

// Hands a launch over. The answer is 1 where the helper is parked and must be woken.
inline void post(long long* box, long long function, long long bounds, long long arguments) {
    box[MAIL_FUNCTION] = function, box[MAIL_BOUNDS] = bounds, box[MAIL_ARGUMENTS] = arguments;
    box[MAIL_ANSWER] = __atomic_exchange_n(box + MAIL_STATE, (long long)POSTED, __ATOMIC_ACQ_REL) == PARKED;
}

// Waits for the launch. The answer is 1 where the helper has not begun: it will not, and the work is the caller's.
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
