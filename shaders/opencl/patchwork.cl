/* Blending of patches (paper 2 section 3.2, equation 1; section 4.1 for patches and weights): a gather. Twins:
   esker.patchwork.blend.loops (same arithmetic) and blend_reference (float64).

   A work-item makes SPAN samples of a row of a bin (32 on CPUs, where the loop along the row is the vector; 1 on GPUs)
   and loops over all patches that meet the bin, however many they are. Defines: BIN, STRIDE, SPAN, MARGIN (1 / cells). */

typedef struct {
    float mid_u, mid_v, per_u, per_v;   /* the domain's middle, and one over its half sides, in samples */
    float ku0, ku1, kv0, kv1;           /* the kernel */
    float volume;                       /* one over the product of the half sides in metres */
    float du_col, dv_col, du_row, dv_row;
    int side;
    int rank;                           /* equal for patches that stand equal; those of a bin come in its order */
} Patch;

static inline float fade(float outside) {
    float t = clamp(1.0f - outside, 0.0f, 1.0f);
    return t * t * t * (t * (t * 6.0f - 15.0f) + 10.0f);
}

/* 1 in the kernel, 0 from a margin beyond it on. */
static inline float presence(const Patch *p, float u, float v) {
    return fade(fmax(p->ku0 - u, u - p->ku1) * MARGIN) * fade(fmax(p->kv0 - v, v - p->kv1) * MARGIN);
}

/* Samples of a work-item, half open and one to spare, where |at + step * (first + k) - middle| * per < 1. */
static inline int2 reached(float at, float step, float middle, float per, int first) {
    const float reach = 1.0f / per;
    if (fabs(step) * BIN < 1e-6f)
        return fabs(at - middle) <= reach * 1.001f ? (int2)(0, SPAN) : (int2)(0, 0);
    const float a = (middle - reach - at) / step - first, b = (middle + reach - at) / step - first;
    return (int2)((int)clamp(fmin(a, b), 0.0f, (float)SPAN), (int)clamp(fmax(a, b) + 2.0f, 0.0f, (float)SPAN));
}

#ifdef SMOOTH
static inline float taper(float t) {
    float s = fmax(1.0f - t, 0.0f);
    return s * s * s * (3.0f * t + 1.0f);
}

static inline float4 spline(float f) {
    float g = 1.0f - f;
    float4 w;
    w.x = g * g * g * (1.0f / 6.0f);
    w.y = 2.0f / 3.0f - f * f * (1.0f - 0.5f * f);
    w.w = f * f * f * (1.0f / 6.0f);
    w.z = 1.0f - w.x - w.y - w.w;
    return w;
}

static inline float height(__global const float *c, float u, float v, int end) {
    int i = clamp((int)u, 0, end), j = clamp((int)v, 0, end);
    float4 a = spline(u - i), b = spline(v - j);
    __global const float *at = c + j * STRIDE + i;
    float4 z = b.x * vload4(0, at) + b.y * vload4(0, at + STRIDE);
    z += b.z * vload4(0, at + 2 * STRIDE) + b.w * vload4(0, at + 3 * STRIDE);
    return dot(a, z);
}
#else
static inline float taper(float t) { return fmax(1.0f - t, 0.0f); }

static inline float height(__global const float *c, float u, float v, int end) {
    int i = clamp((int)u, 0, end), j = clamp((int)v, 0, end);
    float f = u - i, g = v - j;
    __global const float *at = c + j * STRIDE + i;
    float low = at[0] + (at[1] - at[0]) * f;
    float high = at[STRIDE] + (at[STRIDE + 1] - at[STRIDE]) * f;
    return low + (high - low) * g;
}
#endif

__kernel void blend_bins(__global const int *restrict start, __global const int *restrict patch,
                         __global const float2 *restrict origin, __global const Patch *restrict patches,
                         __global const float *restrict coefficients, const int cols,
                         __global float *restrict heights, __global float *restrict cover) {
    const int bin = get_global_id(2), row = get_global_id(1), first = get_global_id(0) * SPAN;
    float above[SPAN], below[SPAN], bare[SPAN], veil[SPAN];
    for (int k = 0; k < SPAN; k++) {
        above[k] = 0.0f;
        below[k] = 0.0f;
        bare[k] = 1.0f;
        veil[k] = 1.0f;
    }
    const int last = start[bin + 1];
    int rank = start[bin] < last ? patches[patch[start[bin]]].rank : 0;
    for (int entry = start[bin]; entry < last; entry++) {
        const Patch p = patches[patch[entry]];
        __global const float *c = coefficients + (size_t)patch[entry] * (STRIDE * STRIDE);
        if (p.rank != rank) {
            rank = p.rank;
            for (int k = 0; k < SPAN; k++)
                veil[k] = bare[k];
        }
        const float u_row = origin[entry].x + p.du_row * row, v_row = origin[entry].y + p.dv_row * row;
        const int2 along = reached(u_row, p.du_col, p.mid_u, p.per_u, first);
        const int2 across = reached(v_row, p.dv_col, p.mid_v, p.per_v, first);
        const int begin = max(along.x, across.x), end = min(along.y, across.y);
        float z[SPAN];
        for (int k = begin; k < end; k++)
            z[k] = height(c, u_row + p.du_col * (first + k), v_row + p.dv_col * (first + k), p.side - 2);
        for (int k = begin; k < end; k++) {
            const float u = u_row + p.du_col * (first + k), v = v_row + p.dv_col * (first + k);
            float weight = taper(fabs(u - p.mid_u) * p.per_u) * taper(fabs(v - p.mid_v) * p.per_v);
            weight *= p.volume * veil[k];
            above[k] += weight * z[k];
            below[k] += weight;
            bare[k] *= 1.0f - presence(&p, u, v);
        }
    }
    const size_t out = ((size_t)(bin / cols) * BIN + row) * ((size_t)cols * BIN) + (bin % cols) * BIN + first;
    for (int k = 0; k < SPAN; k++) {
        heights[out + k] = below[k] > 0.0f ? above[k] / below[k] : 0.0f;
        cover[out + k] = below[k] > 0.0f ? 1.0f - bare[k] : 0.0f;
    }
}
