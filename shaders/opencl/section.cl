// What strokes want of samples: nearest crest points, cross-sections, their commutative sums (DESIGN 5.2). Twin:
// backend/esker/solve/reference_raster.py; tables and their fields: backend/esker/solve/constraints.py.
//
// Written once for two kinds of kernel. Row-wise ones (CPUs) compile it as it stands: REAL is a float16, 16 samples of
// a row. Those with one work-item a sample (GPUs) define SECTION_SCALAR before it: REAL is a float. A MASK is the
// result of a comparison: 0 / -1 in a vector, 0 / 1 in a scalar, so use the macros to make, join and test masks.
#ifdef SECTION_SCALAR
#define REAL float
#define MASK int
#define ANY(mask) ((mask) != 0)
#define MASK_OF(truth) ((truth) ? 1 : 0)
#else
#define REAL float16
#define MASK int16
#define ANY(mask) any(mask)
#define MASK_OF(truth) ((int16)((truth) ? -1 : 0))
#endif
#define TINY 1e-20f

typedef struct {
    REAL d2, height, rx, ry, along_x, along_y, left;
} nearest_t;

typedef struct {
    REAL w, wt, wa, fade, held, g, gx, gy, toe, hard;
} sums_t;

inline REAL smooth(REAL t) {
    t = clamp(t, 0.0f, 1.0f);
    return t * t * (3.0f - 2.0f * t);
}

typedef struct {
    int m;                      // segments in all
    global const float *table;  // SEGMENT_FIELDS x m
} segments_t;

// Is segment `at` nearer to 16 samples of a row than what they have?
inline void consider(REAL *best2, MASK *best, segments_t s, int at, REAL x, float y) {
    global const float *t = s.table + at;
    size_t m = s.m;
    float dx = t[3 * m], dy = t[4 * m], py = y - t[m];
    REAL px = x - t[0], u = clamp((px * dx + py * dy) * t[6 * m], 0.0f, 1.0f);
    REAL rx = px - u * dx, ry = py - u * dy, d2 = rx * rx + ry * ry;
    MASK better = d2 < *best2;
    *best2 = select(*best2, d2, better);
    *best = select(*best, (MASK)(at), better);
}

// What the samples whose nearest segment is `at` need to know of their nearest crest point.
inline void resolve(nearest_t *out, MASK mine, segments_t s, int at, REAL x, float y) {
    global const float *t = s.table + at;
    size_t m = s.m;
    float dx = t[3 * m], dy = t[4 * m], dz = t[5 * m], il2 = t[6 * m], py = y - t[m];
    REAL px = x - t[0], u = clamp((px * dx + py * dy) * il2, 0.0f, 1.0f);
    REAL rx = px - u * dx, ry = py - u * dy, d2 = rx * rx + ry * ry;
    MASK at0 = u <= 0.0f, at1 = u >= 1.0f;
    REAL tx = select(select((REAL)(dx), (REAL)(t[9 * m]), at1), (REAL)(t[7 * m]), at0);
    REAL ty = select(select((REAL)(dy), (REAL)(t[10 * m]), at1), (REAL)(t[8 * m]), at0);
    REAL cross = tx * ry - ty * rx;
    MASK cap = (at0 && MASK_OF(t[11 * m] > 0.0f)) || (at1 && MASK_OF(t[12 * m] > 0.0f));
    REAL side = select(select((REAL)(0.5f), (REAL)(0.0f), cross < 0.0f), (REAL)(1.0f), cross > 0.0f);
    if (ANY(cap)) side = select(side, 0.5f + 0.5f * cross / fmax(sqrt(d2), 1e-6f), cap);
    REAL near0 = fmax(1.0f - 2.0f * u, 0.0f), near1 = fmax(2.0f * u - 1.0f, 0.0f);
    REAL along = (1.0f - near0 - near1) * (dz * il2);
    out->d2 = select(out->d2, d2, mine);
    out->height = select(out->height, t[2 * m] + u * dz, mine);
    out->rx = select(out->rx, rx, mine);
    out->ry = select(out->ry, ry, mine);
    out->along_x = select(out->along_x, along * dx + near0 * t[13 * m] + near1 * t[15 * m], mine);
    out->along_y = select(out->along_y, along * dy + near0 * t[14 * m] + near1 * t[16 * m], mine);
    out->left = select(out->left, side, mine);
}

// Height, fall per metre and change with the crest height of a flank (reference_raster.flank_profile). `run` is 1 / slope,
// `end` the full width of the profile, d at most that.
inline void flank_profile(REAL top, REAL slope, REAL run, REAL k, REAL f, REAL end, REAL d,
                          REAL *z, REAL *fall, REAL *lift) {
    REAL half_square = 0.5f * slope * slope, rest = end - d;
    MASK shoulder = d < 2.0f * k * top * run, foot = rest < 2.0f * f * top * run;
    *z = (1.0f + k) * top - slope * d;
    *fall = slope;
    *lift = 1.0f + k;
    if (ANY(shoulder)) {
        REAL curve = half_square / fmax(k * top, TINY), drop = 0.5f * curve * d;
        *z = select(*z, top - drop * d, shoulder);
        *fall = select(*fall, curve * d, shoulder);
        *lift = select(*lift, 1.0f + drop * d / fmax(top, TINY), shoulder);
    }
    if (ANY(foot)) {
        REAL curve = half_square / fmax(f * top, TINY), low = 0.5f * curve * rest * rest;
        *z = select(*z, low, foot);
        *fall = select(*fall, curve * rest, foot);
        *lift = select(*lift, curve * rest * (1.0f + k + f) * run - low / fmax(top, TINY), foot);
    }
}

// Adds one stroke's cross-section to the sums (reference_raster.cross_section). p: STROKE_FIELDS; s: metres a cell;
// cells: 1 / s; decay: 1 / exit length.
inline void cross_section(sums_t *sum, const nearest_t *near, MASK inside, global const float *p, float s, float cells,
                          float decay) {
    REAL zero = 0.0f, one = 1.0f, distance = select(sqrt(near->d2), zero, inside);
    REAL d = fmax(distance - p[0], 0.0f), ds = d * s;
    MASK hard = d < CREST_HALF_WIDTH;
    REAL left = near->left * p[4], present = left + (1.0f - near->left) * p[9];
    MASK has = present > 0.0f;
    REAL share = left / fmax(present, TINY);
    REAL slope = select(one, p[10] + share * (p[5] - p[10]), has), extent = p[11] + share * (p[6] - p[11]);
    REAL k = p[12] + share * (p[7] - p[12]), f = p[13] + share * (p[8] - p[13]), run = 1.0f / slope;
    REAL top = fabs(near->height), full = (1.0f + k + f) * top * run, end = select(zero, fmin(extent, full), has);
    REAL wide = 1.0f / fmax(end, SPRING_FLOOR_CELLS * s), rt = ds * wide;
    MASK reached = (inside || near->d2 <= p[3] * p[3]) && (hard || (has && rt < TOE));
    if (!ANY(reached)) return;
    REAL r = fmin(ds / fmax(end, THINNEST_M), 1e6f), z, fall, lift;
    flank_profile(top, slope, run, k, f, full, fmin(ds, end), &z, &fall, &lift);
    REAL free = smooth((r - SPRING_FULL_FRACTION) * (1.0f / (1.0f - SPRING_FULL_FRACTION)));
    REAL past = 1.0f + fmax(ds - end, 0.0f) * decay, cut = fmin(8.0f * (1.0f - end / fmax(full, TINY)), 1.0f);
    REAL leaving = select(free * cut, one, r > 1.0f);
    fall += leaving * (fmin(fall, EXIT_SHARE * decay * z) / (past * past) - fall);
    lift = select(select(lift, zero, r > 1.0f), one, !has);
    REAL sign = select(one, -one, near->height < 0.0f), down = select(zero, -sign * fall, has && distance > p[0]);
    REAL near_weight = 1.0f / (1.0f + d * d), inner = fmax(1.0f - r, 0.0f), outer = fmax(1.0f - rt * (1.0f / TOE), 0.0f);
    REAL fade = select(zero, select(present * (1.0f - free), one, hard), reached);
    REAL toe = select(zero, present * (1.0f - smooth((rt - 1.0f) * (1.0f / (TOE - 1.0f)))), reached && has);
    REAL w = near_weight * fade * select(inner * inner + TINY, one, hard), g = near_weight * toe * outer * outer;
    REAL a = SPRING_CELLS * s * wide, unit = down / fmax(distance, 0.5f);
    lift = select(lift * cells, zero, inside);
    sum->w += w;
    sum->wt += w * sign * z;
    sum->wa += w * a * a;
    sum->fade = fmax(sum->fade, fade);
    REAL held = present * (1.0f - smooth((r - HELD_FRACTION) * (1.0f / (1.0f - HELD_FRACTION))));
    sum->held = fmax(sum->held, select(zero, select(held, one, hard), reached));
    sum->g += g;
    sum->gx += g * (unit * near->rx + lift * near->along_x);
    sum->gy += g * (unit * near->ry + lift * near->along_y);
    sum->toe = fmax(sum->toe, toe);
    sum->hard = select(sum->hard, one, hard && reached);
}

inline MASK inside_row(global const float *spans, int from, int to, REAL x) {
    MASK in = 0;
    for (int i = from; i < to; i++) in = in || (x >= spans[2 * i] && x <= spans[2 * i + 1]);
    return in;
}

// What all strokes together say of samples: D and f of both equations, stiffness -1 where fixed.
typedef struct {
    REAL height_d, height_f, gradient_d, gradient_fx, gradient_fy;
} constraint_t;

// x: columns of the samples, y their row, n samples a side; a pinned border is fixed at the base.
inline constraint_t conclude(const sums_t *sum, MASK x, int y, int n, float screening, int pinned) {
    constraint_t out;
    REAL zero = 0.0f, fixed = -1.0f;
    REAL w = fmax(sum->w, TINY), target = sum->wt / w, a = sum->wa / w * sum->fade, g = fmax(sum->g, TINY);
    MASK hard = sum->hard > 0.0f;
    out.height_d = select(a, fixed, hard);
    out.height_f = select((a + screening * sum->held) * target, target, hard);
    REAL toe = CREST_STIFFNESS * sum->toe;
    if (pinned) {
        MASK edge = x == 0 || x == n - 1 || MASK_OF(y == 0 || y == n - 1);
        out.height_d = select(out.height_d, fixed, edge);
        out.height_f = select(out.height_f, zero, edge);
    }
    out.gradient_d = toe;
    out.gradient_fx = toe * sum->gx / g;
    out.gradient_fy = toe * sum->gy / g;
    return out;
}
