//! Tests of the `[[animation]]` tables: where they put things, and the messages about mistakes.
use std::fs;
use std::path::Path;
use tallow::image::{self, Film, WriteOptions};
use tallow::scene::{Loaded, MaterialChange, Pose, Scene, effects};

const STAGE: &str = "
[camera]
position = [0, 0, 9]
target = [0, 0, 0]
[environment]
radiance = 1
[[material]]
name = \"grey\"
[[mesh]]
name = \"cube\"
shape = \"cube\"
material = \"grey\"
[[mesh]]
name = \"lid\"
shape = \"rectangle\"
material = \"grey\"
[[instance]]
name = \"box\"
mesh = \"cube\"
transform = { translate = [1, 2, 3], scale = 2 }
[[light]]
name = \"bulb\"
type = \"point\"
position = [0, 3, 0]
intensity = 10
";

fn pose(tables: &str, seconds: f64) -> Pose {
    let loaded = Scene::parse(Path::new("s.toml"), &(STAGE.to_owned() + tables)).unwrap();
    let (mut scene, pose) = (loaded.scene, loaded.animation.at(seconds).unwrap());
    scene.apply(&pose).unwrap();
    pose
}

fn error(tables: &str) -> String {
    let error = Scene::parse(Path::new("s.toml"), &(STAGE.to_owned() + tables)).unwrap_err();
    let line = error.to_string();
    assert!(error.exit_code() == 3 && !line.contains('\n'), "{line}");
    line
}

#[test]
fn keys_say_where_things_are() {
    let tables = "
[[animation]]
instance = \"box\"
keys = [{ time = 0, rotate = [0, 0, 0] }, { time = 1, rotate = [0, 90, 0], translate = [5, 0, 0] }]
[[animation]]
instance = \"lid\"
interpolation = \"step\"
keys = [{ time = 0, translate = [0, 1, 0] }, { time = 2, translate = [0, 7, 0], scale = 3 }]
[[animation]]
light = \"bulb\"
keys = [{ time = 0, position = [0, 3, 0] }, { time = 4, position = [8, 3, 0], intensity = 2 }]
[[animation]]
material = \"grey\"
keys = [{ time = 0, color = 0 }, { time = 2, color = [1, 0.5, 0] }]
[[animation]]
camera = true
keys = [{ time = 0, fov = 40 }, { time = 1, fov = 60, position = [0, 1, 9] }]
[[animation]]
environment = true
keys = [{ time = 0, radiance = 1 }, { time = 1, radiance = [3, 2, 1] }]
";
    let at = pose(tables, 0.5);
    let turned = at.instances[0].1.0;
    assert_eq!(at.instances[0].0, 0);
    assert!(turned.translation.abs_diff_eq(glam::dvec3(5.0, 0.0, 0.0), 1e-12), "one key says it for all times");
    let half = 2.0 * 45f64.to_radians().cos();
    assert!((turned.matrix3.x_axis.x - half).abs() < 1e-9, "the scale of the table stays: {turned:?}");
    assert_eq!(at.instances[1].0, 1, "after the [[instance]] tables come moving meshes without one");
    assert_eq!(at.instances[1].1.0.translation.y, 1.0);
    assert_eq!(at.lights[0].1.position, Some([1.0, 3.0, 0.0]));
    assert_eq!(at.lights[0].1.intensity.unwrap().0, [2.0; 3]);
    assert_eq!(at.materials[0].1.color, Some([0.25, 0.125, 0.0]));
    let camera = at.camera.unwrap();
    assert_eq!((camera.fov, camera.position, camera.target), (Some(50.0), Some([0.0, 1.0, 9.0]), Some([0.0; 3])));
    assert_eq!(at.environment.unwrap().radiance, Some([2.0, 1.5, 1.0]));
}

/// A table of rows that no scale and rotation make.
#[test]
fn a_place_with_shear_keeps_it_where_keys_move_it() {
    let tables = |keys: &str| {
        format!(
            "[[instance]]\nname = \"bent\"\nmesh = \"cube\"\ntransform = [2,1,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]\n\
             [[animation]]\ninstance = \"bent\"\nkeys = [{keys}]"
        )
    };
    let at = pose(&tables("{ time = 0, translate = [0, 0, 4] }"), 0.0).instances[0].1.0;
    assert_eq!((at.translation.z, at.matrix3.y_axis), (4.0, glam::dvec3(1.0, 1.0, 0.0)));
    let line = error(&tables("{ time = 0, rotate = [0, 0, 90] }"));
    assert!(line.contains("shear") && line.contains("give both"), "{line}");
    let whole = pose(&tables("{ time = 0, rotate = [0, 0, 90], scale = 1 }"), 0.0).instances[0].1.0;
    assert!(whole.matrix3.x_axis.abs_diff_eq(glam::DVec3::Y, 1e-12), "{whole:?}");
}

/// A picture of a sky is there for keys that light it up, however dark its table makes it.
#[test]
fn a_sky_that_begins_dark_can_be_lit() {
    let folder = tempfile::tempdir().unwrap();
    let mut film = Film::new(4, 2);
    film.add_vec3("", ["R", "G", "B"], &[[1.0; 3]; 8]);
    image::write(&folder.path().join("sky.exr"), &film, &WriteOptions::default()).unwrap();
    let text = "[environment]\nfile = \"sky.exr\"\nscale = 0\n[[mesh]]\nshape = \"cube\"\n[[animation]]\nenvironment = true\n\
                keys = [{ time = 0, radiance = 0 }, { time = 1, radiance = 1 }]\n";
    let loaded = Scene::parse(&folder.path().join("s.toml"), text).unwrap();
    let mut scene = loaded.scene;
    let lit = |scene: &Scene| scene.lights.iter().any(|light| light.value == [1.0; 3]);
    for (time, expected) in [(0.0, false), (1.0, true), (0.0, false)] {
        scene.apply(&loaded.animation.at(time).unwrap()).unwrap();
        assert_eq!(lit(&scene), expected, "at {time} s");
    }
}

/// Several scales and rotations make one matrix where scales are negative: what keys leave out is what the table says.
#[test]
fn a_mirrored_place_stays_mirrored_as_it_is() {
    for (scale, keys) in [
        ("[1, -1, 1]", "rotate = [0, 0, 0]"),
        ("[-1, -1, 1]", "rotate = [0, 0, 0]"),
        ("[1, 1, -2]", "rotate = [0, 0, 0], translate = [0, 0, 0]"),
        ("[1, -1, 1]", "scale = [1, -1, 1]"),
    ] {
        let tables = format!(
            "[[instance]]\nname = \"mirrored\"\nmesh = \"cube\"\ntransform = {{ scale = {scale} }}\n\
             [[animation]]\ninstance = \"mirrored\"\nkeys = [{{ time = 0, {keys} }}]"
        );
        let at = pose(&tables, 0.0).instances[0].1.0;
        let numbers: Vec<f64> = scale.trim_matches(['[', ']']).split(", ").map(|v| v.parse().unwrap()).collect();
        let expected = glam::DMat3::from_diagonal(glam::DVec3::from_slice(&numbers));
        assert!(at.matrix3.abs_diff_eq(expected, 1e-12), "{scale}, {keys}: {:?}", at.matrix3);
    }
}

/// A frame alone cannot know how large a lamp is in the others.
#[test]
fn lamps_that_may_grow_are_sampled_as_large_ones() {
    const PANEL: &str = "
[[material]]
name = \"lamp\"
emission = 5
[[mesh]]
name = \"panel\"
shape = \"rectangle\"
material = \"lamp\"
transform = { scale = 0.01 }
";
    let load = |tables: &str| Scene::parse(Path::new("s.toml"), &(STAGE.to_owned() + tables)).unwrap();
    let large = |scene: &Scene| effects(scene, &Default::default(), false, false).0.large_lamps;
    let camera = "[[animation]]\ncamera = true\nkeys = [{ time = 0, fov = 40 }, { time = 1, fov = 60 }]";
    let grows = "[[animation]]\ninstance = \"panel\"\nkeys = [{ time = 0, scale = 0.01 }, { time = 1, scale = 2 }]";
    assert!(!large(&load(PANEL)) && !large(&load(&(PANEL.to_owned() + camera))));
    let Loaded { mut scene, animation, .. } = load(&(PANEL.to_owned() + grows));
    for seconds in [0.0, 1.0, 0.0] {
        scene.apply(&animation.at(seconds).unwrap()).unwrap();
        assert!(large(&scene), "at {seconds} s");
    }
    let dark = grows.replace("panel", "box");
    assert!(!large(&load(&dark)), "without lamps there is nothing to sample");
    assert!(large(&load(&PANEL.replace("0.01", "2"))), "control: one that is large and stays");
}

/// Spheres are lamps where they are of even radiance and shine outward; keys may leave neither.
#[test]
fn spheres_that_keys_make_lamps_of_another_kind_are_meshes() {
    let scene = |ball: &str, material: &str, keys: &str| {
        let text = format!(
            "[camera]\nposition = [0, 0, 9]\n[environment]\nradiance = 1\n[[material]]\nname = \"glow\"\n{material}\n\
             [[mesh]]\nname = \"ball\"\nshape = \"sphere\"\nmaterial = \"glow\"\n{ball}\n[[instance]]\nname = \"one\"\nmesh = \"ball\"\n{keys}"
        );
        Scene::parse(Path::new("s.toml"), &text).unwrap()
    };
    let material = |keys: &str| format!("[[animation]]\nmaterial = \"glow\"\nkeys = [{keys}]\n");
    let place = |keys: &str| format!("[[animation]]\ninstance = \"one\"\nkeys = [{keys}]\n");
    let glows = &material("{ time = 0, emission = 0 }, { time = 1, emission = 5 }");
    let fades = &material("{ time = 0, opacity = 1 }, { time = 1, opacity = 0.5 }");
    let glows_and_fades = &material("{ time = 0, emission = 0 }, { time = 1, emission = 5, opacity = 0.5 }");
    let stretches = &place("{ time = 0, scale = 1 }, { time = 1, scale = [1, 2, 1] }");
    let bends = &place("{ time = 0, transform = [1, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1] }");
    let grows = &place("{ time = 0, scale = 1 }, { time = 1, scale = [2, 2, 2] }");
    let both = |a: &String, b: &String| format!("{a}{b}");
    let long = "transform = { scale = [1, 2, 1] }";
    let cases = [
        ("", "", glows.clone(), true),
        ("", "", both(glows, grows), true),
        ("", "", glows_and_fades.clone(), false),
        ("", "", both(glows, stretches), false),
        ("", "", both(glows, bends), false),
        (long, "", glows.clone(), false),
        ("flip_normals = true", "", glows.clone(), false),
        ("", "opacity = 0.5", glows.clone(), false),
        ("", "emission = 1", fades.clone(), false),
        ("", "emission = 1", stretches.clone(), false),
        (long, "opacity = 0.5", both(fades, stretches), true),
    ];
    for (ball, own, keys, expected) in cases {
        let Loaded { mut scene, animation, .. } = scene(ball, own, &keys);
        assert_eq!(scene.triangles.len() == 1, expected, "{ball} {own} {keys}");
        scene.apply(&animation.at(1.0).unwrap()).unwrap();
    }
    let change = |color: Option<[f32; 3]>, opacity| MaterialChange { emission: color, opacity, ..Default::default() };
    for (ball, own, to, what) in [
        (long, "", change(Some([1.0; 3]), None), "is stretched"),
        ("flip_normals = true", "", change(Some([1.0; 3]), None), "shines inward"),
        ("", "opacity = 0.5", change(Some([1.0; 3]), None), "is not opaque"),
        ("", "emission = 1", change(None, Some(0.5)), "is not opaque"),
    ] {
        let mut scene = scene(ball, own, "").scene;
        let number = scene.names.materials.iter().position(|name| name == "glow").unwrap();
        let change = |to| Pose { materials: vec![(number, to)], ..Pose::default() };
        let line = scene.apply(&change(to)).unwrap_err().to_string();
        assert!(line.contains(what) && line.contains("give its mesh segments"), "{line}");
        scene.apply(&change(MaterialChange { color: Some([0.5; 3]), ..Default::default() })).unwrap();
    }
}

#[test]
fn mistakes_are_one_line_with_the_table_and_the_key() {
    let instance = |keys: &str| format!("[[animation]]\ninstance = \"box\"\nkeys = [{keys}]");
    let cases = [
        (
            instance("{ time = 1, scale = 1 }, { time = 0.5, scale = 2 }"),
            "animation 1: keys 1 and 2 are out of order, 1 and",
        ),
        (instance("{ time = 1, scale = 1 }, { time = 1, scale = 2 }"), "keys 1 and 2 are at one time"),
        (instance("{ time = nan, scale = 1 }"), "key 1, at NaN"),
        (instance("{ time = 0, translate = [nan, 0, 0] }"), "has a number that is NaN"),
        (instance("{ time = 0, translat = [0, 0, 0] }"), "unknown key \"translat\": choose from translate, rotate"),
        (instance("{ time = 0, translate = [0, 0] }"), "translate has 2 numbers, not 3"),
        (instance("{ time = 0, scale = 1, transform = [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1] }"), "choose"),
        (
            instance(
                "{ time = 0, translate = [1,0,0] }, { time = 1, transform = [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1] }",
            ),
            "has a transform and parts of one: choose",
        ),
        (instance(""), "has no keys"),
        (instance("{ time = 0, rotate = [0, 0, 0, 9] }"), "the axis of rotate is zero"),
        ("[[animation]]\ninstance = \"bux\"\nkeys = [{ time = 0, scale = 1 }]".into(), "did you mean \"box\"?"),
        ("[[animation]]\nkeys = [{ time = 0, scale = 1 }]".into(), "needs one of camera, instance"),
        ("[[animation]]\ncamera = true\nlight = \"bulb\"".into(), "needs one of camera, instance"),
        ("[[animation]]\nmesh = \"lid\"".into(), "takes a file of every pose"),
        ("[[animation]]\nmesh = \"lid\"\nfile = \"a.obj\"".into(), "give `#` for the number"),
        (
            "[[animation]]\nlight = \"bulb\"\nkeys = [{ time = 0, irradiance = 1 }]".into(),
            "unknown key \"irradiance\": choose from position, intensity",
        ),
        (
            instance("{ time = 0, scale = 1 }") + "\n" + &instance("{ time = 0, scale = 1 }"),
            "animation 2: instance \"box\"",
        ),
    ];
    for (tables, part) in cases {
        let line = error(&tables);
        assert!(line.contains(part), "{line}, not: {part}");
    }
    assert!(error("[[animation]]\nloop = true").contains("unknown key \"loop\""));
}

/// The triangles belong to the first pose, whatever the shape of a face asks for later, and corners are followed however a file numbers
/// what it shares: here corner 2 of a square moves inwards until the face is concave, and two normals become one.
#[test]
fn corners_of_faces_are_followed_through_files() {
    let folder = tempfile::tempdir().unwrap();
    let obj = |x: f32, normals: &str, faces: &str| {
        format!("v 0 0 0\nv 1 0 0\nv {x} {x} 0\nv 0 1 0\nv -1 1 0\n{normals}{faces}\n")
    };
    let two = obj(1.0, "vn 0 0 1\nvn 0 .6 .8\n", "f 1//1 2//1 3//1 4//1\nf 4//2 3//2 5//2");
    let one = obj(0.25, "vn 0 0 1\n", "f 1//1 2//1 3//1 4//1\nf 4//1 3//1 5//1");
    let ply = |x: f32, faces: &str| {
        let rows = format!("0 0 0\n1 0 0\n{x} {x} 0\n0 1 0\n-1 1 0\n0 1 0\n");
        format!(
            "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\nelement face 2\n\
             property list uchar int vertex_indices\nend_header\n{rows}{faces}\n"
        )
    };
    let files = [
        ("0.obj", two),
        ("1.obj", one),
        ("0.ply", ply(1.0, "4 0 1 2 3\n3 3 2 4")),
        ("1.ply", ply(0.25, "4 0 1 2 5\n3 3 2 4")),
    ];
    for (name, text) in files {
        fs::write(folder.path().join(name), text).unwrap();
    }
    for ending in ["obj", "ply"] {
        let tables = format!(
            "[camera]\nposition = [0, 0, 9]\n[environment]\nradiance = 1\n[[animation]]\nmesh = \"flag\"\nfile = \"#.{ending}\"\nlast = 1\nfps = 1\n[[mesh]]\nname = \"flag\"\n"
        );
        let mut loaded = Scene::parse(&folder.path().join("s.toml"), &tables).unwrap();
        for (seconds, x) in [(1.0, 0.25), (0.5, 0.625), (0.0, 1.0)] {
            loaded.scene.apply(&loaded.animation.at(seconds).unwrap()).unwrap();
            let mut triangles = loaded.scene.triangles.clone();
            triangles.sort_by_key(|t| t.primitive);
            let corners: Vec<_> = triangles.iter().map(|t| [t.v0, t.v1, t.v2].map(|v| [v[0], v[1]])).collect();
            let square = [[[0.0, 0.0], [1.0, 0.0], [x, x]], [[0.0, 0.0], [x, x], [0.0, 1.0]]];
            let expected = [square[0], square[1], [[0.0, 1.0], [x, x], [-1.0, 1.0]]];
            assert_eq!(corners, expected, "{ending} at {seconds} s");
        }
    }
}

#[test]
fn a_mesh_goes_through_the_poses_of_its_files() {
    let folder = tempfile::tempdir().unwrap();
    for (number, height) in [1.0, 3.0, 7.0].iter().enumerate() {
        let text = format!("v 0 0 0\nv 1 0 0\nv 0 {height} 0\nvn 0 0 1\nf 1//1 2//1 3//1\n");
        fs::write(folder.path().join(format!("p_{number:02}.obj")), text).unwrap();
    }
    let tables = "[[animation]]\nmesh = \"flag\"\nfile = \"p_##.obj\"\nlast = 2\nfps = 2\n[[mesh]]\nname = \"flag\"\n";
    let load =
        |more: &str| Scene::parse(&folder.path().join("s.toml"), &(STAGE.to_owned() + &tables.replace("fps", more)));
    let heights = |more: &str, times: &[f64]| -> Vec<f32> {
        let mut loaded = load(more).unwrap();
        let top = |&seconds: &f64| {
            let pose = loaded.animation.at(seconds).unwrap();
            loaded.scene.apply(&pose).unwrap();
            let triangles = &loaded.scene.triangles;
            triangles.iter().find(|t| t.v1[0] == 1.0 && t.v2[0] == 0.0).unwrap().v2[1]
        };
        times.iter().map(top).collect()
    };
    assert_eq!(heights("fps", &[0.0, 0.25, 0.5, 0.75, 9.0]), [1.0, 2.0, 3.0, 5.0, 7.0]);
    assert_eq!(heights("interpolation = \"step\"\nfps", &[0.25, 0.5]), [1.0, 3.0]);
    assert_eq!(heights("repeat = true\nfps", &[1.25, 1.5]), [4.0, 1.0], "from the last to the first");
    fs::write(folder.path().join("p_01.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 3 2\n").unwrap();
    let loaded = load("fps").unwrap();
    let line = loaded.animation.at(0.5).unwrap_err().to_string();
    assert!(line.contains("p_01.obj: has 6 corners of faces where") && line.contains("p_00.obj has 3"), "{line}");
    fs::remove_file(folder.path().join("p_02.obj")).unwrap();
    assert!(loaded.animation.at(1.0).unwrap_err().to_string().contains("p_02.obj"));
}

/// Before a frame is rendered: a later one would fail, or stop short of what its key says.
#[test]
fn numbers_of_keys_are_checked_when_the_scene_is_loaded() {
    let table = |what: &str, keys: &str| format!("[[animation]]\n{what}\nkeys = [{keys}]\n");
    let at_two = |what: &str, key: &str, from: f64, to: f64| {
        table(what, &format!("{{ time = 0, {key} = {from} }}, {{ time = 2.5, {key} = {to} }}"))
    };
    let (grey, bulb, moved) = ("material = \"grey\"", "light = \"bulb\"", "instance = \"box\"");
    let sound = |tables: &str| {
        let tables = tables.replace("-1", "1").replace("200e12", "20").replace("200000000000000", "20");
        tables.replace("200", "20").replace("1e300", "1")
    };
    // A sphere with a placement of its own, by which that of a key is multiplied.
    let egg = "[[mesh]]\nname = \"egg\"\nshape = \"sphere\"\ntransform = { scale = [1e10, 2e10, 1e10] }\n\
               [[instance]]\nname = \"egg\"\nmesh = \"egg\"\ntransform = { scale = 0.1 }\n"
        .to_owned();
    // What is too small to be seen reaches nowhere.
    assert!(
        Scene::parse(
            Path::new("s.toml"),
            &(STAGE.to_owned() + &table(moved, "{ time = 0, scale = 0, translate = [9e12, 0, 0] }"))
        )
        .is_ok()
    );
    for (tables, words) in [
        (at_two("environment = true", "radiance", 1.0, -1.0), "environment: radiance [-1.0, -1.0, -1.0] is negative"),
        (at_two(grey, "emission", 0.0, -1.0), "material \"grey\": emission [-1.0, -1.0, -1.0] is negative"),
        (at_two(grey, "opacity", 1.0, -1.0), "material \"grey\": opacity is -1"),
        (at_two(bulb, "intensity", 1.0, -1.0), "light 0: "),
        (at_two("camera = true", "fov", 40.0, 200.0), "camera: fov is 200"),
        (at_two(moved, "scale", 1.0, 200e12), "instance 0 would reach beyond the limit of 1e12"),
        (
            table(moved, "{ time = 0, translate = [1, 2, 3] }, { time = 2.5, translate = [0, 200e12, 0] }"),
            "instance 0 would reach beyond the limit of 1e12",
        ),
        (
            egg + &table("instance = \"egg\"", "{ time = 0, scale = 1 }, { time = 2.5, scale = 1e300 }"),
            "instance 1 gets a transform with NaN or infinite numbers",
        ),
    ] {
        let line = error(&tables);
        assert!(line.contains("animation 1") && line.contains("key 2, at 2.5: ") && line.contains(words), "{line}");
        assert!(Scene::parse(Path::new("s.toml"), &(STAGE.to_owned() + &sound(&tables))).is_ok());
    }
    let warnings = |to: f64| {
        let text = STAGE.to_owned() + &at_two(grey, "color", 0.5, to);
        Scene::parse(Path::new("s.toml"), &text).unwrap().scene.warnings
    };
    assert_eq!(warnings(1.0), Vec::<String>::new());
    // Of metallic materials it is a factor.
    let tin = "[[material]]\nname = \"tin\"\ntype = \"metallic-roughness\"\n".to_owned();
    let text = STAGE.to_owned() + &tin + &at_two("material = \"tin\"", "specular", 1.0, 2.0);
    assert_eq!(Scene::parse(Path::new("s.toml"), &text).unwrap().scene.warnings, Vec::<String>::new());
    let found = warnings(1.5);
    assert_eq!(
        found,
        ["animation 1, key 2, at 2.5: material \"grey\": color [1.5, 1.5, 1.5] lies outside [0, 1]: clamped"]
    );
}
