//! Compares the CPU twins of exact spheres with 64-bit arithmetic, fine meshes and closed forms.
use crate::support::largest;
use crate::twin::*;
use glam::{DVec3, Vec3, vec3};
use tallow::layout::{LIGHT_SPHERE, LIGHT_TRIANGLE, NONE, SPHERE};
use tallow::scene::{Loaded, Scene};
use tallow::twins::path::Strategy;
use tallow::twins::surface::{Surface, surface_at};
use tallow::twins::traverse::{Hit, traverse, traverse_from};

const FAR: f32 = 3e38;

fn closest(scene: &Loaded, origin: Vec3, direction: Vec3) -> Hit {
    traverse(scene, origin, direction, FAR, false, 0)
}

/// Distance along a unit direction to the nearest of all spheres, in 64 bits; `None` where a graze is too near to tell.
fn nearest(scene: &Loaded, origin: Vec3, direction: Vec3) -> Option<f64> {
    let (origin, direction) = (origin.as_dvec3(), direction.as_dvec3().normalize());
    let mut best = f64::INFINITY;
    for t in &scene.triangles {
        let [centre, pole] = [t.v0, t.v1].map(|v| DVec3::from(v.map(f64::from)));
        let (from, r) = (origin - centre, pole.length());
        let along = from.dot(direction);
        let squared = r * r - (from - along * direction).length_squared();
        if squared.abs() < 1e-4 * r * r || (from.length() / r - 1.0).abs() < 1e-4 {
            return None;
        }
        let roots = [-1.0, 1.0].map(|side| -along + side * squared.max(0.0).sqrt());
        best = roots.into_iter().filter(|&t| squared > 0.0 && t > 0.0).fold(best, f64::min);
    }
    Some(best)
}

/// Rays whose hit is elsewhere than in 64 bits, and rays that hit.
fn misjudged(scene: &Loaded) -> (usize, usize) {
    let mut random = Random::new(5);
    let (mut wrong, mut hits) = (0, 0);
    for _ in 0..20_000 {
        let (origin, direction) = (3.0 * random.point(), random.point().normalize());
        let Some(t) = nearest(scene, origin, direction) else { continue };
        let hit = closest(scene, origin, direction);
        hits += usize::from(hit.any());
        let shadowed = |t: f64| traverse(scene, origin, direction, t as f32, true, 0).any();
        let right = match t.is_finite() {
            true => (f64::from(hit.t) / t - 1.0).abs() < 1e-4 && shadowed(1.001 * t) && !shadowed(0.999 * t),
            false => !hit.any(),
        };
        wrong += usize::from(!right);
    }
    (wrong, hits)
}

#[test]
fn rays_meet_spheres_where_they_are() {
    let mut random = Random::new(3);
    let ball = |_| {
        let [x, y, z] = (2.0 * random.point()).to_array();
        let radius = 0.5 * random.unit().powi(3) + 1e-3;
        format!("[[mesh]]\nshape = 'sphere'\ntransform = {{ scale = {radius}, translate = [{x}, {y}, {z}] }}\n")
    };
    let mut scene = Workplace::new().scene(&(0..200).map(ball).collect::<String>());
    assert!(scene.triangles.len() == 200 && scene.triangles.iter().all(|t| t.primitive & SPHERE != 0));
    scene.check().unwrap();
    let (wrong, hits) = misjudged(&scene);
    assert!(wrong == 0 && hits > 4000, "{wrong} of {hits}");
    scene.nodes.iter_mut().for_each(|n| n.p[0] += 0.05);
    assert!(misjudged(&scene).0 > 100, "control: boxes beside their spheres");
}

const PLACES: [&str; 6] = [
    "{ scale = 1.5 }",
    "{ rotate = [20.0, 40.0, 60.0], translate = [0.3, -0.2, 0.5] }",
    "{ scale = [-1.0, 1.0, 1.0], rotate = [20.0, 40.0, 60.0] }",
    "{ scale = [1.0, 1.0, -0.7], translate = [0.3, -0.2, 0.5] }",
    "{ scale = [1.0, 0.3, 0.6], rotate = [20.0, 40.0, 60.0] }",
    "{ scale = [-0.2, 1.0, 1.4], rotate = [70.0, 10.0, 30.0], translate = [0.3, -0.2, 0.5] }",
];

/// One ball: placed, or an instance that is placed once more; with a texture and a height map, so that all of it is asked.
fn placed(place: &str, instance: bool, more: &str) -> Loaded {
    let picture = Workplace::new().picture("p.png", 8, |x, y| [(20 * x + 8 * y) as u8, 0, 0]);
    let material = "[[material]]\nname = 'm'\ncolor_texture = 'p.png'\nbump = 'p.png'\nbump_scale = 0.2\n";
    let copy = "[[instance]]\nmesh = 'b'\ntransform = { scale = [0.6, 1.0, -0.8], rotate = [10.0, 0.0, 50.0] }\n";
    let copy = if instance { copy } else { "" };
    picture.scene(&format!(
        "{material}[[mesh]]\nname = 'b'\nshape = 'sphere'\nmaterial = 'm'\n{more}\ntransform = {place}\n{copy}"
    ))
}

/// Largest differences between the surfaces that rays meet: in position, normal, mapped normal and texture coordinates.
fn apart(exact: &Loaded, mesh: &Loaded) -> [f32; 4] {
    let mut random = Random::new(9);
    let (mut worst, mut met) = ([0f32; 4], 0);
    for i in 0..6000 {
        let origin = if i % 3 == 0 { 0.1 * random.point() } else { 4.0 * random.point() };
        let direction = (0.5 * random.point() - origin).normalize();
        let [a, b] = [exact, mesh].map(|scene| closest(scene, origin, direction));
        if !a.any() || !b.any() {
            continue;
        }
        let [a, b]: [Surface; 2] = [surface_at(exact, &a), surface_at(mesh, &b)];
        // Beside grazes, the seam and the poles.
        if a.geometric.dot(direction).abs() < 0.3 || !(0.02..0.98).contains(&a.uv.x) || !(0.1..0.9).contains(&a.uv.y) {
            continue;
        }
        met += 1;
        assert!(a.geometric.dot(direction).signum() == b.geometric.dot(direction).signum(), "{a:?} {b:?}");
        let off = [a.position.distance(b.position), a.smooth_normal.distance(b.smooth_normal)];
        let all = [off[0], off[1], a.normal.distance(b.normal), a.uv.distance(b.uv)];
        (0..4).for_each(|k| worst[k] = largest([worst[k], all[k]]));
    }
    assert!(met > 500, "{met} met");
    worst
}

#[test]
fn spheres_are_what_fine_meshes_approach() {
    for (i, place) in PLACES.iter().enumerate() {
        for more in ["", "flip_normals = true"] {
            for instance in [false, true] {
                // Each place once as it is and once turned inside out, the last in all ways: fine meshes take long.
                if i < PLACES.len() - 1 && instance != (more.is_empty() == (i % 2 == 0)) {
                    continue;
                }
                let exact = placed(place, instance, more);
                // The last is the flattest, whose normals turn most from one facet to the next.
                let segments = if i < PLACES.len() - 1 { 256 } else { 384 };
                let mesh = placed(place, instance, &format!("{more}\nsegments = {segments}"));
                assert_eq!(
                    (exact.triangles.len(), exact.instances.len()),
                    (1, usize::from(instance || i > 2)),
                    "{place}"
                );
                let [position, normal, mapped, uv] = apart(&exact, &mesh);
                let said = format!("{place} {more} {instance}: {position} {normal} {mapped} {uv}");
                assert!(position < 1e-3 && normal < 3e-3 && mapped < 0.05 && uv < 1e-3, "{said}");
            }
        }
    }
    let (mut mirrored, mesh) = (placed(PLACES[2], false, ""), placed(PLACES[2], false, "segments = 256"));
    mirrored.triangles[0].primitive &= SPHERE;
    assert!(apart(&mirrored, &mesh)[3] > 0.5, "control: texture coordinates that are not mirrored");
}

/// Rays from points of a sphere that meet it although they leave it, or miss the far side, at the right distance.
fn self_hits(centre: Vec3, radius: f32, error: f32) -> usize {
    let [x, y, z] = centre.to_array();
    let scene = Workplace::new().scene(&format!(
        "[[mesh]]\nshape = 'sphere'\ntransform = {{ scale = {radius:e}, translate = [{x:e}, {y:e}, {z:e}] }}\n"
    ));
    let (mut random, mut wrong) = (Random::new(2), 0);
    for _ in 0..5000 {
        let origin = centre + 3.0 * radius * random.point().normalize();
        let hit = closest(&scene, origin, (centre - origin + 0.9 * radius * random.point()).normalize());
        if !hit.any() {
            continue;
        }
        let (s, w) = (surface_at(&scene, &hit), random.point().normalize());
        let w = if w.dot(s.geometric) < 0.0 { -w } else { w };
        let leave = |w: Vec3| traverse_from(&scene, [0, NONE], s.ray_origin(w), w, 0);
        let plain = traverse_from(&scene, [NONE; 2], s.ray_origin(w), w, 0);
        let (out, through, cosine) = (leave(w), leave(-w), w.dot(s.geometric));
        let chord = (through.t / (2.0 * radius * cosine) - 1.0).abs();
        wrong += usize::from(out.any() || plain.any() || cosine > 0.2 && !(through.any() && chord < error));
    }
    wrong
}

#[test]
fn spheres_of_any_size_anywhere_do_not_meet_themselves() {
    for (centre, radius, error) in [
        (Vec3::ZERO, 1.0, 1e-5),
        (Vec3::ZERO, 1e-6, 1e-5),
        (Vec3::ZERO, 1e-12, 1e-5),
        (Vec3::ZERO, 1e9, 1e-5),
        (vec3(0.4, -0.7, 0.6), 1e-3, 0.01),
        (vec3(1e3, -2e3, 500.0), 1.0, 0.02),
        // A number of 10^6 has 1/16 for its last place.
        (vec3(1e6, 1e6, -1e6), 30.0, 0.5),
    ] {
        assert_eq!(self_hits(centre, radius, error), 0, "{centre} {radius:e}");
    }
    assert!(self_hits(Vec3::ZERO, 1.0, 1e-8) > 0, "control: no rounding at all");
}

/// A floor of albedo 1/2 below a lamp of radius `radius`, seen from beside; one pixel at the foot of the lamp.
fn lamp_over_floor(lamp: &str, more: &str) -> Loaded {
    Workplace::new().scene(&format!(
        "[film]\nwidth = 2\nheight = 2\nfilter = 'point'\n[camera]\nposition = [4.0, 0.5, 0.0]\ntarget = [0.0, 0.0, 0.0]\n\
         fov = 0.01\n[render]\nmax_depth = 2\n[[material]]\nname = 'lamp'\ncolor = 0.0\nemission = 3.0\n\
         [[material]]\nname = 'floor'\ncolor = 0.5\n[[mesh]]\nshape = 'rectangle'\nmaterial = 'floor'\n\
         transform = {{ rotate = [-90.0, 0.0, 0.0], scale = 5.0 }}\n\
         [[mesh]]\nname = 'l'\nshape = 'sphere'\nmaterial = 'lamp'\ntransform = {lamp}\n{more}"
    ))
}

#[test]
fn a_sphere_lamp_lights_by_the_square_of_its_sine() {
    // The irradiance of a facing plane is pi L (r / d)^2: uniform in the cone, the cosine is all that varies.
    let instance = "[[instance]]\nmesh = 'l'\ntransform = { translate = [0.0, 2.0, 0.0], scale = [-2.0, 2.0, 2.0] }\n";
    for (radius, lamp, more) in [
        (1.5, "{ scale = 1.5, translate = [0.0, 2.0, 0.0] }", ""),
        (0.2, "{ scale = 0.2, translate = [0.0, 2.0, 0.0] }", ""),
        (1e-3, "{ scale = 0.001, translate = [0.0, 2.0, 0.0] }", ""),
        (0.6, "{ scale = 0.3 }", instance),
    ] {
        let scene = lamp_over_floor(lamp, more);
        assert!(scene.lights.len() == 1 && scene.lights[0].kind == LIGHT_SPHERE, "{:?}", scene.lights);
        scene.check().unwrap();
        let exact = 3.0 * 0.5 * f64::powi(radius / 2.0, 2);
        let light = mean(&scene, Strategy::Light, 4000);
        assert!(light.is(exact) && light.error < 0.01 * exact, "{radius}: {light:?}, exact {exact}");
        let both = mean(&scene, Strategy::Both, 4000);
        assert!(both.is(exact) && both.error < 0.02 * exact, "{radius}: {both:?}, exact {exact}");
        if radius > 0.1 {
            let bsdf = mean(&scene, Strategy::Bsdf, 20_000);
            assert!(bsdf.is(exact), "{radius}: {bsdf:?}, exact {exact}");
        }
        let mut off = scene.clone();
        off.lights[0].b[0] *= 1.05;
        let control = mean(&off, Strategy::Light, 4000);
        assert!(!control.is(exact) || radius < 1.0, "control: a cone that is too wide, {control:?}");
        let mut off = scene;
        off.lights[0].probability = 0.9;
        assert!(!mean(&off, Strategy::Light, 4000).is(exact), "control: a density that is too small");
    }
}

/// Lights by kind of a scene's only lamp.
fn kinds(scene: &Loaded) -> [usize; 2] {
    [LIGHT_SPHERE, LIGHT_TRIANGLE].map(|kind| scene.lights.iter().filter(|l| l.kind == kind).count())
}

#[test]
fn lamps_that_no_cone_samples_are_tessellated() {
    let even = "{ scale = 0.5 }";
    assert_eq!(kinds(&lamp_over_floor(even, "")), [1, 0]);
    let meshes = [
        ("{ scale = [0.5, 0.5, 0.6] }", ""),
        (even, "flip_normals = true\n"),
        (even, "segments = 64\n"),
        (even, "flat = true\n"),
        (even, "[[instance]]\nmesh = 'l'\ntransform = { scale = [1.0, 1.0, 1.5] }\n"),
    ];
    for (lamp, more) in meshes {
        assert_eq!(kinds(&lamp_over_floor(lamp, more)), [0, 64 * 2 * 31], "{lamp} {more}");
    }
    // Two copies, of which one alone is stretched: both are, for they share what is stored.
    let both = "[[instance]]\nmesh = 'l'\n[[instance]]\nmesh = 'l'\ntransform = { scale = [1.0, 1.0, 1.5] }\n";
    assert_eq!(kinds(&lamp_over_floor(even, both)), [0, 2 * 64 * 2 * 31]);
}

/// A ball of which half lets half of all rays through at either side, in front of light.
#[test]
fn masks_are_asked_on_either_side_of_a_sphere() {
    let scene = |opacity: f32| {
        Workplace::new().scene(&format!(
            "[film]\nwidth = 8\nheight = 8\n[camera]\nposition = [0.0, 0.0, 4.0]\ntarget = [0.0, 0.0, 0.0]\nfov = 10.0\n\
             [render]\nmax_depth = 1\n[environment]\nradiance = 1.0\n[[material]]\nname = 'm'\nopacity = {opacity}\n\
             [[mesh]]\nshape = 'sphere'\nmaterial = 'm'\n"
        ))
    };
    let through = mean(&scene(0.5), Strategy::Both, 1000);
    assert!(through.is(0.25), "{through:?}");
    assert!(!mean(&scene(0.55), Strategy::Both, 1000).is(0.25), "control: another opacity");
}

/// By reflection and refraction alone: what enters a glass ball leaves it.
#[test]
fn a_glass_ball_keeps_no_light() {
    let scene = |depth: u32| {
        Workplace::new().scene(&format!(
            "[film]\nwidth = 16\nheight = 16\n[camera]\nposition = [0.0, 0.0, 4.0]\ntarget = [0.0, 0.0, 0.0]\nfov = 40.0\n\
             [render]\nmax_depth = {depth}\n[environment]\nradiance = 1.0\n[[material]]\nname = 'glass'\n\
             type = 'dielectric'\nior = 1.5\n[[mesh]]\nshape = 'sphere'\nmaterial = 'glass'\n"
        ))
    };
    let glass = mean(&scene(64), Strategy::Both, 64);
    assert!((glass.mean - 1.0).abs() < 1e-5 && glass.error < 1e-5, "{glass:?}");
    assert!((mean(&scene(4), Strategy::Both, 64).mean - 1.0).abs() > 1e-3, "control: paths that are cut");
}

#[test]
fn radii_are_refused_where_numbers_end() {
    let load = |place: &str| {
        let text = format!("[environment]\n[[mesh]]\nshape = 'sphere'\ntransform = {place}\n");
        Scene::parse(std::path::Path::new("s.toml"), &text)
    };
    assert!(load("{ scale = 2e12 }").unwrap_err().to_string().contains("the limit is 1e12"));
    assert!(load("{ scale = 9e11, translate = [2e11, 0, 0] }").is_err());
    let scene = load("{ scale = 1e-16 }").unwrap();
    assert!(scene.triangles.is_empty() && scene.warnings.iter().any(|w| w.contains("without area")), "{scene:?}");
    assert_eq!(load("{ scale = 1e11 }").unwrap().triangles.len(), 1);
}

/// By scattering alone every path of a white ball carries 1, also at the rim, where facets of a mesh hide the sky.
#[test]
fn a_white_ball_vanishes_in_a_white_sky() {
    let scene = |more: &str| {
        Workplace::new().scene(&format!(
            "[film]\nwidth = 24\nheight = 24\n[camera]\nposition = [0.0, 0.0, 4.0]\ntarget = [0.0, 0.0, 0.0]\nfov = 35.0\n\
             [render]\nmax_depth = 4\n[environment]\nradiance = 1.0\n[[material]]\nname = 'white'\ncolor = 1.0\n\
             [[mesh]]\nshape = 'sphere'\nmaterial = 'white'\n{more}"
        ))
    };
    for place in ["", "transform = { scale = [1.0, 0.7, 1.2], rotate = [20.0, 40.0, 60.0] }\n"] {
        let white = mean(&scene(place), Strategy::Bsdf, 64);
        assert!((white.mean - 1.0).abs() < 1e-6 && white.error < 1e-7, "{place} {white:?}");
    }
    let mesh = mean(&scene("segments = 64\n"), Strategy::Bsdf, 64);
    assert!(mesh.mean < 1.0 - 1e-5, "control: a mesh loses light at its rim, {mesh:?}");
}
