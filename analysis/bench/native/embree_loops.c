/* Loops over rays that ask Embree, one call a ray or a packet of 8 or 16.

   Embree's functions, scene and arguments come as addresses, so that neither its headers nor its library are needed to
   compile. A packet is an array of words, field by field, a word a lane: a ray's origin, tnear, direction, time, tfar,
   mask, id and flags, then a hit's normal, u, v, primID, geomID and instance IDs (rtcore_ray.h of Embree 4). A single
   ray is a packet of one. */
#include <math.h>
#include <stdint.h>
#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

enum {
    ORIGIN = 0,
    TNEAR = 3,
    DIRECTION = 4,
    TIME = 7,
    TFAR = 8,
    MASK = 9,
    ID = 10,
    FLAGS = 11,
    PRIM = 17,
    GEOM = 18,
    FIELDS = 24
};
enum { MOST = 16 };
static const uint32_t NONE = 0xffffffffu;

typedef union {
    float number;
    uint32_t word;
} Word;
typedef void (*AskOne)(void* scene, Word* ray, void* arguments);
typedef void (*AskPacket)(const int* valid, void* scene, Word* rays, void* arguments);

/* Denormal numbers count as zero, as Embree's manual recommends. */
static unsigned fast_numbers(void) {
#if defined(__x86_64__)
    const unsigned before = _mm_getcsr();
    _mm_setcsr(before | 0x8040u);
    return before;
#else
    return 0;
#endif
}

static void restore_numbers(unsigned before) {
#if defined(__x86_64__)
    _mm_setcsr(before);
#else
    (void)before;
#endif
}

static inline __attribute__((always_inline)) void fill(Word* rays, int lanes, int used, const float* origin,
                                                       const float* direction, const float* t_max) {
    for (int lane = 0; lane < lanes; ++lane) {
        const int from = lane < used ? lane : 0;
        for (int axis = 0; axis < 3; ++axis) {
            rays[(ORIGIN + axis) * lanes + lane].number = origin[3 * from + axis];
            rays[(DIRECTION + axis) * lanes + lane].number = direction[3 * from + axis];
        }
        rays[TNEAR * lanes + lane].number = 0.0f;
        rays[TIME * lanes + lane].number = 0.0f;
        rays[TFAR * lanes + lane].number = t_max ? t_max[from] : INFINITY;
        rays[MASK * lanes + lane].word = NONE;
        rays[ID * lanes + lane].word = 0;
        rays[FLAGS * lanes + lane].word = 0;
        rays[PRIM * lanes + lane].word = NONE;
        rays[GEOM * lanes + lane].word = NONE;
    }
}

static inline __attribute__((always_inline)) void ask(int lanes, void* function, void* scene, void* arguments,
                                                      long count, const float* origin, const float* direction,
                                                      const float* t_max, int32_t* face, float* distance) {
    _Alignas(64) Word rays[FIELDS * MOST];
    _Alignas(64) int valid[MOST];
    for (long first = 0; first < count; first += lanes) {
        const int used = count - first < lanes ? (int)(count - first) : lanes;
        fill(rays, lanes, used, origin + 3 * first, direction + 3 * first, t_max ? t_max + first : 0);
        if (lanes == 1) {
            ((AskOne)function)(scene, rays, arguments);
        } else {
            for (int lane = 0; lane < lanes; ++lane) valid[lane] = lane < used ? -1 : 0;
            ((AskPacket)function)(valid, scene, rays, arguments);
        }
        for (int lane = 0; lane < used; ++lane) {
            const float tfar = rays[TFAR * lanes + lane].number;
            /* an occluded ray has a negative tfar and no face */
            face[first + lane] = t_max ? (tfar < 0.0f ? 0 : -1) : (int32_t)rays[PRIM * lanes + lane].word;
            distance[first + lane] = tfar;
        }
    }
}

/* Answers ``count`` rays, ``lanes`` (1, 8 or 16) a call. With ``t_max`` the function is one of rtcOccluded: ``face`` is
   0 where a ray is blocked. Without it, it is one of rtcIntersect: ``face`` is that of the closest hit. -1 elsewhere. */
void ask_embree(int lanes, void* function, void* scene, void* arguments, long count, const float* origin,
                const float* direction, const float* t_max, int32_t* face, float* distance) {
    const unsigned before = fast_numbers();
    if (lanes == 1) ask(1, function, scene, arguments, count, origin, direction, t_max, face, distance);
    if (lanes == 8) ask(8, function, scene, arguments, count, origin, direction, t_max, face, distance);
    if (lanes == 16) ask(16, function, scene, arguments, count, origin, direction, t_max, face, distance);
    restore_numbers(before);
}
