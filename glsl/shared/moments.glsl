// Count, means and co-moments of the guide I (four channels) and the noisy N (three) over a set of pixels, merged by the rule
// of Chan, Golub and LeVeque (1979). Co-moments are about the set's own means, so that nothing cancels, and pixels are never
// subtracted, so that none leaves a rounding error behind. The guide's means are relative to a point within the window, so
// that guides of large values keep their digits.
#include "shared/store64.glsl"

struct Moments {
    vec4 head; // count, mean N
    vec4 mean; // of I, less I at one point
    vec4 xx;   // co-moments of I.x with I
    vec3 yy;   // of I.y with I.yzw
    vec3 zz;   // of I.z with I.zw, then of I.w
    vec4 r;    // of N.r with I
    vec4 g;    // of N.g with I
    vec4 b;    // of N.b with I
};

const int MOMENTS = 8; // vec4s of a record, stored in pairs
const Moments NO_MOMENTS = Moments(vec4(0.0), vec4(0.0), vec4(0.0), vec3(0.0), vec3(0.0), vec4(0.0), vec4(0.0), vec4(0.0));

Moments unpacked(vec4 head, vec4 mean, vec4 xx, vec4 y, vec4 zr, vec4 rg, vec4 gb, vec4 b) {
    return Moments(head, mean, xx, y.xyz, vec3(y.w, zr.xy), vec4(zr.zw, rg.xy), vec4(rg.zw, gb.xy), vec4(gb.zw, b.xy));
}

// `at` is the index of a record's first pair, and `step` the distance from one pair to the next.
#define MOMENTS_LOAD(at, step, FETCH) \
    unpacked(FETCH(2 * (at)), FETCH(2 * (at) + 1), FETCH(2 * ((at) + step)), FETCH(2 * ((at) + step) + 1), \
             FETCH(2 * ((at) + 2 * step)), FETCH(2 * ((at) + 2 * step) + 1), \
             FETCH(2 * ((at) + 3 * step)), FETCH(2 * ((at) + 3 * step) + 1))
#define MOMENTS_STORE(to, at, step, m) \
    to[at] = pack64(m.head, m.mean); \
    to[(at) + step] = pack64(m.xx, vec4(m.yy, m.zz.x)); \
    to[(at) + 2 * step] = pack64(vec4(m.zz.yz, m.r.xy), vec4(m.r.zw, m.g.xy)); \
    to[(at) + 3 * step].xyz = pack64(vec4(m.g.zw, m.b.xy), m.b.zwzw).xyz

Moments rebased(Moments m, vec4 by) {
    m.mean -= by;
    return m;
}

// Merges into `m` a set of `count` pixels with the means `n` and `i` and no co-moments.
void merge_means(inout Moments m, float count, vec3 n, vec4 i) {
    vec3 off_n = n - m.head.yzw;
    vec4 off_i = i - m.mean;
    float all = m.head.x + count, share = count / max(all, 1.0);
    vec4 scaled = m.head.x * share * off_i;
    m.head = vec4(all, m.head.yzw + share * off_n);
    m.mean += share * off_i;
    m.xx += scaled.x * off_i;
    m.yy += scaled.y * off_i.yzw;
    m.zz += scaled.zzw * off_i.zww;
    m.r += off_n.r * scaled;
    m.g += off_n.g * scaled;
    m.b += off_n.b * scaled;
}

// Merges `other` into `m` if it `exists`; if not, `other` may hold anything. Both are relative to the same point.
void merge(inout Moments m, Moments other, bool exists) {
    if (!exists) other = Moments(vec4(0.0, m.head.yzw), m.mean, vec4(0.0), vec3(0.0), vec3(0.0), vec4(0.0), vec4(0.0), vec4(0.0));
    merge_means(m, other.head.x, other.head.yzw, other.mean);
    m.xx += other.xx;
    m.yy += other.yy;
    m.zz += other.zz;
    m.r += other.r;
    m.g += other.g;
    m.b += other.b;
}

// 1 / `pivot` of sums over `count` pixels; 0 leaves out a channel that is constant or depends on the others.
float reciprocal_pivot(float pivot, float diagonal, float count) {
    return pivot > 1e-5 * diagonal && pivot > 1e-20 * count ? 1.0 / pivot : 0.0;
}

// I-I co-moments with a ridge as L D L^T: columns of L below the diagonal, and the reciprocals of D.
struct Factors {
    vec3 l0;
    vec2 l1;
    float l2;
    vec4 d;
};

Factors factorised(Moments m, vec4 ridge) {
    vec4 diagonal = vec4(m.xx.x, m.yy.x, m.zz.x, m.zz.z) + ridge, d;
    d.x = reciprocal_pivot(diagonal.x, diagonal.x, m.head.x);
    vec3 l0 = m.xx.yzw * d.x;
    d.y = reciprocal_pivot(diagonal.y - l0.x * m.xx.y, diagonal.y, m.head.x);
    vec2 u1 = m.yy.yz - l0.x * m.xx.zw;
    vec2 l1 = u1 * d.y;
    d.z = reciprocal_pivot(diagonal.z - l0.y * m.xx.z - l1.x * u1.x, diagonal.z, m.head.x);
    float u2 = m.zz.y - l0.y * m.xx.w - l1.x * u1.y;
    float l2 = u2 * d.z;
    d.w = reciprocal_pivot(diagonal.w - l0.z * m.xx.w - l1.y * u1.y - l2 * u2, diagonal.w, m.head.x);
    return Factors(l0, l1, l2, d);
}

// Solves (I-I co-moments + ridge) a = v; with co-moments of N with I, a is the slope of a linear model.
vec4 solved(Factors f, vec4 v) {
    v.y -= f.l0.x * v.x;
    v.z -= f.l0.y * v.x + f.l1.x * v.y;
    v.w -= f.l0.z * v.x + f.l1.y * v.y + f.l2 * v.z;
    v *= f.d;
    v.z -= f.l2 * v.w;
    v.y -= f.l1.x * v.z + f.l1.y * v.w;
    v.x -= f.l0.x * v.y + f.l0.y * v.z + f.l0.z * v.w;
    return v;
}

// Channels of the guide that a model has a slope along, each counting for the less, the larger its ridge is: the trace of
// (I-I co-moments + ridge)^-1 (I-I co-moments).
float fitted_channels(Factors f, Moments m) {
    return solved(f, m.xx).x + solved(f, vec4(m.xx.y, m.yy)).y + solved(f, vec4(m.xx.z, m.yy.y, m.zz.xy)).z +
           solved(f, vec4(m.xx.w, m.yy.z, m.zz.yz)).w;
}
