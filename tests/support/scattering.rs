//! The share of light that one scattering by microfacets keeps, by quadrature in f64.
use glam::{DVec2, DVec3, Vec3, dvec2, dvec3};
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};
use std::sync::Mutex;
use tallow::layout::{BSDF_COATED, BSDF_DIELECTRIC};
use tallow::twins::bsdf::{Bsdf, SMOOTH_ALPHA};

/// Cells in the slopes of the half vector over alpha, polar with a logarithmic radius: there a microfacet lobe is about one
/// unit wide for every roughness, incidence and index, and neither cells nor quadrature miss it or a diffuse base.
pub struct Grid {
    wo: DVec3,
    /// Index on wi's side / on wo's: 1 for reflection.
    n: f64,
    /// Roughness along x and along y.
    alpha: DVec2,
}

pub const RINGS: usize = 16;
pub const SECTORS: usize = 16;
/// Quadrature points per cell and axis.
const POINTS: usize = 20;

impl Grid {
    /// Index of the cell that `wi` falls into.
    pub fn cell(&self, wi: Vec3) -> usize {
        let h = self.wo + self.n * wi.as_dvec3();
        let slope = h.truncate() / (h.z * self.alpha);
        let log = slope.length().ln_1p();
        let t = log / (1.0 + log);
        let turn = slope.y.atan2(slope.x).rem_euclid(TAU) / TAU;
        let index = |v: f64, n: usize| ((v * n as f64) as usize).min(n - 1);
        index(t, RINGS) * SECTORS + index(turn, SECTORS)
    }

    /// wi for polar coordinates of the slope, where `radius` is that of t and (`sin`, `cos`) are of the turn, and the solid angle per unit
    /// of (t, turn); None where no wi exists.
    fn direction(&self, t: f64, radius: f64, (sin, cos): (f64, f64)) -> Option<(Vec3, f64)> {
        let side = self.wo.z.signum();
        let m = dvec3(radius * self.alpha.x * cos, radius * self.alpha.y * sin, 1.0).normalize() * side;
        let co = self.wo.dot(m);
        let ct2 = 1.0 - (1.0 - co * co) / (self.n * self.n);
        if co <= 0.0 || ct2 <= 0.0 {
            return None;
        }
        let (ci, reflected) = if self.n == 1.0 { (co, true) } else { (-ct2.sqrt(), false) };
        let wi = (co / self.n + ci) * m - self.wo / self.n;
        let slope_area = radius * (1.0 + radius) * TAU * self.alpha.x * self.alpha.y / (1.0 - t).powi(2);
        // Walter et al. 2007: d omega_m = d slope cos^3; d omega_i = (co + n ci)^2 / (n^2 |ci|) d omega_m.
        let jacobian = (co + self.n * ci).powi(2) / (self.n * self.n * ci.abs()) * (m.z * side).powi(3);
        ((wi.z * side > 0.0) == reflected).then(|| (wi.as_vec3(), slope_area * jacobian))
    }

    /// Integrals of `f` over the cells.
    pub fn integrate(&self, f: impl Fn(Vec3) -> f64) -> Vec<f64> {
        let mut cells = vec![0.0; RINGS * SECTORS];
        let (rings, sectors) = (RINGS * POINTS, SECTORS * POINTS);
        let turns: Vec<_> = (0..sectors).map(|j| (TAU * ((j as f64 + 0.5) / sectors as f64)).sin_cos()).collect();
        for i in 0..rings {
            let t = (i as f64 + 0.5) / rings as f64;
            let radius = (t / (1.0 - t)).exp_m1();
            for (j, turn) in turns.iter().enumerate() {
                if let Some((wi, area)) = self.direction(t, radius, *turn) {
                    cells[i / POINTS * SECTORS + j / POINTS] += f(wi) * area / (rings * sectors) as f64;
                }
            }
        }
        cells
    }
}

/// The grid of the reflected lobe, and of the refracted one where there is one.
pub fn grids(b: &Bsdf, wo: Vec3) -> Vec<Grid> {
    // A diffuse lobe without a rough coat spreads over all slopes.
    let alpha = if b.alpha < SMOOTH_ALPHA { DVec2::ONE } else { alphas(b) };
    let eta = f64::from(if wo.z < 0.0 { 1.0 / b.eta.x } else { b.eta.x });
    let indices = if b.kind == BSDF_DIELECTRIC { vec![1.0, eta] } else { vec![1.0] };
    indices.into_iter().map(|n| Grid { wo: wo.as_dvec3(), n, alpha }).collect()
}

/// Roughness along x and along y.
pub fn alphas(b: &Bsdf) -> DVec2 {
    let alpha = f64::from(b.alpha);
    dvec2(alpha, alpha * f64::from(b.stretch))
}

/// Smith G1 of microfacets whose roughness depends on the direction: that of the roughness in the plane of `w`.
pub fn g1_along(ggx: bool, w: DVec3, alpha: DVec2) -> f64 {
    let across = w.truncate().length().max(1e-300);
    g1(ggx, w.z.abs(), (alpha * w.truncate()).length() / across)
}

/// Smith G1 in f64, written apart from the twin.
pub fn g1(ggx: bool, z: f64, alpha: f64) -> f64 {
    let a = z / (alpha * (1.0 - z * z).max(1e-300).sqrt());
    match ggx {
        true => 2.0 / (1.0 + (1.0 + 1.0 / (a * a)).sqrt()),
        false if a >= 1.6 => 1.0,
        false => (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a),
    }
}

/// Normal distribution, per steradian.
pub fn d(ggx: bool, m: DVec3, alpha: DVec2) -> f64 {
    let c2 = (m.z * m.z).max(1e-30);
    let x = (m.truncate() / alpha).length_squared() / c2;
    (if ggx { 1.0 / (1.0 + x).powi(2) } else { (-x).exp() }) / (PI * alpha.x * alpha.y * c2 * c2)
}

/// Reflectance of a dielectric in f64, written apart from the twin; `n` = index beyond / on this side.
fn fresnel(cosine: f64, n: f64) -> f64 {
    let beyond2 = 1.0 - (1.0 - cosine * cosine) / (n * n);
    if beyond2 <= 0.0 {
        return 1.0;
    }
    let beyond = beyond2.sqrt();
    let (s, p) = ((cosine - n * beyond) / (cosine + n * beyond), (n * cosine - beyond) / (n * cosine + beyond));
    0.5 * (s * s + p * p)
}

/// Flux that microfacets of relative index `eta` send on by one scattering, per solid angle of wi and for one unit that
/// arrives along wo: reflected (Walter et al. 2007, eq. 20), or refracted (eq. 21 without the n^2 of radiance).
fn microfacets(b: &Bsdf, eta: f64, wo: DVec3, wi: DVec3) -> f64 {
    let n = if wi.z * wo.z > 0.0 { 1.0 } else { eta };
    let m = (wo + n * wi).normalize();
    let m = m * m.z.signum();
    let (co, ci) = (wo.dot(m).abs(), wi.dot(m).abs());
    let share = if n == 1.0 { fresnel(co, eta) } else { 1.0 - fresnel(co, eta) };
    // h_r points between the two, h_t away from both: the projections add up there, and subtract here.
    let q = if n == 1.0 { 2.0 * co } else { co - n * ci };
    let (alpha, g) = (alphas(b), |w: DVec3| g1_along(b.ggx, w, alphas(b)));
    share * d(b.ggx, m, alpha) * g(wo) * g(wi) * co * ci * n * n / (q * q) / wo.z.abs()
}

/// Flux that the interface reflects, or lets through, of one unit at cosine `c` from the side with relative index `eta`.
fn interface(b: &Bsdf, eta: f64, c: f64, through: bool) -> f64 {
    if b.alpha < SMOOTH_ALPHA {
        return if through { 1.0 - fresnel(c, eta) } else { fresnel(c, eta) };
    }
    let wo = dvec3((1.0 - c * c).sqrt(), 0.0, c);
    let grid = Grid { wo, n: if through { eta } else { 1.0 }, alpha: alphas(b) };
    grid.integrate(|wi| microfacets(b, eta, wo, wi.as_dvec3())).iter().sum()
}

/// What a coat's white base gives back of one unit along wo: what the coat lets in, and of that what comes out.
fn under_coat(b: &Bsdf, wo: Vec3) -> f64 {
    interface(b, f64::from(b.eta.x), f64::from(wo.z), true) * out_of_coat(b)
}

/// What comes out of one unit that a coat has let in: what it lets out, and all that comes of what it reflects inside, 1 / (1 - mean of
/// R inside). By reciprocity, out of a medium goes 1 / eta^2 of the mean that comes into it. Kept for other directions of the
/// same coat, since it takes 32 times what one direction does.
fn out_of_coat(b: &Bsdf) -> f64 {
    static KEPT: Mutex<BTreeMap<([u32; 3], bool), f64>> = Mutex::new(BTreeMap::new());
    let coat = ([b.alpha, b.stretch, b.eta.x].map(f32::to_bits), b.ggx);
    let kept = KEPT.lock().unwrap().get(&coat).copied();
    kept.unwrap_or_else(|| {
        let eta = f64::from(b.eta.x);
        let mean = |eta: f64, through: bool| {
            let cosines = (0..16).map(|i| (f64::from(i) + 0.5) / 16.0);
            cosines.map(|c| 2.0 * c * interface(b, eta, c, through) / 16.0).sum::<f64>()
        };
        let share = mean(eta, true) / (eta * eta * (1.0 - mean(1.0 / eta, false)));
        KEPT.lock().unwrap().insert(coat, share);
        share
    })
}

/// Flux that is left of one unit along wo, reflected and refracted; of a coat, reflected alone.
pub fn scattered_once(b: &Bsdf, wo: Vec3) -> [f64; 2] {
    let eta = f64::from(if wo.z < 0.0 { 1.0 / b.eta.x } else { b.eta.x });
    let flux = |wi: Vec3| microfacets(b, eta, wo.as_dvec3(), wi.as_dvec3());
    let lobes: Vec<f64> = grids(b, wo).iter().map(|grid| grid.integrate(flux).iter().sum()).collect();
    match lobes[..] {
        [reflected, refracted] => [reflected, refracted],
        _ if b.kind == BSDF_COATED => [lobes[0] + under_coat(b, wo), 0.0],
        _ => [lobes[0], 0.0],
    }
}
