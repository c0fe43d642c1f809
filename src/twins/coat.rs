//! Twin of `glsl/shared/coat_table.glsl` and of what reads it: the tables of rough coats, which
//! [`coat_table`](crate::scene::coat_table) computes, and of metallic microfacets, those of [`microfacet_table`].
use crate::layout::SMOOTH_ALPHA;
use crate::layout::{COAT_COLUMNS, COAT_ROWS};
use crate::scene::{CoatRow, microfacet_table};
use glam::{Vec2, vec2};

const ROWS: usize = COAT_ROWS as usize;
const COLUMNS: usize = COAT_COLUMNS as usize;

/// The row of a coat's table, words of floats, at a roughness; zeros without a table.
pub fn coat_row_at(table: &[u32], alpha: f32) -> CoatRow {
    if table.len() < ROWS * COLUMNS {
        return [0.0; COLUMNS];
    }
    let (row, f) = place(row_of(alpha), ROWS);
    let at = |row: usize, column: usize| f32::from_bits(table[row * COLUMNS + column]);
    std::array::from_fn(|column| mix(at(row, column), at(row + 1, column), f))
}

/// The share of light at cosine `c` that a rough coat does not let in.
pub fn row_outside(row: &CoatRow, c: f32) -> f32 {
    let (column, f) = place(c.clamp(0.0, 1.0).sqrt() * (COLUMNS - 2) as f32, COLUMNS - 1);
    mix(row[column], row[column + 1], f)
}

/// Mean reflectance of a rough coat for diffuse light from inside.
pub fn row_inside(row: &CoatRow) -> f32 {
    row[COLUMNS - 1]
}

/// What GGX microfacets of roughness `alpha` reflect at cosine `c`: x where their reflectance is 1 head on and 0 at grazing angles,
/// y where it is 0 and 1.
pub fn microfacet_shares(alpha: f32, c: f32) -> Vec2 {
    microfacet_entry(alpha, c.clamp(0.0, 1.0).sqrt() * (COLUMNS - 2) as f32)
}

/// The means of [`microfacet_shares`] over a diffuse hemisphere.
pub fn microfacet_means(alpha: f32) -> Vec2 {
    microfacet_entry(alpha, (COLUMNS - 1) as f32)
}

fn microfacet_entry(alpha: f32, column: f32) -> Vec2 {
    let ((row, f), (column, g)) = (place(row_of(alpha), ROWS), place(column, COLUMNS));
    let at = |row: usize, column: usize| {
        let word = microfacet_table()[row * COLUMNS + column];
        vec2((word & 0xffff) as f32, (word >> 16) as f32) / 65535.0
    };
    let along = |column| at(row, column).lerp(at(row + 1, column), f);
    along(column).lerp(along(column + 1), g)
}

fn row_of(alpha: f32) -> f32 {
    (alpha.max(SMOOTH_ALPHA).ln() / -SMOOTH_ALPHA.ln() + 1.0) * (ROWS - 1) as f32
}

/// The entry before `at`, of `count`, and how far it is to the next.
fn place(at: f32, count: usize) -> (usize, f32) {
    let first = (at as usize).min(count - 2);
    (first, at - first as f32)
}

fn mix(a: f32, b: f32, f: f32) -> f32 {
    a * (1.0 - f) + b * f
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::fresnel::fresnel_dielectric;
    use crate::math::microfacet::{microfacet_d, microfacet_g1};
    use crate::scene::coat_table;
    use glam::vec3;
    use std::f64::consts::TAU;

    /// Reflected and refracted by quadrature over slopes of microfacets, polar, without any sampling of normals:
    /// D G1(wo) G1(wi) (wo.m) / cos, times F or 1 - F.
    fn brute_force(eta: f32, ggx: bool, alpha: f32, c: f32) -> [f64; 2] {
        const RADII: usize = 300;
        const TURNS: usize = 100;
        let wo = vec3((1.0 - c * c).sqrt(), 0.0, c);
        let mut sum = [0.0; 2];
        for (i, j) in (0..RADII * TURNS).map(|k| (k / TURNS, k % TURNS)) {
            let (t, turn) = ((i as f32 + 0.5) / RADII as f32, (j as f32 + 0.5) / TURNS as f32);
            let slope = alpha * t / (1.0 - t);
            let (sin, cos) = (turn * TAU as f32).sin_cos();
            let m = vec3(slope * cos, slope * sin, 1.0).normalize();
            let co = wo.dot(m);
            if co <= 0.0 {
                continue;
            }
            let (f, sine2) = (fresnel_dielectric(co, eta).x, (1.0 - co * co) / (eta * eta));
            let beyond = (1.0 - sine2).max(0.0).sqrt();
            let area = slope * alpha / (1.0 - t).powi(2) * m.z.powi(3); // of normals, per (t, angle)
            let seen = microfacet_d(ggx, m, alpha) * microfacet_g1(ggx, wo, alpha) * co / c * area;
            for (i, (share, z)) in [(f, 2.0 * co * m.z - wo.z), (1.0 - f, -((co / eta - beyond) * m.z - wo.z / eta))]
                .into_iter()
                .enumerate()
            {
                let w = vec3((1.0 - z * z).max(0.0).sqrt(), 0.0, z);
                sum[i] += if z > 0.0 { f64::from(seen * share * microfacet_g1(ggx, w, alpha)) } else { 0.0 };
            }
        }
        sum.map(|s| s * TAU / (RADII * TURNS) as f64)
    }

    /// Mean of 2 c R(c) over cosines inside.
    fn brute_force_inside(eta: f32, ggx: bool, alpha: f32) -> f64 {
        let cosines = (0..48).map(|i| (i as f32 + 0.5) / 48.0);
        cosines.map(|c| 2.0 * f64::from(c) * brute_force(1.0 / eta, ggx, alpha, c)[0] / 48.0).sum()
    }

    #[test]
    fn a_table_agrees_with_quadrature_over_slopes() {
        for (eta, ggx) in [(1.5, false), (1.5, true), (1.1, true), (2.0, false)] {
            let table: Vec<u32> = coat_table(eta, ggx).into_iter().map(f32::to_bits).collect();
            for alpha in [0.02, 0.05, 0.1, 0.3, 0.5, 0.83, 1.0] {
                let row = coat_row_at(&table, alpha);
                let off = |found: f32, exact: f64| (f64::from(found) - exact).abs();
                for c in [0.02, 0.07, 0.2, 0.41, 0.8, 1.0] {
                    let exact = 1.0 - brute_force(eta, ggx, alpha, c)[1];
                    assert!(off(row_outside(&row, c), exact) < 3e-3, "{eta} {ggx} {alpha} {c}: {exact}");
                    let other = coat_row_at(&table, 0.7 * alpha);
                    assert!(
                        c > 0.1 || alpha > 0.1 || off(row_outside(&other, c), exact) > 3e-3,
                        "control: {alpha} {c}"
                    );
                }
                let exact = brute_force_inside(eta, ggx, alpha);
                assert!(off(row_inside(&row), exact) < 3e-3, "{eta} {ggx} {alpha}: {} {exact}", row_inside(&row));
            }
        }
    }

    #[test]
    fn a_white_base_below_a_coat_makes_no_light() {
        for (eta, ggx) in [(0.5, false), (0.8, true), (1.0, true), (1.02, false), (1.5, true), (3.0, false)] {
            for row in coat_table(eta, ggx).as_chunks::<COLUMNS>().0 {
                assert!(row.iter().take(COLUMNS - 1).all(|r| (0.0..=1.0).contains(r)), "{eta} {ggx}: {row:?}");
                let cosines = (0..512).map(|i| (i as f32 + 0.5) / 512.0);
                let leaves = cosines.map(|c| 2.0 * c * (1.0 - row_outside(row, c)) / 512.0).sum::<f32>();
                let of_base = leaves / (eta * eta * (1.0 - row_inside(row)));
                assert!(of_base < 1.003, "{eta} {ggx}: {of_base}");
            }
        }
    }
}
