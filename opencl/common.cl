/* Shared by all kernels: vectors, padded images, rigid motions. OpenCL C 1.2.
 *
 * Depth images and similar ones are padded planes of floats (opencl/layout.h), so that a neighbourhood never leaves the
 * buffer; AT gives a pixel's index. Model maps have no margin. */

/* Pixels of a row that a work-item processes at once: 8 on a CPU, 1 on a GPU. */
#ifndef LANES
#define LANES 8
#endif
#if LANES == 8
typedef float8 vfloat;
typedef int8 vint;
typedef short8 vshort;
typedef ushort8 vushort;
#define VLOAD(p) vload8(0, p)
#define VSTORE(v, p) vstore8(v, 0, p)
#define VINT convert_int8
#define VINT_FLOOR convert_int8_rtn
#define VFLOAT convert_float8
#define VSHORT convert_short8
#define VUSHORT convert_ushort8
#define AS_VFLOAT as_float8
#define AS_VINT as_int8
inline int any8(int8 v) { /* of comparisons; any() tests lane by lane */
    long2 q = as_long2(v.lo | v.hi);
    return (q.x | q.y) != 0;
}
#define IOTA ((float8)(0, 1, 2, 3, 4, 5, 6, 7))
#define ANY(v) any8(v)
#define SELECT(a, b, c) select(a, b, c)
#else
typedef float vfloat;
typedef int vint;
typedef short vshort;
typedef ushort vushort;
#define VLOAD(p) (*(p))
#define VSTORE(v, p) (*(p) = (v))
#define VINT convert_int
#define VINT_FLOOR convert_int_rtn
#define VFLOAT convert_float
#define VSHORT convert_short
#define VUSHORT convert_ushort
#define AS_VFLOAT as_float
#define AS_VINT as_int
#define IOTA 0.0f
#define ANY(v) (v)
#define SELECT(a, b, c) ((c) ? (b) : (a))
#endif

/* Rounding down, and to the nearest (maximum 8191 from zero), in few instructions. */
inline vint vfloor(vfloat v) {
    vint i = VINT(v);
    vint one = 1;
    return SELECT(i, i - one, VFLOAT(i) > v);
}

inline vint vnear(vfloat v) {
    return VINT(v + 8192.5f) - 8192;
}

/* Each lane's neighbour on the left; undefined for the first. */
inline vint vleft(vint v) {
#if LANES == 8
    return (int8)(INT_MIN, v.s012, v.s3456);
#else
    return INT_MIN;
#endif
}

/* The same for kernels that gain from more: the width of the device's vectors, 8 or 16 on a CPU; 1 on a GPU. */
#ifndef WIDE
#define WIDE LANES
#endif
#if WIDE == 16
typedef float16 wfloat;
typedef int16 wint;
typedef short16 wshort;
typedef ushort16 wushort;
#define WLOAD(p) vload16(0, p)
#define WSTORE(v, p) vstore16(v, 0, p)
#define WINT convert_int16_rtz
#define WFLOAT convert_float16
#define WSHORT convert_short16
#define WUSHORT convert_ushort16
#define AS_WFLOAT as_float16
#define WANY(v) any8((v).lo | (v).hi)
#define COLUMNS ((float16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15))
#else
typedef vfloat wfloat;
typedef vint wint;
typedef vshort wshort;
typedef vushort wushort;
#define WLOAD VLOAD
#define WSTORE VSTORE
#define WINT VINT
#define WFLOAT VFLOAT
#define WSHORT VSHORT
#define WUSHORT VUSHORT
#define AS_WFLOAT AS_VFLOAT
#define WANY ANY
#define COLUMNS IOTA
#endif

/* Two WIDE neighbours each: those in even and in odd places. */
inline void load_pairs(global const float *p, wfloat *even, wfloat *odd) {
#if WIDE == 16
    float16 a = vload16(0, p), b = vload16(1, p);
    *even = (float16)(a.even, b.even);
    *odd = (float16)(a.odd, b.odd);
#elif WIDE == 8
    float16 a = vload16(0, p);
    *even = a.even;
    *odd = a.odd;
#else
    *even = p[0];
    *odd = p[1];
#endif
}

/* ---- a surface's points in eight bytes: a normal in 11, 11 and 10 bits, and a float (a depth, a plane's distance)  */

inline vint pack_normals(vfloat x, vfloat y, vfloat z) { /* z is never 1: they face the camera */
    return (vnear(x * 1023.0f) << 21) | (vnear(y * 1023.0f) << 10 & 0x1ffc00) | (vnear(z * 511.5f) & 0x3ff);
}

inline uint2 pack_point(float3 n, float depth) { /* all zero without a normal */
    int3 i = convert_int3_rtz(n * (float3)(1023.0f, 1023.0f, 511.5f) + 8192.5f) - 8192;
    return (uint2)(i.x << 21 | (i.y << 10 & 0x1ffc00) | (i.z & 0x3ff), as_uint(depth));
}

inline float4 unpack_point(uint2 p) {
    int n = p.x;
    return (float4)(convert_float3((int3)(NORMAL_X(n), NORMAL_Y(n), NORMAL_Z(n))) * NORMAL_UNIT,
                    as_float(p.y));
}

/* WIDE points in planes: at consecutive indices, or at any. */
#if WIDE == 16
inline void load_points(const uint2 *from, int16 *first, int16 *second) {
    const int *f = (const int *)from;
    int16 a = vload16(0, f), b = vload16(1, f);
    *first = (int16)(a.even, b.even);
    *second = (int16)(a.odd, b.odd);
}

inline void gather_points(global const uint2 *from, int16 at, int16 *first, int16 *second) {
    int16 a = as_int16((uint16)(from[at.s0], from[at.s1], from[at.s2], from[at.s3],
                               from[at.s4], from[at.s5], from[at.s6], from[at.s7]));
    int16 b = as_int16((uint16)(from[at.s8], from[at.s9], from[at.sa], from[at.sb],
                               from[at.sc], from[at.sd], from[at.se], from[at.sf]));
    *first = (int16)(a.even, b.even);
    *second = (int16)(a.odd, b.odd);
}

#elif WIDE == 8
inline void load_points(const uint2 *from, int8 *first, int8 *second) {
    int16 a = vload16(0, (const int *)from);
    *first = a.even;
    *second = a.odd;
}

inline void gather_points(global const uint2 *from, int8 at, int8 *first, int8 *second) {
    int16 a = as_int16((uint16)(from[at.s0], from[at.s1], from[at.s2], from[at.s3],
                               from[at.s4], from[at.s5], from[at.s6], from[at.s7]));
    *first = a.even;
    *second = a.odd;
}
#else
inline void load_points(const uint2 *from, int *first, int *second) {
    *first = from->x;
    *second = from->y;
}

inline void gather_points(global const uint2 *from, int at, int *first, int *second) {
    uint2 m = from[at];
    *first = m.x;
    *second = m.y;
}
#endif

/* Stores the first `count` of LANES points at consecutive indices. */
#if LANES == 8
inline void store_points(int8 first, int8 second, int count, global uint2 *to) {
    int16 pairs;
    pairs.even = first;
    pairs.odd = second;
    if (count == LANES) {
        vstore16(pairs, 0, (global int *)to);
        return;
    }
    int both[16];
    vstore16(pairs, 0, both);
    for (int k = 0; k < count; k++) to[k] = (uint2)(both[2 * k], both[2 * k + 1]);
}
#else
inline void store_points(int first, int second, int count, global uint2 *to) {
    *to = (uint2)(first, second);
}
#endif

/* Prefetches data of the next row. PoCL's prefetch() does nothing. A GPU hides latency with other work-items. */
#if LANES == 1
#define FETCH_AHEAD(p)
#elif defined(POCL_DEVICE_ADDRESS_BITS)
#define FETCH_AHEAD(p) __builtin_prefetch((const void *)(size_t)(p))
#else
#define FETCH_AHEAD(p) prefetch(p, 1)
#endif

#define AT(c, px, py) (((py) + PAD_Y) * (c).pitch + (px) + PAD_X)

inline float3 transform(kernel_rigid m, float3 p) {
    return (float3)(dot(m.x.xyz, p) + m.x.w, dot(m.y.xyz, p) + m.y.w, dot(m.z.xyz, p) + m.z.w);
}

inline float3 rotate_vector(kernel_rigid m, float3 v) {
    return (float3)(dot(m.x.xyz, v), dot(m.y.xyz, v), dot(m.z.xyz, v));
}

inline float3 rotate_back(kernel_rigid m, float3 v) {
    return m.x.xyz * v.x + m.y.xyz * v.y + m.z.xyz * v.z;
}

/* Standard deviation of a depth, of a number or of a vector of them. */
#define DEPTH_SIGMA(n, z) ((n).base + (n).slope * (z) + (n).growth * (z) * (z))
