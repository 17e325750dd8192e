// Planes of a picture that move as in a cycle of tsar (renderer/stages/native/taking.h), with elements of two sizes.
#include <stdint.h>
#include <string.h>

#define MOVED(name, type)                                                                    \
    void name(long pixels, long planes, const int32_t* source, const type* from, type* to) { \
        for (long plane = 0; plane < planes; ++plane, from += pixels, to += pixels)          \
            for (long i = 0; i < pixels; i += 8) {                                           \
                int straight = 1;                                                            \
                for (int k = 1; k < 8; ++k) straight &= source[i + k] == source[i] + k;      \
                if (straight)                                                                \
                    memcpy(to + i, from + source[i], 8 * sizeof(type));                      \
                else                                                                         \
                    for (int k = 0; k < 8; ++k) to[i + k] = from[source[i + k]];             \
            }                                                                                \
    }

MOVED(moved16, uint16_t)
MOVED(moved32, uint32_t)
