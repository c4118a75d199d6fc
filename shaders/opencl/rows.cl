#if defined(__x86_64__) || defined(__aarch64__)
// Vectors wider than the processor are passed by pieces: nothing that we would link against cares.
#pragma clang diagnostic ignored "-Wpsabi"
#endif

// Rows of a level, for kernels that work a row at a time (CPU devices). Twins: backend/esker/solve/reference.py.
//
// A level is n rows of `pitch` floats; sample (y, x) is at y * pitch + PAD + x. A channel is a whole level; channels lie
// behind each other. PAD floats on both sides let vectors run past the ends. Borders are mirrored: before a row is used
// as a neighbour its ghosts [-1] and [n] are set.
#define VW 16
#define HARD_VALUE(d, soft) select(d, (float16)(soft), d < 0.0f)

typedef global float *row_t;
typedef global const float *crow_t;

// The compiler's own vload16 takes sixteen floats in four pieces.
typedef float16 __attribute__((aligned(4))) unaligned16;
typedef float8 __attribute__((aligned(4))) unaligned8;
#define FORCE_INLINE inline __attribute__((always_inline))
FORCE_INLINE float16 load16(crow_t p) { return *(global const unaligned16 *)p; }
FORCE_INLINE float8 load8(crow_t p) { return *(global const unaligned8 *)p; }
#if defined(__x86_64__) || defined(__aarch64__)
// Into the second cache: the first has no room to spare.
FORCE_INLINE void prefetch_read(crow_t p) { __builtin_prefetch((const void *)(size_t)p, 0, 2); }
FORCE_INLINE void prefetch_write(row_t p) { __builtin_prefetch((const void *)(size_t)p, 1); }
#else
// Compilers for graphics cards do not know the builtin, or refuse a pointer without an address space.
FORCE_INLINE void prefetch_read(crow_t p) {}
FORCE_INLINE void prefetch_write(row_t p) {}
#endif
FORCE_INLINE void store16(float16 v, row_t p) { *(global unaligned16 *)p = v; }

inline crow_t crow(crow_t a, int y, int pitch) { return a + (size_t)y * pitch + PAD; }
inline row_t row(row_t a, int y, int pitch) { return a + (size_t)y * pitch + PAD; }
inline int mirror(int y, int n) { return y < 0 ? -y : (y >= n ? 2 * n - 2 - y : y); }

inline void ghosts(row_t r, int n) {
    r[-1] = r[1];
    r[n] = r[n - 2];
}

// One coarse row of R = P^T: `a`, `b`, `c` are the fine rows 2J-1, 2J, 2J+1; `tmp` is scratch for one fine row.
inline void restrict_row(row_t out, crow_t a, crow_t b, crow_t c, row_t tmp, int n) {
    int nc = n / 2 + 1;
    for (int x = 0; x < n; x += VW)
        store16(load16(b + x) + 0.5f * (load16(a + x) + load16(c + x)), tmp + x);
    ghosts(tmp, n);
    for (int x = 0; x < nc; x += VW) {
        row_t t = tmp + 2 * x;
        float16 u = load16(t), v = load16(t + VW), l = load16(t - 1), m = load16(t + VW - 1);
        store16((float16)(u.even + 0.5f * (u.odd + l.even), v.even + 0.5f * (v.odd + m.even)), out + x);
    }
}
