//! Renders pictures on the device whose every value is known by derivation.
use crate::scattering::scattered_once;
use crate::support;
use crate::twin::Workplace;
use glam::{DVec2, DVec3, dvec2, dvec3, vec3};
use std::f64::consts::PI;
use tallow::layout::{BSDF_COATED, PixelStats};
use tallow::math::srgb::luminance;
use tallow::render::{Outputs, Renderer};
use tallow::scene::Loaded;
use tallow::shaders::shared::light::EVEN_SHARE;
use tallow::twins::bsdf::Bsdf;

const SIDE: u32 = 64;

fn rendered(scene: &Loaded) -> Vec<PixelStats> {
    let gpu = support::gpu();
    let renderer = Renderer::new(&gpu, scene, &scene.settings, Outputs::default()).unwrap();
    let stats = support::render(&gpu, &renderer);
    support::assert_silent(&gpu);
    stats
}

/// Means over the film of the red channel and of the variance of one sample.
fn mean_and_variance(stats: &[PixelStats]) -> (f64, f64) {
    let sum =
        |of: &dyn Fn(&PixelStats) -> f32| stats.iter().map(|s| f64::from(of(s))).sum::<f64>() / stats.len() as f64;
    (sum(&|s| s.mean[0]), sum(&|s| s.m2[0] / (s.count - 1) as f32))
}

/// A square film: [-1, 1] (right, up) of the middle of pixel `i`.
fn middle(i: usize) -> DVec2 {
    let at = |v: usize| (v as f64 + 0.5) * 2.0 / f64::from(SIDE) - 1.0;
    dvec2(at(i % SIDE as usize), -at(i / SIDE as usize))
}

const SPOT: DVec3 = dvec3(0.5, 3.0, -0.4);
const SPOT_TARGET: DVec3 = dvec3(-0.2, 0.0, 0.3);
const ALBEDO: f64 = 0.5;
const INTENSITY: f64 = 7.0;

/// Looks down from 4 above at 4 by 4 of a floor, which the spot alone lights.
fn spot_over_floor() -> Loaded {
    Workplace::new().scene(&format!(
        "[film]\nwidth = {SIDE}\nheight = {SIDE}\nfilter = 'point'\n[camera]\nposition = [0.0, 4.0, 0.0]\n\
         target = [0.0, 0.0, 0.0]\nup = [0.0, 0.0, -1.0]\nfov = 53.13010235\n[render]\nspp = 1\nmax_depth = 2\n\
         [[light]]\ntype = 'spot'\nposition = {:?}\ntarget = {:?}\nintensity = {INTENSITY}\n\
         cone = 10.0\ncutoff = 25.0\n[[material]]\nname = 'floor'\ncolor = {ALBEDO}\n[[mesh]]\nshape = 'rectangle'\n\
         material = 'floor'\ntransform = {{ rotate = [-90.0, 0.0, 0.0], scale = 2.5 }}\n",
        SPOT.to_array(),
        SPOT_TARGET.to_array()
    ))
}

/// From the spot to the floor behind a pixel.
fn to_floor(pixel: usize) -> DVec3 {
    let film = middle(pixel);
    dvec3(2.0 * film.x, 0.0, -2.0 * film.y) - SPOT
}

/// Degrees from the spot's axis.
fn angle(pixel: usize) -> f64 {
    to_floor(pixel).angle_between(SPOT_TARGET - SPOT).to_degrees()
}

/// albedo / pi I cos / d^2 times the fall-off.
fn lit_floor(pixel: usize, falloff: impl Fn(f64) -> f64) -> f64 {
    let way = to_floor(pixel);
    ALBEDO / PI * INTENSITY * -way.y / way.length().powi(3) * falloff(angle(pixel))
}

/// Full up to `cone`, none beyond `cutoff`, linear in the angle between the two.
fn linear(angle: f64) -> f64 {
    ((25.0 - angle) / 15.0).clamp(0.0, 1.0)
}

/// The control: a fall-off that is linear in the cosine.
fn linear_in_the_cosine(angle: f64) -> f64 {
    let [angle, cone, cutoff] = [angle, 10.0, 25.0].map(|degrees: f64| degrees.to_radians().cos());
    ((angle - cutoff) / (cone - cutoff)).clamp(0.0, 1.0)
}

#[test]
fn a_spot_lights_a_diffuse_floor_by_the_inverse_square() {
    let stats = rendered(&spot_over_floor());
    let kinds =
        [0.0..10.0, 10.0..25.0, 25.0..90.0].map(|r| (0..stats.len()).filter(|&i| r.contains(&angle(i))).count());
    assert!(kinds.iter().all(|&pixels| pixels > 100), "{kinds:?} in the cone, in the fall-off, in the dark");
    let largest = ALBEDO / PI * INTENSITY / SPOT.y.powi(2);
    let off = |falloff: fn(f64) -> f64| {
        let of_pixel = |(i, s): (usize, &PixelStats)| (f64::from(s.mean[0]) - lit_floor(i, falloff)).abs() / largest;
        support::largest_f64(stats.iter().enumerate().map(of_pixel))
    };
    println!("off by at most {:.1e} of the largest", off(linear));
    // Lavapipe's arc cosine brings it to 5e-5.
    assert!(off(linear) < 3e-4, "{}", off(linear));
    assert!(off(linear_in_the_cosine) > 0.01, "control: {}", off(linear_in_the_cosine));
}

const LENS: f64 = 0.3;
const FOCUS: f64 = 4.0;
const DEPTH: f64 = 2.0;
/// Half the edge of the emitting square, and its middle.
const HALF: f64 = 0.1;
const PLACE: DVec2 = dvec2(0.25, -0.1);

fn square_out_of_focus(lens: f64) -> Loaded {
    Workplace::new().scene(&format!(
        "[film]\nwidth = {SIDE}\nheight = {SIDE}\n[camera]\nposition = [0.0, 0.0, {DEPTH}]\ntarget = [0.0, 0.0, 0.0]\n\
         fov = 53.13010235\nlens_radius = {lens}\nfocus_distance = {FOCUS}\n[render]\nspp = 1024\nmax_depth = 1\n\
         [[material]]\nname = 'lamp'\nemission = 1.0\n[[mesh]]\nshape = 'rectangle'\nmaterial = 'lamp'\n\
         transform = {{ translate = [{}, {}, 0.0], scale = {HALF} }}\n",
        PLACE.x, PLACE.y
    ))
}

/// Of the picture in the plane in focus: light times area, middle, mean squared distance from it, and the largest one.
fn moments(stats: &[PixelStats]) -> (f64, DVec2, f64, f64) {
    let half = 0.5 * FOCUS; // tan(fov / 2) = 1 / 2
    let pixel = (2.0 * half / f64::from(SIDE)).powi(2);
    let points: Vec<_> = (0..stats.len()).map(|i| (f64::from(stats[i].mean[0]), half * middle(i))).collect();
    let light: f64 = points.iter().map(|(l, _)| l).sum();
    let centre = points.iter().map(|&(l, p)| l * p).sum::<DVec2>() / light;
    let spread = points.iter().map(|(l, p)| l * p.distance_squared(centre)).sum::<f64>() / light;
    let reach = points.iter().filter(|(l, _)| *l > 0.0).map(|(_, p)| p.distance(centre)).fold(0.0, f64::max);
    // A pixel's own extent adds the variance of a uniform square.
    (light * pixel, centre, spread - pixel / 6.0, reach)
}

/// From a point of the lens, the square at depth d covers in the plane in focus, at depth F, a square F / d as large,
/// moved by (1 - F / d) times the point's place on the lens. All together it is blurred over a disk, the circle of
/// confusion, whose radius is R |F - d| / d; variances add, and no light is lost.
fn is_blurred(stats: &[PixelStats], lens: f64) -> Result<(), String> {
    let (light, centre, spread, reach) = moments(stats);
    let (half, circle) = (HALF * FOCUS / DEPTH, lens * (FOCUS - DEPTH) / DEPTH);
    let (exact_light, exact_spread) = (4.0 * half * half, circle * circle / 2.0 + 2.0 * half * half / 3.0);
    let ok = (light / exact_light - 1.0).abs() < 5e-3
        && centre.distance(PLACE * FOCUS / DEPTH) < 2e-3
        && (spread / exact_spread - 1.0).abs() < 0.02
        && (circle + half..circle + 1.7 * half).contains(&reach); // a pixel beyond the corner at most
    let found = format!("light {light:.5} {centre:.4} spread {spread:.5} reach {reach:.4}");
    if ok { Ok(()) } else { Err(format!("{found}, expected {exact_light:.5}, {exact_spread:.5}, {circle} + {half}")) }
}

#[test]
fn a_lens_blurs_over_its_circle_of_confusion() {
    let pictures = [LENS, 0.0].map(|lens| rendered(&square_out_of_focus(lens)));
    is_blurred(&pictures[0], LENS).unwrap();
    is_blurred(&pictures[1], 0.0).unwrap();
    assert!(is_blurred(&pictures[0], 1.03 * LENS).is_err(), "control: another lens");
    assert!(is_blurred(&pictures[1], LENS).is_err(), "control: a pinhole");
}

/// A sheet in the plane z = 0 in a sky of radiance 1, seen from afar, `degrees` from +z.
fn sheet_in_the_sky(material: &str, degrees: f32) -> Loaded {
    let (s, c) = degrees.to_radians().sin_cos();
    Workplace::new().scene(&format!(
        "[film]\nwidth = 32\nheight = 32\n[camera]\nposition = [{}, 0.0, {}]\ntarget = [0.0, 0.0, 0.0]\nfov = 0.1\n\
         [render]\nspp = 256\nmax_depth = 2\n[environment]\nradiance = 1.0\n[[material]]\nname = 'sheet'\n{material}\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'sheet'\n",
        20.0 * s,
        20.0 * c
    ))
}

/// Refracted radiance is divided by the relative index squared.
fn left_of_the_sky(b: &Bsdf, degrees: f32) -> f64 {
    let (s, c) = degrees.to_radians().sin_cos();
    let eta = f64::from(if c < 0.0 { 1.0 / b.eta.x } else { b.eta.x });
    let [reflected, refracted] = scattered_once(b, vec3(s, 0.0, c));
    reflected + refracted / (eta * eta)
}

#[test]
fn rough_sheets_show_what_single_scattering_leaves_of_a_white_sky() {
    let glass = |rest: &str| format!("type = 'dielectric'\nior = 1.5\n{rest}\n");
    let coat = |rest: &str| format!("type = 'coated'\ncolor = 1.0\nior = 1.5\n{rest}\n");
    for (material, degrees) in [
        (glass("alpha = 0.8"), 35.0),
        (glass("alpha = 0.5\ndistribution = 'ggx'"), 60.0),
        (glass("alpha = 0.4\ndistribution = 'ggx'"), 140.0), // from inside
        (coat("alpha = 0.2"), 75.0),
        (coat("alpha = 0.6\ndistribution = 'ggx'"), 40.0),
    ] {
        let scene = sheet_in_the_sky(&material, degrees);
        let sheet = &scene.materials[scene.triangles[0].material as usize];
        let b = Bsdf::new(sheet, sheet.alpha, &scene.texels);
        let exact = left_of_the_sky(&b, degrees);
        let stats = rendered(&scene);
        let mean = stats.iter().map(|s| f64::from(s.mean[0])).sum::<f64>() / stats.len() as f64;
        println!("{mean:.5}, by quadrature {exact:.5}");
        // A coat's table stands for its quadrature.
        let tolerance = if b.kind == BSDF_COATED { 3e-3 } else { 1e-3 };
        assert!((mean - exact).abs() < tolerance, "{mean}, by quadrature {exact}: {degrees} degrees, {material}");
        let smoother = left_of_the_sky(&Bsdf::new(sheet, 0.8 * b.alpha, &scene.texels), degrees);
        assert!((mean - smoother).abs() > tolerance, "control: {degrees} degrees, {material}");
    }
}

/// Inside a cube that faces outward, emits E = 1 to both sides and reflects rho = 0.5, radiance after d = 4 edges is
/// E (1 - rho^d) / (1 - rho) = 1.875.
#[test]
fn what_shines_from_behind_lights_what_lies_there() {
    let inside = |more: &str| {
        rendered(&Workplace::new().scene(&format!(
            "[film]\nwidth = {SIDE}\nheight = {SIDE}\n[camera]\nposition = [0.1, 0.2, 0.3]\ntarget = [0.4, -0.3, -0.5]\nfov = 90.0\n\
             [render]\nspp = 16\nmax_depth = 4\n[[material]]\nname = 'glow'\ncolor = 0.5\nemission = 1.0\n{more}\n\
             [[mesh]]\nshape = 'cube'\nmaterial = 'glow'\n"
        )))
    };
    let (mean, variance) = mean_and_variance(&inside("emission_two_sided = true"));
    let error = (variance / f64::from(16 * SIDE * SIDE)).sqrt();
    assert!((mean - 1.875).abs() < 4.0 * error && error < 1e-3, "{mean} with a standard error of {error}");
    assert!(inside("").iter().all(|s| s.mean == [0.0; 3]), "control: the front alone");
}

/// Of point and spot lights, light sampling weighs what each brings: what a matt floor gets of all of them is the sum of that of each,
/// whichever a sample chooses, but for the share of the choices that all get alike.
#[test]
fn several_point_and_spot_lights_bring_little_noise() {
    let lights = [
        "type = 'spot'\nposition = [0.5, 3.0, 0.2]\ntarget = [0.0, 0.0, 0.0]\nintensity = 40.0\ncone = 10.0\ncutoff = 25.0\n",
        "type = 'point'\nposition = [-1.0, 1.5, 0.5]\nintensity = [9.0, 3.0, 1.0]\n",
        "type = 'spot'\nposition = [1.0, 1.0, 0.2]\ntarget = [1.2, 0.0, 1.0]\nintensity = 2.0\ncone = 20.0\ncutoff = 30.0\n",
        "type = 'point'\nposition = [0.2, -0.5, 0.5]\nintensity = 50.0\n", // below the floor
    ];
    let floor = |lights: &[&str]| {
        let lights: String = lights.iter().map(|light| format!("[[light]]\n{light}")).collect();
        rendered(&Workplace::new().scene(&format!(
            "[film]\nwidth = {SIDE}\nheight = {SIDE}\nfilter = 'point'\n[camera]\nposition = [0.0, 4.0, 0.0]\n\
             target = [0.0, 0.0, 0.0]\nup = [0.0, 0.0, -1.0]\nfov = 53.13010235\n[render]\nspp = 16\nmax_depth = 2\n{lights}\
             [[mesh]]\nshape = 'rectangle'\ntransform = {{ rotate = [-90.0, 0.0, 0.0], scale = 9.0 }}\n"
        )))
    };
    let (all, each) = (floor(&lights), lights.map(|light| floor(&[light])));
    for (i, s) in all.iter().enumerate() {
        let sum: f32 = each.iter().map(|one| luminance(one[i].mean)).sum();
        // Lights of another colour than white leave the noise of which of them was chosen.
        assert!((luminance(s.mean) / sum - 1.0).abs() < 0.1, "pixel {i}: {} of {sum}", luminance(s.mean));
    }
}

/// A bright light behind a wall, which brings nothing, is not known to be hidden. A lamp that is seen is chosen at least once in twice
/// [`EVEN_SHARE`]: the variance of one sample is at most 2 / EVEN_SHARE - 1 of the square of its light.
#[test]
fn a_light_behind_a_wall_does_not_starve_those_that_are_seen() {
    let stats = rendered(&Workplace::new().scene(&format!(
        "[film]\nwidth = {SIDE}\nheight = {SIDE}\nfilter = 'point'\n[camera]\nposition = [0.0, 4.0, 0.0]\ntarget = [0.0, 0.0, 0.0]\n\
         up = [0.0, 0.0, -1.0]\nfov = 40.0\n[render]\nspp = 256\nmax_depth = 2\n\
         [[light]]\ntype = 'point'\nposition = [0.0, 3.0, 0.0]\nintensity = 1.0\n\
         [[light]]\ntype = 'point'\nposition = [0.0, 0.5, -2.2]\nintensity = 10000.0\n\
         [[material]]\nname = 'floor'\ncolor = {ALBEDO}\n[[mesh]]\nshape = 'rectangle'\nmaterial = 'floor'\n\
         transform = {{ rotate = [-90.0, 0.0, 0.0], scale = 9.0 }}\n\
         [[mesh]]\nshape = 'cube'\ntransform = {{ scale = [9.0, 2.0, 0.1], translate = [0.0, 0.0, -1.9] }}\n"
    )));
    let film = |i: usize| 4.0 * 20f64.to_radians().tan() * middle(i);
    let exact = |i: usize| ALBEDO / PI * 3.0 / (9.0 + film(i).length_squared()).powf(1.5);
    let relative: Vec<f64> = (0..stats.len()).map(|i| f64::from(stats[i].mean[0]) / exact(i)).collect();
    let n = relative.len() as f64;
    let (mean, most) = (relative.iter().sum::<f64>() / n, 2.0 / f64::from(EVEN_SHARE) - 1.0);
    let error = (most / 256.0 / n).sqrt();
    assert!((mean - 1.0).abs() < 4.0 * error, "{mean} within {error}");
    let variance = relative.iter().map(|r| (r - 1.0).powi(2)).sum::<f64>() / n;
    assert!(variance < 1.5 * most / 256.0, "{variance} of {}", most / 256.0);
}

/// Below two veils of opacity a and b a sun leaves (1 - a) (1 - b) of its light, without noise: one sample tells it. Rays of a path decide
/// by chance, so that none goes further than the floor here.
#[test]
fn veils_dim_a_sun_without_noise() {
    let below = |veils: &str| {
        rendered(&Workplace::new().scene(&format!(
            "[film]\nwidth = {SIDE}\nheight = {SIDE}\nfilter = 'point'\n[camera]\nposition = [0.0, 1.0, 0.0]\ntarget = [0.0, 0.0, 0.0]\n\
             up = [0.0, 0.0, -1.0]\nfov = 40.0\n[render]\nspp = 1\nmax_depth = 2\n\
             [[light]]\ntype = 'directional'\ndirection = [0.3, -1.0, 0.2]\nirradiance = 2.0\n\
             [[material]]\nname = 'thin'\nopacity = 0.4\n[[material]]\nname = 'dense'\nopacity = 0.75\n\
             [[mesh]]\nshape = 'rectangle'\ntransform = {{ rotate = [-90.0, 0.0, 0.0], scale = 9.0 }}\n{veils}"
        )))
    };
    let veil = |name: &str, y: f32| {
        format!(
            "[[mesh]]\nshape = 'rectangle'\nmaterial = '{name}'\n\
             transform = {{ rotate = [-90.0, 0.0, 0.0], scale = 9.0, translate = [0.0, {y}, 0.0] }}\n"
        )
    };
    let bare = below("");
    for (veils, left) in [(veil("thin", 3.0), 0.6), (veil("thin", 3.0) + &veil("dense", 4.0), 0.15)] {
        for (s, b) in below(&veils).iter().zip(&bare) {
            assert!(b.mean[0] > 0.0 && (s.mean[0] / b.mean[0] - left).abs() < 1e-4, "{} of {}", s.mean[0], b.mean[0]);
        }
    }
}

/// In single precision the cosines of small angles are alike.
#[test]
fn narrow_spots_fall_off_linearly_in_the_angle() {
    for cutoff in [5.0f64, 0.1, 0.01] {
        let stats = rendered(&Workplace::new().scene(&format!(
            "[film]\nwidth = {SIDE}\nheight = {SIDE}\nfilter = 'point'\n[camera]\nposition = [0.0, 4.0, 0.0]\ntarget = [0.0, 0.0, 0.0]\n\
             up = [0.0, 0.0, -1.0]\nfov = {}\n[render]\nspp = 1\nmax_depth = 2\n[[light]]\ntype = 'spot'\nposition = [0.0, 4.0, 0.0]\n\
             direction = [0.0, -1.0, 0.0]\nintensity = {INTENSITY}\ncone = 0.0\ncutoff = {cutoff}\n[[material]]\nname = 'floor'\n\
             color = {ALBEDO}\n[[mesh]]\nshape = 'rectangle'\nmaterial = 'floor'\n\
             transform = {{ rotate = [-90.0, 0.0, 0.0], scale = 9.0 }}\n",
            2.2 * cutoff
        )));
        let largest = ALBEDO / PI * INTENSITY / 16.0;
        for (i, s) in stats.iter().enumerate() {
            let tangent = (1.1 * cutoff).to_radians().tan() * middle(i).length();
            let share = (1.0 - tangent.atan().to_degrees() / cutoff).max(0.0);
            let off = f64::from(s.mean[0]) / largest - share * (1.0 + tangent * tangent).powi(-2);
            assert!(off.abs() < 4e-3, "{cutoff} degrees, pixel {i}: off by {off}");
        }
    }
}

/// Light sampling chooses both sides of such a lamp, whether by area or by solid angle: what lies behind it has no more noise.
#[test]
fn a_lamp_that_shines_from_behind_is_as_clear_as_from_its_front() {
    for size in [0.05, 1.0] {
        let [front, behind] = [90.0, -90.0].map(|turn| {
            mean_and_variance(&rendered(&Workplace::new().scene(&format!(
                "[film]\nwidth = {SIDE}\nheight = {SIDE}\n[camera]\nposition = [0.0, 4.0, 0.0]\ntarget = [0.0, 0.0, 0.0]\n\
                 up = [0.0, 0.0, -1.0]\nfov = 40.0\n[render]\nspp = 64\nmax_depth = 2\n[[material]]\nname = 'panel'\n\
                 emission = 1.0\nemission_two_sided = true\n\
                 [[mesh]]\nshape = 'rectangle'\ntransform = {{ rotate = [-90.0, 0.0, 0.0], scale = 4.0 }}\n\
                 [[mesh]]\nshape = 'rectangle'\nmaterial = 'panel'\n\
                 transform = {{ rotate = [{turn}, 0.0, 0.0], scale = {size}, translate = [0.0, 4.5, 0.0] }}\n"
            ))))
        });
        let error = ((front.1 + behind.1) / f64::from(64 * SIDE * SIDE)).sqrt();
        assert!((front.0 - behind.0).abs() < 4.0 * error, "{front:?}, {behind:?}: {size}");
        assert!(behind.1 < 1.2 * front.1 && front.1 < 1.2 * behind.1, "{front:?}, {behind:?}: {size}");
    }
}

/// A square lamp of half side `a`, `h` above the middle of a floor: seen from there, the irradiance is 4 q atan(q) with q = a / sqrt(a² + h²).
/// Shadow rays end before the lamp, far from the origin by more; what it brings is still that of the lamp itself. A lamp so wide that
/// single precision finds it in one plane with the point is sampled by area.
#[test]
fn lamps_far_from_the_origin_and_very_wide_ones_bring_what_their_size_does() {
    for (o, h, a, tolerance) in [(8192.0, 1.0 / 32.0, 0.5, 0.003), (0.0, 0.25, 1e4, 0.001), (0.0, 0.25, 1000.0, 0.001)]
    {
        let (floor, lamp) = (f64::max(a, 1.0), [o, o + h, o]);
        let scene = Workplace::new().scene(&format!(
            "[film]\nwidth = {SIDE}\nheight = {SIDE}\n[camera]\nposition = [{o:?}, {:?}, {o:?}]\ntarget = [{o:?}, {o:?}, {o:?}]\n\
             up = [0.0, 0.0, -1.0]\northographic = {:?}\n[render]\nspp = 64\nmax_depth = 2\n[[material]]\nname = 'floor'\n\
             color = {ALBEDO}\n[[material]]\nname = 'lamp'\ncolor = 0.0\nemission = 1.0\n[[mesh]]\nshape = 'rectangle'\n\
             material = 'floor'\ntransform = {{ rotate = [-90.0, 0.0, 0.0], scale = {floor:?}, translate = [{o:?}, {o:?}, {o:?}] }}\n\
             [[mesh]]\nshape = 'rectangle'\nmaterial = 'lamp'\n\
             transform = {{ rotate = [90.0, 0.0, 0.0], scale = {a:?}, translate = {lamp:?} }}\n",
            o + h / 2.0,
            h / 100.0
        ));
        let q = a / a.hypot(h);
        let expected = ALBEDO / PI * 4.0 * q * q.atan();
        let (found, _) = mean_and_variance(&rendered(&scene));
        assert!(
            (found / expected - 1.0).abs() < tolerance,
            "{found}, expected {expected}: {a} at {h}, {o} from the origin"
        );
    }
}

/// Every sample meets the sun by its shadow ray, and the sky where the path leaves the scene.
#[test]
fn sun_and_sky_of_one_colour_leave_no_noise_on_open_ground() {
    let scene = Workplace::new().scene(
        "[film]\nwidth = 8\nheight = 8\n[camera]\nposition = [0.0, 0.0, 5.0]\ntarget = [0.0, 0.0, 0.0]\nfov = 10.0\n\
         [render]\nspp = 1\nmax_depth = 2\n[environment]\nradiance = 0.5\n[[light]]\ntype = 'directional'\n\
         direction = [0.0, -0.6, -0.8]\nirradiance = 3.0\n[[material]]\nname = 'ground'\ncolor = 0.5\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'ground'\n",
    );
    let expected = 0.5 * (0.5 + 3.0 * 0.8 / PI);
    for (i, pixel) in rendered(&scene).iter().enumerate() {
        let found = f64::from(pixel.mean[0]);
        assert!((found / expected - 1.0).abs() < 1e-5, "pixel {i}: {found}, expected {expected}");
    }
}

/// Ground under a sky of 1 whose sun, of 4 x 4 texels, brings as much light again, beside four triangles that hardly shine: those make lights
/// be chosen by a tree, and texels of so large a sky are told apart by the last digits of a word. From height `h` and extent `w`, one texel
/// of value v at the polar angle t brings v cos(t) sin(t) (2 pi / w) (pi / h) to the irradiance.
#[test]
fn the_sun_of_a_large_sky_shines_as_much_beside_lamps() {
    const WIDTH: u32 = 2048;
    const HEIGHT: u32 = 1024;
    let rows = 254..258;
    let share = |row: u32| {
        let polar = PI * (f64::from(row) + 0.5) / f64::from(HEIGHT);
        4.0 * polar.cos() * polar.sin() * 2.0 * PI / f64::from(WIDTH) * PI / f64::from(HEIGHT)
    };
    let sun = PI / rows.clone().map(share).sum::<f64>();
    let light = |x: u32, y: u32| if rows.contains(&y) && (700..704).contains(&x) { 1.0 + sun as f32 } else { 1.0 };
    let lamps: String = [-3.0, 3.0]
        .map(|x| {
            let place = format!("{{ scale = 0.01, translate = [{x:?}, 1.0, 0.0] }}");
            format!("[[mesh]]\nshape = 'rectangle'\nmaterial = 'lamp'\ntransform = {place}\n")
        })
        .concat();
    let scene = Workplace::new().sky("sky.exr", WIDTH, HEIGHT, light).scene(&format!(
        "[film]\nwidth = {SIDE}\nheight = {SIDE}\n[camera]\nposition = [0.0, 4.0, 0.0]\ntarget = [0.0, 0.0, 0.0]\n\
         up = [0.0, 0.0, -1.0]\nfov = 40.0\n[render]\nspp = 64\nmax_depth = 2\n[environment]\nfile = 'sky.exr'\n\
         [[material]]\nname = 'lamp'\nemission = 0.001\n[[material]]\nname = 'ground'\ncolor = {ALBEDO}\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'ground'\ntransform = {{ rotate = [-90.0, 0.0, 0.0], scale = 5.0 }}\n\
         {lamps}"
    ));
    assert!(scene.has_light_tree());
    let (mean, variance) = mean_and_variance(&rendered(&scene));
    let error = (variance / f64::from(64 * SIDE * SIDE)).sqrt();
    println!("mean {mean} to {error}");
    assert!(error < 0.005, "{error}");
    assert!((mean - 2.0 * ALBEDO).abs() < 4.0 * error, "{mean} to {error}");
}

/// A cube whose twelve triangles shine with 1 and reflect half: each point shows 1 + 1/2, since light comes to it from all of its
/// hemisphere. The cosine alone chooses directions that all bring the same, and light samples of lamps nearby must not outweigh them.
#[test]
fn a_box_that_shines_all_round_has_little_noise() {
    let scene = Workplace::new().scene(
        "[film]\nwidth = 32\nheight = 32\n[camera]\nposition = [0.2, -0.1, 0.3]\ntarget = [0.0, 0.0, -1.0]\nfov = 90.0\n\
         [render]\nspp = 64\nmax_depth = 2\n[[material]]\nname = 'wall'\ncolor = 0.5\nemission = 1.0\n\
         [[mesh]]\nshape = 'cube'\nflip_normals = true\nmaterial = 'wall'\n",
    );
    assert!(scene.has_light_tree());
    let (mean, variance) = mean_and_variance(&rendered(&scene));
    println!("mean {mean}, variance of a sample {variance}");
    assert!((mean - 1.5).abs() < 2e-3 && variance < 0.015, "{mean}, {variance}");
}
