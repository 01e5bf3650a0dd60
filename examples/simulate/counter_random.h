/* Random numbers by counter: the number depends on (seed, stream, counter) alone, so that neither the number
 * of threads nor the order of the work changes it. The mixing is the finaliser of SplitMix64 (Steele, Lea,
 * Flood 2014, "Fast splittable pseudorandom number generators", OOPSLA; constants: variant 13 of Stafford's).
 */
#ifndef FATHOM_COUNTER_RANDOM_H
#define FATHOM_COUNTER_RANDOM_H

#include <math.h>
#include <stdint.h>

static inline uint64_t random_mix(uint64_t x) {
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

/* The key of a stream: mix once, then draw many numbers from it. */
static inline uint64_t random_key(uint64_t seed, uint64_t stream) {
    return random_mix(random_mix(seed) ^ (stream * 0xd1342543de82ef95u + 1));
}

static inline uint64_t random_bits(uint64_t key, uint64_t counter) {
    return random_mix(key ^ (counter * 0x2545f4914f6cdd1du));
}

/* Uniform in [0, 1). */
static inline double random_uniform(uint64_t key, uint64_t counter) {
    return (double)(random_bits(key, counter) >> 11) * 0x1p-53;
}

/* Standard normal (Box and Muller 1958). */
static inline double random_normal(uint64_t key, uint64_t counter) {
    const double u = ((double)(random_bits(key, 2 * counter) >> 11) + 1.0) * 0x1p-53;
    const double v = random_uniform(key, 2 * counter + 1);
    return sqrt(-2.0 * log(u)) * cos(6.283185307179586 * v);
}

#endif
