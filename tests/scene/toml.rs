//! Tests scene files end to end: the arrays that they become, and the messages about mistakes.
use image::codecs::png::PngEncoder;
use std::fs::File;
use std::path::Path;
use tallow::image::{Film, Picture, WriteOptions, write};
use tallow::layout::*;
use tallow::scene::{Loaded, Scene, effects};
use tallow::twins::texture::texture_sample;

const BOX: &str = "
[film]
width = 32
height = 16
[camera]
position = [0, 0, 5]
target = [0, 0, 0]
[render]
spp = 4
max_depth = 2
[[material]]
name = \"wall\"
color = [0.1, 0.2, 0.3]
[[material]]
name = \"lamp\"
emission = 5
[[mesh]]
name = \"floor\"
shape = \"rectangle\"
material = \"wall\"
[[mesh]]
name = \"lamp\"
shape = \"rectangle\"
transform = { translate = [0, 0, 2], scale = 0.5 }
material = \"lamp\"
";

fn parse(text: &str) -> tallow::error::Result<Loaded> {
    Scene::parse(Path::new("scene.toml"), text)
}

fn error(text: &str) -> String {
    let found = parse(text).unwrap_err();
    assert_eq!(found.exit_code(), 3);
    assert!(!found.to_string().contains('\n'), "one line: {found}");
    found.to_string()
}

#[test]
fn a_small_scene_becomes_arrays() {
    let scene = parse(BOX).unwrap();
    assert_eq!((scene.settings.width, scene.settings.spp), (32, 4));
    assert_eq!((scene.triangles.len(), scene.shading.len(), scene.instances.len()), (4, 0, 0));
    assert_eq!(scene.bounds, [[-1.0, -1.0, 0.0], [1.0, 1.0, 2.0]]);
    assert_eq!(scene.names.objects, ["floor", "lamp"]);
    let shape = |size| scene.camera(size).map(|camera| camera.right[0] / camera.up[1]).unwrap();
    assert_eq!([shape([32, 16]), shape([64, 16])], [2.0, 4.0], "the camera follows the film");
    assert_eq!((scene.lights.len(), scene.warnings.len()), (2, 0));
    let (found, why) = effects(&scene, &scene.settings, false, false);
    let expected = Effects { diffuse: true, emissive: true, large_lamps: true, soft_light: true, ..Effects::default() };
    assert_eq!(found, expected);
    assert_eq!(why[1].1, "material \"lamp\"");
}

#[test]
fn the_fingerprint_is_that_of_what_is_seen() {
    let more = "
[[mesh]]\nname = \"ball\"\nshape = \"sphere\"\nsegments = 24
[[instance]]\nmesh = \"ball\"\ntransform = { translate = [1, 2, 3] }
[[instance]]\nmesh = \"ball\"\ntransform = { translate = [3, 2, 1] }
[[light]]\ntype = \"point\"\nposition = [0, 1, 1]\nintensity = 3
[environment]\nradiance = 0.1";
    let text = format!("{BOX}{more}");
    let of = |text: &str| {
        let Loaded { scene, settings, .. } = parse(text).unwrap();
        scene.fingerprint(settings.size()).unwrap()
    };
    for threads in [1, 2, 5] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(pool.install(|| of(&text)), of(&text), "by {threads} threads");
    }
    let edited = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        of(&text.replacen(from, to, 1))
    };
    let seen = [
        ("position = [0, 0, 5]", "position = [0, 0, 5.1]"),
        ("width = 32", "width = 33"), // the camera's aspect
        ("0.2, 0.3]", "0.2, 0.31]"),
        ("emission = 5", "emission = 5.1"),
        ("shape = \"rectangle\"", "shape = \"disk\""),
        ("scale = 0.5", "scale = 0.51"),
        ("material = \"wall\"", "material = \"lamp\""),
        ("segments = 24", "segments = 25"),
        ("[3, 2, 1]", "[3, 2, 1.1]"),
        ("mesh = \"ball\"", "mesh = \"lamp\""),
        ("position = [0, 1, 1]", "position = [0, 1, 1.1]"),
        ("intensity = 3", "intensity = 3.1"),
        ("radiance = 0.1", "radiance = 0.11"),
    ];
    let found: std::collections::HashSet<_> = seen.iter().map(|(from, to)| edited(from, to).to_string()).collect();
    assert_eq!(found.len(), seen.len());
    assert!(!found.contains(&of(&text).to_string()));
    for (from, to) in [("spp = 4", "spp = 5"), ("name = \"floor\"", "name = \"ground\"")] {
        assert_eq!(edited(from, to), of(&text), "{to}");
    }
}

/// As PNG; the picture's own `save` would compile every encoder.
fn save(picture: &image::RgbImage, path: &Path) {
    picture.write_with_encoder(PngEncoder::new(File::create(path).unwrap())).unwrap();
}

#[test]
fn a_texel_counts() {
    let folder = tempfile::tempdir().unwrap();
    let of = |blue: u8| {
        let picture = image::RgbImage::from_raw(2, 1, vec![1, 2, 3, 4, 5, blue]).unwrap();
        save(&picture, &folder.path().join("a.png"));
        let text = BOX.replacen("color = [0.1, 0.2, 0.3]", "color_texture = \"a.png\"", 1);
        let scene = Scene::parse(&folder.path().join("scene.toml"), &text).unwrap();
        assert_eq!(scene.texels.len(), 2);
        scene.fingerprint([32, 16]).unwrap()
    };
    assert_eq!(of(6), of(6));
    assert_ne!(of(6), of(7));
}

/// Area of a light's triangle.
fn area(l: &Light) -> f32 {
    let [a, b, c] = [l.a, l.b, l.c].map(glam::Vec3::from);
    (b - a).cross(c - a).length() / 2.0
}

#[test]
fn one_constant_turns_emission_into_the_density_of_every_emissive_triangle() {
    let more = "
[[material]]\nname = \"blue\"\nemission = [0, 0, 0.3]
[[mesh]]\nshape = \"sphere\"\nmaterial = \"blue\"\nsegments = 24
[[light]]\ntype = \"point\"\nposition = [0, 1, 1]\nintensity = 3
[[light]]\ntype = \"spot\"\nposition = [0, 1, 1]\ntarget = [0, 0, 0]\nintensity = [1, 2, 3]
[[light]]\ntype = \"directional\"\ndirection = [0, -1, 0]\nirradiance = 1
[environment]\nradiance = 0.1";
    let scene = parse(&format!("{BOX}{more}")).unwrap();
    let (mut triangles, mut sum) = (0, 0.0);
    for l in &scene.lights {
        sum += f64::from(l.probability);
        if l.kind == LIGHT_TRIANGLE {
            triangles += 1;
            let weight = scene.materials[l.material as usize].emission_weight;
            let ratio = l.probability / area(l) / (weight * scene.triangle_pdf_scale);
            assert!((ratio - 1.0).abs() < 2e-5, "{ratio}");
        }
    }
    assert_eq!((triangles, scene.lights.len() - triangles), (2 + 24 * 22, 4));
    assert!((sum - 1.0).abs() < 1e-5);
    // The lamp: 2 triangles of 0.5 square units and radiance 5, so pi * 0.5 * 5 W each; the point light 4 pi * 3 W, which counts
    // eight times since BSDF samples do not find it.
    let by_kind = |kind| scene.lights.iter().find(|l| l.kind == kind).unwrap();
    let lamp = scene.lights.iter().find(|l| l.value == [5.0; 3]).unwrap();
    assert!((by_kind(LIGHT_POINT).probability / lamp.probability - 8.0 * 12.0 / 2.5).abs() < 1e-3);
    assert_eq!(by_kind(LIGHT_DIRECTIONAL).b, [0.0, -1.0, 0.0]);
}

#[test]
fn one_of_several_lights_without_extent_is_noisy_and_one_alone_is_not() {
    let light = |watts: f32| format!("[[light]]\ntype = \"point\"\nposition = [0, 1, 1]\nintensity = {watts}\n");
    let scene = |lights: &[f32], more: &str| {
        let lights: String = lights.iter().map(|&watts| light(watts)).collect();
        parse(&format!("[camera]\nposition = [0, 0, 5]\n{lights}[[mesh]]\nshape = \"rectangle\"\n{more}")).unwrap()
    };
    assert!(!scene(&[1.0], "").has_soft_lights());
    assert!(scene(&[1.0, 1.0], "").has_soft_lights());
    assert!(
        scene(&[1.0, 0.0], "").has_soft_lights() && scene(&[0.0, 0.0], "").has_soft_lights(),
        "they may come to shine"
    );
    assert!(scene(&[1.0], "[environment]\nradiance = 1\n").has_soft_lights());
}

/// The power of a sky grows with the ground, while a lamp is as bright near itself; a sky in which a lamp outshines all is not forgotten either.
#[test]
fn neither_lamps_nor_lights_at_infinity_are_chosen_by_hardly_any_sample() {
    let scene = |scale: f32, sky: f32, sun: f32| {
        let ground = format!("[[mesh]]\nshape = \"rectangle\"\ntransform = {{ scale = {scale} }}\n");
        let sun = format!("[[light]]\ntype = \"directional\"\ndirection = [0, 0, -1]\nirradiance = {sun}\n");
        parse(&format!("{BOX}{ground}{}[environment]\nradiance = {sky}", if scale > 1.0 { &sun } else { "" })).unwrap()
    };
    let near = |l: &Light| matches!(l.kind, LIGHT_TRIANGLE | LIGHT_POINT);
    let share = |scene: &Loaded| scene.lights.iter().filter(|l| near(l)).map(|l| l.probability).sum::<f32>();
    let close = |a: f32, b: f32| (a - b).abs() < 1e-5;
    assert!(close(share(&scene(1e4, 0.1, 1.0)), 0.25) && close(share(&scene(1.0, 1e-6, 0.0)), 0.75));
    assert!(close(share(&scene(1e4, 0.1, 0.0)), 0.5), "beside a sky alone");
    let even = share(&scene(1.0, 0.1, 0.0));
    assert!((0.55..0.7).contains(&even), "control: shares between are as power has them: {even}");
    // Among those at infinity power decides, and the density of lamps follows.
    let wide = scene(1e4, 0.1, 1.0);
    let [sun, sky] = [LIGHT_DIRECTIONAL, LIGHT_ENVIRONMENT]
        .map(|kind| wide.lights.iter().find(|l| l.kind == kind).unwrap().probability);
    assert!((sun / sky / (8.0 * 1.0 / (4.0 * std::f32::consts::PI * 0.1)) - 1.0).abs() < 1e-4, "{sun} {sky}");
    for l in wide.lights.iter().filter(|l| l.kind == LIGHT_TRIANGLE) {
        let density = wide.materials[l.material as usize].emission_weight * wide.triangle_pdf_scale;
        assert!((l.probability / area(l) / density - 1.0).abs() < 2e-5);
    }
}

/// A sun in a picture is found by light sampling alone, as a directional light is: what it has above 16 times the mean counts eight times. A
/// texel of row y of h takes a share (cos(pi y / h) - cos(pi (y + 1) / h)) / (2 w) of the sphere.
#[test]
fn a_sun_in_a_sky_s_picture_is_chosen_as_often_as_one_beside_it() {
    use std::f64::consts::PI;
    let folder = tempfile::tempdir().unwrap();
    let chances = |sun: f64| {
        let mut pixels = vec![[1.0; 3]; 64 * 32];
        pixels[10 * 64 + 5] = [sun as f32; 3];
        let film = Film::from(&Picture { width: 64, height: 32, pixels });
        write(&folder.path().join("sky.exr"), &film, &WriteOptions::default()).unwrap();
        let text = "[camera]\nposition = [0, 0, 5]\n[[mesh]]\nshape = \"rectangle\"\n[environment]\nfile = \"sky.exr\"\n\
                    [[light]]\ntype = \"directional\"\ndirection = [0, 0, -1]\nirradiance = 1\n";
        let scene = Scene::parse(&folder.path().join("scene.toml"), text).unwrap();
        let [sun, sky] = [LIGHT_DIRECTIONAL, LIGHT_ENVIRONMENT]
            .map(|kind| f64::from(scene.lights.iter().find(|l| l.kind == kind).unwrap().probability));
        sky / sun
    };
    let texel = ((PI * 10.0 / 32.0).cos() - (PI * 11.0 / 32.0).cos()) / 128.0;
    for sun in [10.0, 1000.0, 30000.0] {
        let mean = 1.0 + texel * (sun - 1.0);
        let peaks = texel * (sun - 16.0 * mean).max(0.0) / mean;
        let expected = 4.0 * PI * mean * (1.0 + 7.0 * peaks) / 8.0;
        let found = chances(sun);
        assert!((found / expected - 1.0).abs() < 1e-3, "{sun}: {found}, expected {expected}");
    }
}

#[test]
fn a_sky_of_one_colour_beside_suns_alone_is_left_to_bsdf_sampling() {
    let chances = |sun: f32, more: &str| {
        let sun = format!("[[light]]\ntype = \"directional\"\ndirection = [0, 0, -1]\nirradiance = {sun}\n");
        let ground = "[camera]\nposition = [0, 0, 5]\n[[mesh]]\nshape = \"rectangle\"\n[environment]\nradiance = 0.1\n";
        let scene = parse(&format!("{ground}{sun}{more}")).unwrap();
        [LIGHT_DIRECTIONAL, LIGHT_ENVIRONMENT]
            .map(|kind| scene.lights.iter().find(|l| l.kind == kind).map(|l| l.probability))
    };
    assert_eq!(chances(1.0, ""), [Some(1.0), Some(0.0)]);
    assert_eq!(chances(0.0, ""), [None, Some(1.0)], "a sun that is dark");
    let lamp = "[[light]]\ntype = \"point\"\nposition = [0, 0, 1]\nintensity = 1\n";
    assert!(chances(1.0, lamp)[1] > Some(0.0), "control: beside a lamp");
}

#[test]
fn a_smooth_pane_that_stops_a_lamp_without_extent_is_named() {
    let told = |more: &str| {
        let pane =
            "[[material]]\nname = \"pane\"\ntype = \"metallic-roughness\"\nmetallic = 0\ntransmission_factor = 1\n";
        let glass = "[[mesh]]\nshape = \"rectangle\"\nmaterial = \"pane\"\n";
        let scene = parse(&format!("{BOX}{glass}{pane}{more}")).unwrap();
        scene.warnings.iter().any(|line| line.starts_with("material \"pane\" is smooth, transmits"))
    };
    let sun = "[[light]]\ntype = \"directional\"\ndirection = [0, 0, -1]\nirradiance = 1\n";
    let coat = "clearcoat = 1\n";
    assert!(told(&format!("roughness = 0\n{coat}{sun}")), "it stops the sun");
    assert!(!told(&format!("roughness = 0.3\n{coat}{sun}")) && !told(&format!("roughness = 0\n{coat}")));
    assert!(!told(&format!("roughness = 0\ncolor = [0.9, 0.5, 0.5]\n{sun}")), "without a coat it passes");
}

#[test]
fn small_dim_lamps_have_a_density() {
    let small =
        BOX.replace("emission = 5", "emission = 1e-15").replace("translate = [0, 0, 2]", "translate = [0, 0, 2e-12]");
    let small = small.replace("scale = 0.5", "scale = 5e-13").replace("[0, 0, 5]", "[0, 0, 5e-12]");
    let scene = parse(&small.replacen("\"rectangle\"", "\"rectangle\"\ntransform = { scale = 1e-12 }", 1)).unwrap();
    assert_eq!(scene.lights.len(), 2);
    for l in &scene.lights {
        let [a, b, c] = [l.a, l.b, l.c].map(|p| glam::Vec3::from(p) * 1e12);
        let area = (b - a).cross(c - a).length() / 2.0 * 1e-24;
        let density = scene.materials[l.material as usize].emission_weight * scene.triangle_pdf_scale;
        assert!((l.probability / area / density - 1.0).abs() < 2e-5, "{l:?} {density}");
    }
}

#[test]
fn lamps_in_the_same_place_are_one_light() {
    let scene = |more: &str| parse(&format!("{BOX}{more}")).unwrap();
    let placed = |moving: bool, second: &str| {
        let one = "[[instance]]\nmesh = \"a\"\ntransform = { rotate = [0, 40, 0], translate = [5, 0, 0] }\n";
        let mesh = "[[mesh]]\nname = \"a\"\nshape = \"rectangle\"\nmaterial = \"lamp\"\n";
        scene(&format!("{mesh}{}\n{one}{}", if moving { "moving = true" } else { "" }, one.replace("5, 0, 0]", second)))
    };
    let lamp = "[[mesh]]\nshape = \"rectangle\"\nmaterial = \"lamp\"\n";
    let more = |s: &Loaded| s.lights.len() - 2;
    for moving in [false, true] {
        let found = placed(moving, "5, 0, 0]");
        assert_eq!((found.instances.iter().filter(|i| i.world0[3] == 5.0).count(), more(&found)), (2, 2));
        assert!((found.lights[2].probability / found.lights[0].probability - 4.0).abs() < 1e-4);
        assert_eq!(more(&placed(moving, "5, 0, 1e-6]")), 4, "control: beside it");
        found.check().unwrap();
    }
    assert_eq!(more(&scene(&format!("{lamp}{lamp}"))), 2, "meshes");
    // The other side shines too, and so does a lamp of another material, of which rays may meet either.
    assert_eq!(more(&scene(&format!("{lamp}{lamp}flip_normals = true"))), 4, "control: back to back");
    // A sphere is one.
    let ball = "[[mesh]]\nshape = \"sphere\"\nmaterial = \"lamp\"\n";
    assert_eq!(more(&scene(&format!("{ball}{ball}"))), 1);
    // Point lights are not surfaces: both of them shine.
    let point = "[[light]]\ntype = \"point\"\nposition = [0, 1, 1]\nintensity = 3\n";
    assert_eq!(more(&scene(&format!("{point}{point}"))), 2);
}

#[test]
fn instances_make_two_levels_and_carry_their_lights() {
    let more = "
[[mesh]]\nname = \"ball\"\nshape = \"sphere\"\nsegments = 8\nmaterial = \"lamp\"
[[instance]]\nmesh = \"ball\"\ntransform = { translate = [5, 0, 0] }
[[instance]]\nmesh = \"ball\"\ntransform = { translate = [-5, 0, 0], scale = [-1, 1, 1] }
[[instance]]\nmesh = \"ball\"\nmaterial = \"wall\"";
    let scene = parse(&format!("{BOX}{more}")).unwrap();
    assert_eq!((scene.instances.len(), scene.triangles.len()), (4, 4 + 48), "three balls share their triangles");
    assert_eq!(scene.instances.iter().filter(|i| i.mirrored == 1).count(), 1);
    assert_eq!(scene.names.objects.len(), 2 + 3);
    let lamps: Vec<_> = scene.lights.iter().filter(|l| l.triangle != NONE).collect();
    assert_eq!(lamps.len(), 2 + 2 * 48, "the third ball wears the wall");
    for l in lamps.iter().filter(|l| l.a[0].abs() > 3.0) {
        // Outward of its ball, mirrored or not.
        let [a, b, c] = [l.a, l.b, l.c].map(glam::Vec3::from);
        let center = glam::Vec3::X * 5.0 * a.x.signum();
        assert!((b - a).cross(c - a).dot(a - center) > 0.0);
    }
    assert!(scene.bounds[0][0] < -5.9 && scene.bounds[1][0] > 5.9);
    assert!(effects(&scene, &scene.settings, false, false).0.instances);
}

#[test]
fn mistakes_are_one_line_with_place_and_remedy() {
    for (text, expected) in [
        ("[film]\nwidth = 0", "scene.toml: width is 0: choose 1 to 16384"),
        ("[render]\nspp = 99999999999", "line 2"),
        ("[[mesh]]\nshape = \"cube\"\ntransform = { scale = 0 }", "mesh \"cube\": its transform has no inverse"),
        ("[[mesh]]\nshape = \"sphere\"\ntransform = { scale = [1, 1, 1e-38] }", "its transform has no inverse"),
        ("[[mesh]]\nshape = \"cube\"\ntransform = { scale = 1e-30 }", "its transform has no inverse"),
        ("[[mesh]]\nshape = \"cube\"\ntransform = { scale = 1e30 }", "coordinate of 1e30: the limit is 1e12"),
        (
            "[[mesh]]\nshape = \"cube\"\ntransform = { translate = [nan, 0, 0] }",
            "cube\": its transform has a number that is",
        ),
        ("[environment]\nfile = \"\"", "scene.toml, [environment]: its file has an empty name"),
        ("[[material]]\nname = \"a\"\ncolor = nan", "scene.toml, material \"a\": color is not finite"),
        ("[[mesh]]\nname = \"a\"", "mesh \"a\": needs a file or a shape"),
        ("[[mesh]]\nfile = \"a.obj\"\nshape = \"cube\"", "has more than one of a file, a shape"),
        ("[[mesh]]\nshape = \"cube\"\ngroup = \"x\"", "no group \"x\", since it has none: leave it out"),
        (
            "[[mesh]]\nname = \"a\"\nshape = \"cube\"\n[[mesh]]\nname = \"a\"\nshape = \"disk\"\n[[instance]]\nmesh = \"a\"",
            "instance 1 of mesh \"a\": two meshes have this name: rename one",
        ),
        (
            "[camera]\nworld_from_camera = [1,0,0,0, 0,1,0,0, 0,0,1,9, 0,0,0,1]\nup = [1, 0, 0]",
            "[camera]: has both world_from_camera and position or up: choose one",
        ),
        ("[camera]\nfocus_distance = -1", "focus_distance is -1: choose a number above 0 and up to 1e12"),
        ("[[mesh]]\nfile = \"nowhere.obj\"", "nowhere.obj: cannot be read"),
        ("[[mesh]]\nshape = \"cube\"\nmaterial = \"a\"", "mesh \"cube\": no material \"a\": add a [[material]] table"),
        ("[[instance]]\nmesh = \"a\"", "instance 1 of mesh \"a\": no such mesh"),
        ("[[material]]\nname = \"a\"\nemission = nan", "material \"a\": emission [NaN, NaN, NaN] is negative, NaN"),
        ("[[material]]\nname = \"a\"\nemission = 1e18", "emission [1e18, 1e18, 1e18] is negative, NaN or above 1e17"),
        ("[environment]\nradiance = 1e18", "radiance times scale must lie from 0 to 1e17"),
        (
            "[[light]]\ntype = \"directional\"\ndirection = [0, -1, 0]\nirradiance = 1e18",
            "irradiance [1e18, 1e18, 1e18] is negative",
        ),
        ("[[material]]\nname = \"a\"\nbump_scale = 1e30", "bump_scale is 1e30: choose a height within 1e12"),
        ("[[material]]\nname = \"a\"\nbump_scale = -inf", "bump_scale is -inf: choose a height within 1e12"),
        ("[[material]]\nname = \"a\"\nalpha = 2", "alpha is 2: choose a value from 0 to 1"),
        ("[[material]]\nname = \"a\"\n[[material]]\nname = \"a\"", "is defined twice"),
        ("[[material]]\ncolor = 1", "has no name"),
        ("[[material]]\nname = \"a\"\ntype = \"conductor\"\nmetal = \"wood\"", "metal \"wood\" is not known"),
        ("[[light]]\ntype = \"point\"\nintensity = 1", "light 1: needs a position"),
        ("[[light]]\ntype = \"directional\"\ndirection = [0, 0, 0]\nirradiance = 1", "the direction has no length"),
        ("[environment]\nfile = \"sky.hdr\"", "sky.hdr: cannot be read"),
        ("[environment]\nradiance = -1", "[environment]"),
        ("[camera]\nfov = 200", "[camera]: fov is 200"),
        ("film = 3", "line 1: film takes a table, not 3"),
    ] {
        let found = error(text);
        assert!(found.contains(expected), "{text}\n  gave {found}\n  not  {expected}");
    }
    assert!(parse(BOX).is_ok(), "control");
}

#[test]
fn what_is_legal_but_odd_is_a_warning() {
    let empty = parse("").unwrap();
    assert_eq!((empty.triangles.len(), empty.nodes.len(), empty.materials.len()), (0, 1, 1));
    assert_eq!(empty.warnings, ["the scene shows no surface", "the scene has no light: its image will be black"]);
    let bright = parse("[[material]]\nname = \"a\"\ncolor = 1.5").unwrap();
    assert!(bright.warnings[0].contains("outside [0, 1]: clamped"), "{:?}", bright.warnings);
    let missing = parse("[[material]]\nname = \"a\"\ncolor_texture = \"no.png\"").unwrap();
    assert!(missing.warnings[0].contains("no.png: no such file"), "{:?}", missing.warnings);
    let folder = parse("[[material]]\nname = \"a\"\ncolor_texture = \".\"").unwrap();
    assert!(folder.warnings[0].contains(".: is a folder; its constant colour"), "{:?}", folder.warnings);
}

#[test]
fn pictures_of_emission_too_bright_for_their_texels_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let warnings = |brightest: f32| {
        let mut film = Film::new(2, 1);
        film.add_vec3("", ["R", "G", "B"], &[[brightest, 1.0, 1.0], [1.0, 2.0, brightest]]);
        write(&folder.path().join("lamp.exr"), &film, &WriteOptions::default()).unwrap();
        let text = "[[material]]\nname = 'lamp'\nemission_texture = 'lamp.exr'\n[[mesh]]\nshape = 'rectangle'\nmaterial = 'lamp'\n";
        Scene::parse(&folder.path().join("scene.toml"), text).unwrap().scene.warnings
    };
    assert_eq!(warnings(60_000.0), Vec::<String>::new());
    let said = warnings(200_000.0);
    assert!(said.len() == 1 && said[0].contains("lamp.exr: clamped to 6.5408e4"), "{said:?}");
}

/// A picture of floats may have numbers that its use has not: damage, ringing of a filter, and normals that were not moved to [0, 1].
#[test]
fn pictures_of_numbers_that_their_use_has_not_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let said_of = |key: &str, pixels: [[f32; 3]; 2]| {
        let mut film = Film::new(2, 1);
        film.add_vec3("", ["R", "G", "B"], &pixels);
        write(&folder.path().join("p.exr"), &film, &WriteOptions::default()).unwrap();
        let text = format!(
            "[environment]\n[[material]]\nname = 'a'\n{key} = 'p.exr'\n[[mesh]]\nshape = 'rectangle'\nmaterial = 'a'\n"
        );
        Scene::parse(&folder.path().join("scene.toml"), &text).unwrap().scene.warnings
    };
    let said = |key: &str, odd: f32| said_of(key, [[odd, odd, 0.5], [0.5; 3]]);
    for (key, odd, told) in [
        ("color_texture", f32::NAN, "lie outside [0, 1] or are NaN: clamped"),
        ("color_texture", f32::INFINITY, "lie outside [0, 1] or are NaN: clamped"),
        ("color_texture", 1.5, "lie outside [0, 1] or are NaN: clamped"),
        ("normal_map", -0.5, "lie outside [0, 1] or are NaN: clamped"),
        ("opacity_texture", -1.0, "lie outside [0, 1] or are NaN: clamped"),
        ("emission_texture", -1.0, "are negative or NaN: set to 0"),
        ("emission_texture", f32::NAN, "are negative or NaN: set to 0"),
        ("bump", f32::NAN, "are NaN or infinite: set to 0"),
    ] {
        let said = said(key, odd);
        assert!(
            said.len() == 1 && said[0].contains("p.exr: numbers of 1 texel ") && said[0].ends_with(told),
            "{key}: {said:?}"
        );
    }
    // As an opacity it has one such texel, as a colour two, and is told once.
    let two = said_of("opacity_texture = 'p.exr'\ncolor_texture", [[2.0; 3], [0.5, -1.0, 0.5]]);
    assert!(two.len() == 1 && two[0].contains("numbers of 2 texels lie outside"), "{two:?}");
    for (key, usual) in [
        ("color_texture", 1.001),
        ("color_texture", -0.001),
        ("emission_texture", 3.0),
        ("bump", -7.0),
        ("normal_map", 0.0),
    ] {
        assert_eq!(said(key, usual), Vec::<String>::new(), "{key}");
    }
}

#[test]
fn lamps_that_lie_on_others_are_told() {
    let lamp = |name: &str, emission: u32| format!("[[material]]\nname = '{name}'\nemission = {emission}\n");
    let placed =
        |material: &str, more: &str| format!("[[mesh]]\nshape = 'rectangle'\nmaterial = '{material}'\n{more}\n");
    let load = |second: String| {
        let text = lamp("dim", 1) + &lamp("bright", 3) + &lamp("dark", 0) + &placed("dim", "") + &second;
        Scene::parse(Path::new("scene.toml"), &text).unwrap().scene
    };
    for (material, more) in [("bright", ""), ("dim", "flip_normals = true"), ("bright", "flip_normals = true")] {
        let said = load(placed(material, more)).warnings;
        let expected = format!("lamps that lie on others: 2, the first of material \"{material}\" on one of \"dim\";");
        assert!(said.len() == 1 && said[0].starts_with(&expected), "{said:?}");
    }
    for (material, more, lights) in
        [("dim", "", 2), ("dark", "", 2), ("bright", "transform = { translate = [0, 0, 1] }", 4)]
    {
        let scene = load(placed(material, more));
        assert_eq!((scene.warnings, scene.lights.len()), (Vec::new(), lights), "{material} {more}");
    }
}

#[test]
fn missing_normals_are_counted_unless_they_are_meant_to_be() {
    let dir = tempfile::tempdir().unwrap();
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\nvn 0 0 1\nvn 0 1 0\n";
    std::fs::write(dir.path().join("some.obj"), format!("{corners}f 1//1 2//1 3//2\nf 1 2 4\nf 1 3 4\n")).unwrap();
    std::fs::write(dir.path().join("none.obj"), format!("{corners}f 1 2 3\n")).unwrap();
    let said = |mesh: &str| {
        let text = format!("{BOX}[[mesh]]\nname = \"a\"\n{mesh}");
        Scene::parse(&dir.path().join("scene.toml"), &text).unwrap().scene.warnings
    };
    let repaired = |n| [format!("mesh \"a\": triangles repaired: {n} without vertex normals shaded flat")];
    assert_eq!(said("file = \"some.obj\""), repaired(2));
    assert_eq!(said("file = \"none.obj\""), repaired(1));
    for file in ["some.obj", "none.obj"] {
        assert_eq!(said(&format!("file = \"{file}\"\nflat = true")), Vec::<String>::new(), "{file}");
    }
}

#[test]
fn models_alone_get_a_camera_and_a_sky() {
    let dir = tempfile::tempdir().unwrap();
    let load = |name: &str, text: &str| {
        std::fs::write(dir.path().join(name), text).unwrap();
        Scene::load(&dir.path().join(name))
    };
    load("m.mtl", "newmtl lamp\nKe 1 1 1\n").unwrap_err(); // no scene, but now the file is there
    let triangle = "v 0 0 0\nv 4 0 0\nv 0 4 0\nv nan 0 0\n";
    let scene = load("a.obj", &format!("{triangle}f 1 2 3\nf 1 2 2\nf 1 2 4\n")).unwrap();
    assert_eq!((scene.triangles.len(), scene.lights[0].kind), (1, LIGHT_ENVIRONMENT));
    let repaired = &scene.warnings[0];
    assert!(repaired.contains("1 with NaN or infinite coordinates dropped, 1 without area dropped"), "{repaired}");
    let camera = scene.camera([512, 512]).unwrap();
    let eye = glam::Vec3::from(camera.position) - glam::Vec3::new(2.0, 2.0, 0.0);
    assert!(eye.normalize().dot(glam::Vec3::from(camera.forward)) < -0.999, "it looks at the middle");
    let lit = load("b.obj", &format!("mtllib m.mtl\n{triangle}usemtl lamp\nf 1 2 3\n")).unwrap();
    assert_eq!((lit.lights.len(), lit.lights[0].kind), (1, LIGHT_TRIANGLE), "no sky over a lamp");
    let far = load("c.obj", "v 0 0 0\nv 2e12 0 0\nv 0 1 0\nf 1 2 3").unwrap_err().to_string();
    assert!(far.contains("coordinate of 2e12: the limit is 1e12"), "{far}");
}

#[test]
fn mtl_rules_by_example() {
    let dir = tempfile::tempdir().unwrap();
    let blocks = [
        ("diffuse", "Kd 0.5 0.4 0.3\nKs 0.5 0.5 0.5\nillum 1"),
        ("coated", "Kd 0.5 0.5 0.5\nKs 0.04 0.04 0.02\nNs 198\nNi 1.5\nillum 2"),
        ("metal", "Kd 0.9 0.5 0.1\nPm 1\nPr 0.5"),
        ("mirror", "Kd 0 0 0\nKs 0.8 0.8 0.8\nillum 3"),
        ("glass", "Kd 0 0 0\nTf 0.9 1 0.9\nNi 1.33\nillum 7\nd 0.3"),
        ("tinted", "Kd 1 1 1\nTf 1 0 0\nNi 1.4\nd 0.5"),
        ("veil", "Kd 1 1 1\nd 0.5"),
        // As Maya and Blender write what does not refract.
        ("lambert", "illum 4\nKd 0.5 0.5 0.5\nKa 0 0 0\nTf 1 1 1\nNi 1.00"),
        ("no index", "illum 4\nKd 0.5 0.5 0.5\nTf 1 1 1\nNi 0.00"),
        ("blinn", "illum 4\nKd 0.5 0.5 0.5\nTf 1 1 1\nKs 0.5 0.5 0.5\nNs 18\nNi 1.00"),
        ("alpha", "Ns 250\nKd 0.8 0.1 0.1\nKs 0 0 0\nNi 1.45\nd 0.5\nillum 9"),
    ];
    let mtl: String = blocks.iter().map(|(name, text)| format!("newmtl {name}\n{text}\n")).collect();
    let faces: String = blocks.iter().map(|(name, _)| format!("usemtl {name}\nf 1 2 3\n")).collect();
    std::fs::write(dir.path().join("m.mtl"), mtl).unwrap();
    std::fs::write(dir.path().join("m.obj"), format!("mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n{faces}")).unwrap();
    let scene = Scene::load(&dir.path().join("m.obj")).unwrap();
    let [diffuse, coated, metal, mirror, glass, tinted, veil, lambert, no_index, blinn, alpha] = scene.materials[..]
    else {
        panic!("eleven materials")
    };
    assert_eq!((diffuse.kind, diffuse.base_color), (BSDF_DIFFUSE, [0.5, 0.4, 0.3]));
    assert_eq!((coated.kind, coated.eta[0]), (BSDF_COATED, 1.5));
    assert!((coated.alpha - 0.1).abs() < 1e-6 && (coated.specular[0] - 1.0).abs() < 1e-4);
    assert!((coated.specular[2] - 0.5).abs() < 1e-4 && (coated.internal_fresnel - 0.5963).abs() < 1e-3);
    // Reflectance 0.9 at normal incidence: n = 0.1 / 1.9, k = 2 sqrt(0.9) / 1.9.
    assert_eq!((metal.kind, metal.alpha), (BSDF_CONDUCTOR, 0.25));
    assert!((metal.eta[0] - 0.052632).abs() < 1e-5 && (metal.k[0] - 0.998614).abs() < 1e-5);
    assert_eq!((mirror.kind, mirror.alpha, mirror.specular), (BSDF_CONDUCTOR, 0.0, [0.8; 3]));
    assert_eq!((mirror.eta, mirror.k), ([0.0; 3], [1.0; 3]));
    assert_eq!((glass.kind, glass.eta[0], glass.alpha, glass.opacity), (BSDF_DIELECTRIC, 1.33, 0.0, 1.0));
    assert_eq!((glass.transmission, glass.flags & MATERIAL_MASKED), ([0.9, 1.0, 0.9], 0));
    assert_eq!((tinted.kind, tinted.transmission), (BSDF_DIELECTRIC, [1.0, 0.0, 0.0]));
    assert_eq!((veil.kind, veil.opacity, veil.flags & MATERIAL_MASKED), (BSDF_DIFFUSE, 0.5, MATERIAL_MASKED));
    assert_eq!((lambert.kind, lambert.base_color), (BSDF_DIFFUSE, [0.5; 3]));
    assert_eq!((no_index.kind, blinn.kind, blinn.eta[0]), (BSDF_DIFFUSE, BSDF_COATED, 1.5));
    assert_eq!((alpha.kind, alpha.base_color, alpha.opacity), (BSDF_DIFFUSE, [0.8, 0.1, 0.1], 0.5));
}

#[test]
fn maps_are_scaled_and_moved() {
    let dir = tempfile::tempdir().unwrap();
    let picture = image::RgbImage::from_fn(8, 8, |x, y| image::Rgb([(x * 31) as u8, (y * 31) as u8, 99]));
    save(&picture, &dir.path().join("a.png"));
    let mtl = "newmtl plain\nmap_Kd a.png\nnewmtl moved\nmap_Kd -s 2 -3 -o 0.25 0.5 a.png\n";
    std::fs::write(dir.path().join("m.mtl"), mtl).unwrap();
    let text = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl plain\nf 1 2 3\nusemtl moved\nf 1 2 3\n";
    std::fs::write(dir.path().join("m.obj"), text).unwrap();
    let scene = Scene::load(&dir.path().join("m.obj")).unwrap();
    let [plain, moved] = [0, 1].map(|i| scene.materials[i].base_texture);
    let sample = |texture, u, v| texture_sample(&scene, texture, glam::vec2(u, v));
    for (u, v) in [(0.0, 0.0), (0.3, 0.2), (0.9, 0.7), (-0.4, 1.6)] {
        let expected = sample(plain, 2.0 * u + 0.25, -3.0 * v + 0.5);
        assert!((sample(moved, u, v) - expected).abs().max_element() < 1e-5, "{u} {v}");
    }
    assert!((sample(moved, 0.3, 0.2) - sample(plain, 0.3, 0.2)).abs().max_element() > 0.1, "control");
}

/// The file that scenes/README.md shows, with shapes and a constant in place of the files that it names.
#[test]
fn the_guide_s_scene_is_one() {
    let guide = include_str!("../../scenes/README.md");
    let shown = guide.split("```toml").nth(1).unwrap().split("```").next().unwrap();
    let text = shown.replace("file = \"room.obj\"", "shape = \"cube\"").replace("file = \"sky.hdr\"", "radiance = 1");
    assert_ne!(text, shown, "control: the files are named");
    let scene = parse(&text).unwrap();
    assert_eq!(scene.warnings, Vec::<String>::new());
    assert_eq!((scene.settings.width, scene.instances.len(), scene.lights.len()), (640, 1, 2));
}

#[test]
fn rough_coats_share_a_table_by_index_and_distribution() {
    let coat = |name: &str, rest: &str| format!("[[material]]\nname = '{name}'\ntype = 'coated'\n{rest}\n");
    let text = coat("a", "alpha = 0.2") + &coat("b", "alpha = 0.7\nnonlinear = true") + &coat("smooth", "");
    let text = text + &coat("ggx", "alpha = 0.2\ndistribution = 'ggx'") + "[[mesh]]\nshape = 'cube'\nmaterial = 'a'\n";
    let scene = Scene::parse(Path::new("scene.toml"), &text).unwrap();
    let length = COAT_ROWS * COAT_COLUMNS;
    let at: Vec<_> = scene.materials[..4].iter().map(|m| m.coat_table).collect();
    assert_eq!((at, scene.texels.len()), (vec![0, 0, 0, length], 2 * length as usize));
    let nonlinear: Vec<_> = scene.materials[..4].iter().map(|m| m.flags & MATERIAL_NONLINEAR != 0).collect();
    assert_eq!(nonlinear, [false, true, false, false]);
}

/// What another key overrules, or nothing reads, is not dropped without a word.
#[test]
fn keys_that_change_nothing_are_told() {
    let lamp = |rest: &str| parse(&format!("{BOX}[[light]]\n{rest}")).unwrap().scene.warnings;
    let [position, direction] = ["position = [0, 0, 1]\n", "direction = [0, -1, 0]\n"];
    let point = lamp(&format!("type = \"point\"\n{position}{direction}intensity = 1\ncutoff = 10\nirradiance = 1\n"));
    assert_eq!(point, ["light 1: a point light does not read direction, irradiance, cutoff"]);
    let sun = lamp(&format!("type = \"directional\"\n{position}{direction}irradiance = 1\nintensity = 1\ncone = 2\n"));
    assert_eq!(sun, ["light 1: a directional light does not read position, intensity, cone"]);
    let spot = lamp(&format!("type = \"spot\"\n{position}{direction}intensity = 1\ncutoff = 10\ncone = 2\n"));
    assert_eq!(spot, Vec::<String>::new());
    let cube = parse(&format!("{BOX}[[mesh]]\nshape = \"cube\"\nsegments = 8\n")).unwrap().scene.warnings;
    assert_eq!(cube, ["mesh \"cube\": only spheres and disks read segments"]);
    for (more, says) in [
        (
            "[environment]\nrotation = 9\nworld_from_environment = [1, 0, 0, 0, 1, 0, 0, 0, 1]\n",
            "has both rotation and",
        ),
        ("[[material]]\nname = \"m\"\ntype = \"conductor\"\nmetal = \"Au\"\neta = 1\n", "has both metal and eta or k"),
    ] {
        let line = error(&format!("{BOX}{more}"));
        assert!(line.contains(says), "{line}");
    }
}
