// Count, means and co-moments of the guide I (four channels) and the noisy N (three) over a set of pixels, merged by
// Chan's rule (Chan, Golub, LeVeque 1979): about the sets' own means, so that nothing cancels, and without ever
// subtracting a pixel, so that nothing is left behind by one that has gone. The guide's means are counted from a point
// within the window, so that far-away guides keep their digits.
#include "shared/store64.glsl"

struct Moments {
    vec4 head; // count, mean N
    vec4 mean; // of I, less I at one point
    vec4 xx;   // co-moments of I.x with I
    vec3 yy;   // of I.y with I.yzw
    vec3 zz;   // of I.z with I.zw, then of I.w
    vec4 r;    // of N.r with I
    vec4 g;
    vec4 b;
};

const int MOMENTS = 8; // vec4s of a record, which are kept in pairs
const Moments NO_MOMENTS = Moments(vec4(0.0), vec4(0.0), vec4(0.0), vec3(0.0), vec3(0.0), vec4(0.0), vec4(0.0), vec4(0.0));

Moments unpacked(vec4 head, vec4 mean, vec4 xx, vec4 y, vec4 zr, vec4 rg, vec4 gb, vec4 b) {
    return Moments(head, mean, xx, y.xyz, vec3(y.w, zr.xy), vec4(zr.zw, rg.xy), vec4(rg.zw, gb.xy), vec4(gb.zw, b.xy));
}

// `at` counts pairs, and `step` is from one of a record to its next.
#define MOMENTS_LOAD(at, step, FETCH) \
    unpacked(FETCH(2 * (at)), FETCH(2 * (at) + 1), FETCH(2 * ((at) + step)), FETCH(2 * ((at) + step) + 1), \
             FETCH(2 * ((at) + 2 * step)), FETCH(2 * ((at) + 2 * step) + 1), \
             FETCH(2 * ((at) + 3 * step)), FETCH(2 * ((at) + 3 * step) + 1))
#define MOMENTS_STORE(to, at, step, m) \
    to[at] = paired(m.head, m.mean); \
    to[(at) + step] = paired(m.xx, vec4(m.yy, m.zz.x)); \
    to[(at) + 2 * step] = paired(vec4(m.zz.yz, m.r.xy), vec4(m.r.zw, m.g.xy)); \
    to[(at) + 3 * step].xyz = paired(vec4(m.g.zw, m.b.xy), m.b.zwzw).xyz

Moments rebased(Moments m, vec4 by) {
    m.mean -= by;
    return m;
}

// `m` with a set of these means and `count` pixels that do not vary.
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

// `m` with `other` if it `is` there, and as it was if not, whatever `other` holds then. Both about the same point.
void merge(inout Moments m, Moments other, bool is) {
    if (!is) other = Moments(vec4(0.0, m.head.yzw), m.mean, vec4(0.0), vec3(0.0), vec3(0.0), vec4(0.0), vec4(0.0), vec4(0.0));
    merge_means(m, other.head.x, other.head.yzw, other.mean);
    m.xx += other.xx;
    m.yy += other.yy;
    m.zz += other.zz;
    m.r += other.r;
    m.g += other.g;
    m.b += other.b;
}

// Of a sum over `count` pixels.
float reciprocal_pivot(float pivot, float diagonal, float count) {
    // A channel that the others explain, or that is constant, takes no part.
    return pivot > 1e-5 * diagonal && pivot > 1e-20 * count ? 1.0 / pivot : 0.0;
}

// Solves (I-I co-moments + ridge) a = co-moments of N with I, for the three channels, by L D L^T.
void solve(Moments m, vec4 ridge, out vec4 r, out vec4 g, out vec4 b) {
    vec4 diagonal = vec4(m.xx.x, m.yy.x, m.zz.x, m.zz.z) + ridge, d;
    d.x = reciprocal_pivot(diagonal.x, diagonal.x, m.head.x);
    vec3 l0 = m.xx.yzw * d.x; // column 0 of L, below the diagonal
    d.y = reciprocal_pivot(diagonal.y - l0.x * m.xx.y, diagonal.y, m.head.x);
    vec2 u1 = m.yy.yz - l0.x * m.xx.zw;
    vec2 l1 = u1 * d.y;
    d.z = reciprocal_pivot(diagonal.z - l0.y * m.xx.z - l1.x * u1.x, diagonal.z, m.head.x);
    float u2 = m.zz.y - l0.y * m.xx.w - l1.x * u1.y;
    float l2 = u2 * d.z;
    d.w = reciprocal_pivot(diagonal.w - l0.z * m.xx.w - l1.y * u1.y - l2 * u2, diagonal.w, m.head.x);
    mat3x4 rhs = mat3x4(m.r, m.g, m.b);
    for (int c = 0; c < 3; c++) {
        vec4 v = rhs[c];
        v.y -= l0.x * v.x;
        v.z -= l0.y * v.x + l1.x * v.y;
        v.w -= l0.z * v.x + l1.y * v.y + l2 * v.z;
        v *= d;
        v.z -= l2 * v.w;
        v.y -= l1.x * v.z + l1.y * v.w;
        v.x -= l0.x * v.y + l0.y * v.z + l0.z * v.w;
        rhs[c] = v;
    }
    r = rhs[0];
    g = rhs[1];
    b = rhs[2];
}
