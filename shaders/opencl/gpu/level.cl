// Levels as GPUs like them: one work-item per sample. Twins: backend/esker/solve/reference.py.
//
// A level is n rows of `pitch` floats, a multiple of 32, so that rows begin on a cache line; sample (y, x) is at
// y * pitch + x, channels are `stride` apart. Borders are mirrored: samples beyond them are those inside. Sums are written
// with fma and without contraction: a sample has the same bits whichever work-group computes it.
#pragma OPENCL FP_CONTRACT OFF

typedef global float *field_t;
typedef global const float *cfield_t;

typedef struct {
    int n, pitch, stride;     // this level
    int pitch2, stride2;      // the next coarser one
    float screening;
} level_t;

// The sample that stands for i, which may lie outside by less than n.
inline int mirrored(int i, int n) {
    i = abs(i);
    return max(min(i, 2 * n - 2 - i), 0);
}

// P c at fine sample (y, x).
inline float prolonged(cfield_t c, int y, int x, int pitch2) {
    int east = x & 1;
    cfield_t a = c + (size_t)(y / 2) * pitch2 + x / 2, b = c + (size_t)((y + 1) / 2) * pitch2 + x / 2;
    return 0.25f * ((a[0] + a[east]) + (b[0] + b[east]));
}

// Weights 1, 1/2, 1/4 of R = P^T, from the sums of the four corners and of the four sides.
inline float restricted(float middle, float sides, float corners) {
    return fma(0.25f, corners, fma(0.5f, sides, middle));
}

inline float sum_of_differences(float south, float north, float west, float east, float here) {
    return ((south - here) + (north - here)) + ((west - here) + (east - here));
}

// Inverse diagonal of the operator, 0 at fixed samples.
inline float inverse_diagonal(float d, float screening) { return d < 0.0f ? 0.0f : 1.0f / (4.0f + (d + screening)); }
