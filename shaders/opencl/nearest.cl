// The nearest point of each stroke's crest to samples (DESIGN 5.2); section.cl goes on from there. Twin:
// backend/esker/solve/constraints/section_reference.py; tables, fields (P_..., I_...) and constants: backend/esker/solve/constraints/tables.py.
//
// Written once for two kinds of kernel. Row-wise ones (CPUs) compile it as it stands: REAL is a float16, 16 samples of
// a row. Those with one work-item a sample (GPUs) define SECTION_SCALAR before it: REAL is a float. A MASK is the
// result of a comparison: 0 / -1 in a vector, 0 / 1 in a scalar, so use the macros to make, join and test masks.
//
// With OVER_BASE defined, crest heights are those above a base that differs from sample to sample (docs/solver.md, "Over a
// base"). It is a program of its own: where there is no base, nothing of this is compiled.
#ifdef SECTION_SCALAR
#define REAL float
#define MASK int
#define ANY(mask) ((mask) != 0)
#define MASK_OF(truth) ((truth) ? 1 : 0)
#define FIRST(v) (v)
#define LAST(v) (v)
#else
#define REAL float16
#define MASK int16
#define ANY(mask) any(mask)
#define MASK_OF(truth) ((int16)((truth) ? -1 : 0))
#define FIRST(v) (v).s0
#define LAST(v) (v).sf
#endif
#define INLINE inline __attribute__((always_inline))
#define TINY 1e-20f
#define LEAST 1e-30f   // of sums of weights: below it strokes have no say
#define SLIGHT 1e-10f  // weight of a skirt beside a band's

// The tables as a kernel's first arguments, and as it hands them on.
#define TABLE_ARGUMENTS                                                                                          \
    global const float *segments, int segment_count, global const float *knots, int knot_count,                 \
        global const float4 *pieces, global const int *octaves, global const float *strokes,                   \
        global const int *index, global const int *row_start, global const int *row_items,                      \
        global const int *span_index, global const float *spans, int row0, int column0, float spacing, float octave, \
        float exit_length, float cliff, int edition
#define TABLES                                                                                              \
    {{segment_count, segments}, {knot_count, knots, pieces, octaves}, strokes, index, row_start, row_items, \
     span_index, spans, row0, column0, spacing, octave, 1.0f / exit_length, cliff, edition}

typedef struct {
    int m;                      // segments in all
    global const float *table;  // SEGMENT_FIELDS x m
} segments_t;

typedef struct {
    int m;                        // knots in all
    global const float *knots;    // KNOT_FIELDS x m
    global const float4 *pieces;  // crest heights smoothed, octave by octave: cubics
    global const int *octaves;    // per stroke and octave: where piece 0 is
} profiles_t;

typedef struct {
    segments_t outlines;
    profiles_t profiles;
    global const float *strokes;                                // STROKE_STRIDE floats a stroke
    global const int *index, *row_start, *row_items;            // INDEX_STRIDE, and by row of bins: ITEM_STRIDE ints
    global const int *span_index;
    global const float *spans;
    int row0, column0;   // first bin of the tables
    float s, octave;     // metres a cell; metres between the controls of the first octave
    float decay, cliff;  // 1 / exit length; 1 / reach, or 0 for endless
    int edition;         // of the terrain
#ifdef OVER_BASE
#ifdef SECTION_SCALAR
    float over;  // the base at this work-item's sample
#else
    global const float *over;  // the base at the bin's first sample, rows `pitch` apart
    int pitch;
#endif
#endif
} tables_t;

#ifdef OVER_BASE
#ifdef SECTION_SCALAR
#define LOWER(near, t, y) (near).height -= (t)->over
#else
#define LOWER(near, t, y) (near).height -= vload16(0, (t)->over + (size_t)(y) * (t)->pitch)
#endif
#else
#define LOWER(near, t, y)
#endif

// square: of the distance. All places that decide something, the nearest segment or the side, come from the same correctly
// rounded operations in every kernel and twin (solve/constraints/float32.py): write fma where a compiler could fuse.
typedef struct {
    REAL distance, height, rate, rx, ry, along_x, along_y, left, right, square;
    REAL rest;  // what rounding took from the distance, from PAIRS_EDITION on
} nearest_t;

// wtt: of squares of what strokes want; from PAIRS_EDITION on of squares of what pairs of them want differently, and
// joint: of the pairs' weights (reference_raster._add); quiet: how far the bank of a course takes the springs away.
typedef struct {
    REAL w, wt, wtt, wa, fade, held, g, gx, gy, toe, hard, joint, quiet;
#ifdef OVER_BASE
    REAL share;
#endif
} sums_t;

INLINE REAL smooth(REAL t) {
    t = clamp(t, 0.0f, 1.0f);
    return fmin(t * t * (3.0f - 2.0f * t), 1.0f);
}

// --- outlines: crests that are curved in plan; level, but for courses ---

// From the nearest point of segment `at` to the samples of a row: (rx, ry); returns the share of the segment where it is.
INLINE REAL foot_of(REAL *rx, REAL *ry, segments_t s, int at, REAL x, float y) {
    global const float *t = s.table + at;
    size_t m = s.m;
    float dx = t[2 * m], dy = t[3 * m], py = y - t[m], b = py * dy;
    REAL px = x - t[0], u = clamp(fma(px, (REAL)(dx), (REAL)(b)) * t[4 * m], 0.0f, 1.0f);
    *rx = fma(-u, (REAL)(dx), px);
    *ry = fma(-u, (REAL)(dy), (REAL)(py));
    return u;
}

INLINE REAL square_of(REAL x, REAL y) {
    REAL y2 = y * y;
    return fma(x, x, y2);
}

// What is missing from `distance`, the rounded length of (x, y): beside a wide plateau the end of a band is told by a small
// difference of two distances. From |a|^2 - distance^2 = -(distance - a)(distance + a), a the longer part, of which every
// rounding is made good. No product is added to anything without fma: what a compiler may fuse changes nothing.
INLINE REAL rest_of(REAL x, REAL y, REAL distance) {
    REAL a = fmax(fabs(x), fabs(y)), b = fmin(fabs(x), fabs(y)), less = distance - a, more = distance + a;
    REAL lost = a - (more - distance), product = less * more;
    REAL left = fma(b, b, -product) - fma(less, more, -product);
    return fma(-less, lost, left) * (0.5f / fmax(distance, TINY));
}

// Share of the side on which the samples are not: none, a half on the line itself, and around its ends (`cap`), where they are
// `past` it, as much as the sine of the angle says. No difference of nearly equal numbers: a small share is exact too.
INLINE REAL lesser_side(MASK cap, REAL past, REAL cross, REAL square, REAL distance) {
    REAL none = select((REAL)(0.0f), (REAL)(0.5f), cross == 0.0f);
    if (!ANY(cap)) return none;
    return select(none, 0.5f * (past * past + TINY) / (square + distance * fabs(cross) + TINY), cap);
}

// Is segment `at` nearer to the samples of a row than what they have?
INLINE void consider(REAL *best2, MASK *best, segments_t s, int at, REAL x, float y) {
    REAL rx, ry;
    foot_of(&rx, &ry, s, at, x, y);
    REAL d2 = square_of(rx, ry);
    MASK better = d2 < *best2;
    *best2 = select(*best2, d2, better);
    *best = select(*best, (MASK)(at), better);
}

// What the samples whose nearest segment is `at` need to know of their nearest crest point. stop: P_STOP.
INLINE void resolve(nearest_t *out, MASK mine, segments_t s, int at, REAL x, float y, float stop, int edition) {
    global const float *t = s.table + at;
    size_t m = s.m;
    REAL rx, ry, u = foot_of(&rx, &ry, s, at, x, y), square = square_of(rx, ry), distance = sqrt(square);
    MASK at0 = u <= 0.0f, at1 = u >= 1.0f;
    REAL tx = select(select((REAL)(t[2 * m]), (REAL)(t[7 * m]), at1), (REAL)(t[5 * m]), at0);
    REAL ty = select(select((REAL)(t[3 * m]), (REAL)(t[8 * m]), at1), (REAL)(t[6 * m]), at0);
    REAL away = ty * rx, cross = fma(tx, ry, -away);
    MASK cap = (at0 && MASK_OF(t[9 * m] > 0.0f)) || (at1 && MASK_OF(t[10 * m] > 0.0f));
    REAL past = fma(tx, rx, ty * ry);
    REAL lesser = lesser_side(cap, past, cross, square, distance);
    REAL along = t[12 * m] * t[4 * m] * (1.0f - select((REAL)(0.0f), fmin(fabs(past) * stop, 1.0f), cap));
    out->height = select(out->height, fma(u, (REAL)(t[12 * m]), (REAL)(t[11 * m])), mine);
    out->along_x = select(out->along_x, along * t[2 * m], mine);
    out->along_y = select(out->along_y, along * t[3 * m], mine);
    out->distance = select(out->distance, distance, mine);
    out->rx = select(out->rx, rx, mine);
    out->ry = select(out->ry, ry, mine);
    out->left = select(out->left, select(lesser, 1.0f - lesser, cross > 0.0f), mine);
    out->right = select(out->right, select(lesser, 1.0f - lesser, cross < 0.0f), mine);
    out->square = select(out->square, square, mine);
    if (edition >= PAIRS_EDITION) out->rest = select(out->rest, rest_of(rx, ry, distance), mine);
}

INLINE MASK inside_row(global const float *spans, int from, int to, REAL x) {
    MASK in = 0;
    for (int i = from; i < to; i++) in = in || (x >= spans[2 * i] && x <= spans[2 * i + 1]);
    return in;
}

// --- profiles: straight in plan, of varying height ---

// Height of a crest and its slope per cell at q, by its knots. first, last: least and greatest q.
INLINE void knots_at(REAL *z, REAL *slope, profiles_t t, int start, int count, REAL q, float first, float last,
                     float steepest) {
    global const float *at = t.knots + start, *height = at + t.m, *fall = at + 2 * (size_t)t.m;
    int j = 0;
    for (int step = count / 2, left = count; left > 1; left -= step, step = left / 2)
        if (at[j + step] <= first) j += step;
    *z = height[j] + fall[j] * (q - at[j]);
    *slope = fall[j];
    for (j++; j < count && at[j] <= last; j++) {
        MASK mine = q >= at[j];
        *z = select(*z, height[j] + fall[j] * (q - at[j]), mine);
        *slope = select(*slope, (REAL)(fall[j]), mine);
    }
    *slope = clamp(*slope, -steepest, steepest);
}

// The same of a smoothed crest: a cubic per piece, `inverse` pieces a cell, a power of two. lost: what q lacks.
INLINE void spline_at(REAL *z, REAL *slope, global const float4 *pieces, REAL q, REAL lost, float first, float last,
                      float inverse) {
    REAL u = q * inverse, less = lost * inverse;
    int k = (int)floor(first * inverse), end = (int)floor(last * inverse);
    float4 a = pieces[k];
    REAL f = u - (float)k + less;
    *z = a.x + f * (a.y + f * (a.z + f * a.w));
    *slope = a.y + f * (2.0f * a.z + f * (3.0f * a.w));
    while (++k <= end) {
        a = pieces[k];
        f = u - (float)k + less;
        MASK mine = f >= 0.0f;
        *z = select(*z, a.x + f * (a.y + f * (a.z + f * a.w)), mine);
        *slope = select(*slope, a.y + f * (2.0f * a.z + f * (3.0f * a.w)), mine);
    }
    *slope *= inverse;
}

// The same in octave o: 0 is the crest itself, each further one is twice as smooth as the last.
// It counts from `middle`.
INLINE void octave_at(REAL *z, REAL *slope, const tables_t *t, global const int *at, int o, REAL q, float first,
                      float last, float middle) {
    if (o == 0) {
        knots_at(z, slope, t->profiles, at[I_FIRST], at[I_COUNT], q, first, last, STEEPEST * t->s);
        return;
    }
    global const float4 *pieces = t->profiles.pieces + t->profiles.octaves[at[I_OCTAVE] + o - 1];
    REAL from = q - middle, lost = 0.0f;
    if (t->edition >= PAIRS_EDITION) {  // far from the middle a height near 0 has few digits without what is rounded here
        REAL there = from - q;
        lost = (q - (from - there)) - (middle + there);
    }
    spline_at(z, slope, pieces, from, lost, first - middle, last - middle, t->s / (t->octave * (1 << (o - 1))));
}

// Height of a crest at q for samples d metres beyond its plateau, its slope per cell and its change per metre of d: the
// farther a sample, the smoother the crest that it sees (reference_section.crest_at).
// q is between first and last, d between near and far.
INLINE void crest_at(REAL *z, REAL *slope, REAL *rate, const tables_t *t, global const int *at, REAL q, float first,
                     float last, float middle, REAL d, float near, float far) {
    float unit = FAN * t->octave;
    int count = at[I_OCTAVES], o = 0;
    while (o < count && unit * ((2 << o) - 1) <= near) o++;
    octave_at(z, slope, t, at, o, q, first, last, middle);
    *rate = 0.0f;
    for (; o < count && unit * ((1 << o) - 1) < far; o++) {
        float from = unit * ((1 << o) - 1), inverse = 1.0f / (unit * (1 << o));
        REAL v = clamp((d - from) * inverse, 0.0f, 1.0f), share = v * v * (3.0f - 2.0f * v), smoother, along;
        octave_at(&smoother, &along, t, at, o + 1, q, first, last, middle);
        *rate = *rate * (1.0f - share) + 6.0f * inverse * v * (1.0f - v) * (smoother - *z);
        MASK all = v >= 1.0f;  // to the bit: what a sample gets does not depend on where its neighbours begin
        *z = select(*z + share * (smoother - *z), smoother, all);
        *slope = select(*slope + share * (along - *slope), along, all);
    }
}

// Least magnitude between two values on a straight line.
INLINE float nearest_zero(float a, float b) {
    return a * b <= 0.0f ? 0.0f : fmin(fabs(a), fabs(b));
}

INLINE float hypotenuse(float a, float b) {
    return sqrt(a * a + b * b);
}

// The nearest crest point of a profile; false when no sample is within its reach. Products are differences of such with
// the rounding of one made good, so that a crest of 100,000 cells has no grain.
INLINE int straight(nearest_t *out, const tables_t *t, global const float *p, global const int *at, REAL x, float y) {
    float tx = p[P_TX], ty = p[P_TY], py = y - p[P_AY], b = py * ty, c = py * tx;
    REAL px = x - p[P_AX], zero = 0.0f, slope;
    REAL along = fma(px, (REAL)(tx), (REAL)(b)) + fma(py, ty, -b);
    REAL cross = fma(py, tx, -c) - fma(px, (REAL)(ty), (REAL)(-c));
    REAL q = clamp(along, 0.0f, p[P_LENGTH]), past = along - q;
    float least = hypotenuse(nearest_zero(FIRST(past), LAST(past)), nearest_zero(FIRST(cross), LAST(cross)));
    if (least > p[P_REACH]) return 0;
    REAL square = square_of(past, cross), distance = sqrt(square), d = clamp(distance, p[P_PLATEAU], p[P_REACH]) - p[P_PLATEAU];
    out->rest = t->edition >= PAIRS_EDITION ? rest_of(past, cross, distance) : zero;
    d = fmax(d + out->rest, 0.0f);
    float q0 = FIRST(q), q1 = LAST(q), near = fmax(least - p[P_PLATEAU], 0.0f), far = fmax(FIRST(d), LAST(d));
    crest_at(&out->height, &slope, &out->rate, t, at, q, fmin(q0, q1), fmax(q0, q1), p[P_MIDDLE], d * t->s, near * t->s,
             far * t->s);
    MASK cap = past != 0.0f;
    slope *= 1.0f - fmin(fabs(past) * p[P_STOP], 1.0f);
    out->distance = distance;
    out->square = square;
    out->rx = past * tx - cross * ty;
    out->ry = past * ty + cross * tx;
    out->along_x = slope * tx;
    out->along_y = slope * ty;
    REAL lesser = lesser_side(cap, past, cross, square, distance);
    out->left = select(lesser, 1.0f - lesser, cross > 0.0f);
    out->right = select(lesser, 1.0f - lesser, cross < 0.0f);
    return 1;
}
