//! Tests scenes in which nothing moves: what instances place is baked, where it is little, and looks as it did.
use crate::alike::alike;
use crate::support::{assert_silent, gpu, render};
use std::fs;
use tallow::gpu::Gpu;
use tallow::layout::{PixelStats, SPHERE};
use tallow::render::{Outputs, Renderer};
use tallow::scene::description::Transform;
use tallow::scene::{Loaded, Pose, SceneFile};

const WORLD: &str = "[camera]\nposition = [0.0, 1.5, 6.0]\ntarget = [0.0, 0.5, 0.0]\nfov = 45.0\n[environment]\n\
    [[light]]\ntype = 'directional'\ndirection = [0.4, -1.0, -0.3]\nirradiance = [3.0, 2.0, 1.0]\n\
    [[material]]\nname = 'red'\ncolor = [0.8, 0.1, 0.1]\n[[material]]\nname = 'metal'\ntype = 'conductor'\nalpha = 0.2\n\
    [[mesh]]\nname = 'floor'\nshape = 'rectangle'\ntransform = { rotate = [-90.0, 0.0, 0.0], scale = 4.0 }\n\
    [[mesh]]\nname = 'block'\nshape = 'cube'\nmaterial = 'red'\ntransform = { scale = [0.5, 0.7, 0.5] }\n\
    [[mesh]]\nname = 'ball'\nshape = 'sphere'\nsegments = 24\nmaterial = 'metal'\n\
    [[mesh]]\nname = 'exact'\nshape = 'sphere'\ntransform = { scale = 0.4 }\n";

/// A turned block, one in another material, a mirrored and a stretched ball, and two true spheres.
const PLACED: &str = "[[instance]]\nmesh = 'block'\ntransform = { translate = [-2.0, 0.7, 0.0], rotate = [0.0, 30.0, 0.0] }\n\
    [[instance]]\nmesh = 'ball'\ntransform = { translate = [0.6, 0.5, 0.8], scale = [0.5, 0.5, -0.5] }\n\
    [[instance]]\nmesh = 'block'\nmaterial = 'metal'\ntransform = { translate = [2.0, 0.5, -1.0], scale = 0.8 }\n\
    [[instance]]\nmesh = 'ball'\ntransform = { translate = [-0.5, 1.2, -1.0], scale = [0.4, 0.8, 0.4] }\n\
    [[instance]]\nmesh = 'exact'\ntransform = { translate = [-0.8, 0.4, 1.0] }\n\
    [[instance]]\nmesh = 'exact'\ntransform = { translate = [1.4, 1.5, 0.0], rotate = [10.0, 20.0, 30.0], scale = 2.0 }\n";

fn load(more: &str, still: bool) -> Loaded {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    fs::write(&path, format!("{WORLD}{more}")).unwrap();
    let mut file = SceneFile::open(&path).unwrap();
    if still {
        file.stays_still();
    }
    file.load().unwrap().with(|s| (s.width, s.height, s.spp, s.max_depth) = (64, 48, 16, 4))
}

/// The pixels, and the number of the object that each shows.
fn picture(gpu: &Gpu, scene: &Loaded) -> (Vec<PixelStats>, Vec<u32>) {
    let outputs = Outputs { guides: true, ..Outputs::default() };
    let renderer = Renderer::new(gpu, scene, &scene.settings, outputs).unwrap();
    let stats = render(gpu, &renderer);
    let guide = renderer.film().tiles[0].guide.read().unwrap();
    (stats, guide.iter().map(|guide| guide.object).collect())
}

#[test]
fn what_instances_place_is_baked_and_looks_the_same() {
    let gpu = gpu();
    let [placed, baked] = [false, true].map(|still| load(PLACED, still));
    assert!(placed.instances.len() == 7 && baked.instances.is_empty(), "{} instances", baked.instances.len());
    assert_eq!(placed.names.objects, baked.names.objects);
    let spheres = |scene: &Loaded| scene.triangles.iter().filter(|t| t.primitive & SPHERE != 0).count();
    assert_eq!([&placed, &baked].map(spheres), [1, 2]);
    let [(before, ids), (after, its)] = [&placed, &baked].map(|scene| picture(&gpu, scene));
    alike(&before, &after, 1).unwrap();
    let elsewhere = ids.iter().zip(&its).filter(|(a, b)| a != b).count();
    assert!(elsewhere * 200 <= ids.len(), "{elsewhere} of {} pixels show another object", ids.len());
    let moved = load(&PLACED.replace("0.7, 0.0]", "0.8, 0.0]"), true);
    assert!(alike(&before, &picture(&gpu, &moved).0, 1).is_err(), "control: a block that is placed elsewhere");
    assert_silent(&gpu);
}

#[test]
fn what_moves_or_is_much_is_not_baked() {
    let still = |more: &str| load(&format!("{PLACED}{more}"), true).instances.len();
    let trees = |count: u32| {
        let one = |i| format!("[[instance]]\nmesh = 'tree'\ntransform = {{ translate = [{i}, 0, 0] }}\n");
        let placed: String = (0..count).map(one).collect();
        format!("[[mesh]]\nname = 'tree'\nshape = 'sphere'\nsegments = 48\n{placed}")
    };
    let lamp = "[[light]]\nname = 'lamp'\ntype = 'point'\nposition = [0, 5, 0]\nintensity = 1.0\n";
    for (case, more, instances) in [
        ("a few trees", trees(30), 0),
        ("a forest", trees(120), 7 + 120),
        ("a mesh that moves", "[[mesh]]\nname = 'soft'\nshape = 'cube'\nmoving = true\n".to_owned(), 8),
        ("an ellipsoid", "[[instance]]\nmesh = 'exact'\ntransform = { scale = [1, 2, 1] }\n".to_owned(), 8),
        (
            "an animation",
            format!("{lamp}[[animation]]\nlight = 'lamp'\nkeys = [{{ time = 0.0, intensity = 1.0 }}]\n"),
            7,
        ),
    ] {
        assert_eq!(still(&more), instances, "{case}");
    }
}

/// Meshes whose coordinates are so small that products of three of them are no numbers of 32 bits, in metres of their instances.
#[test]
fn a_mesh_that_is_tiny_in_its_own_space_looks_as_one_that_is_not() {
    let gpu = gpu();
    let placed = |own: &str, scale: [&str; 3]| {
        let [block, ball, exact] = scale;
        let mesh = |name: &str, shape: &str| {
            format!("[[mesh]]\nname = '{name}'\n{shape}\nmaterial = 'red'\ntransform = {{ scale = {own} }}\n")
        };
        let at = |name: &str, x: f64, scale: &str| {
            format!(
                "[[instance]]\nname = '{name}'\nmesh = '{name}'\n\
                 transform = {{ translate = [{x}, 0.7, 0.5], rotate = [0, 30, 0], scale = {scale} }}\n"
            )
        };
        [
            mesh("a", "shape = 'cube'"),
            mesh("b", "shape = 'sphere'\nsegments = 24"),
            mesh("c", "shape = 'sphere'"),
            at("a", -1.5, block),
            at("b", 0.0, ball),
            at("c", 1.5, exact),
        ]
        .concat()
    };
    let [mut tiny, usual] = [("1e-15", ["5e14", "6e14", "7e14"]), ("1.0", ["0.5", "0.6", "0.7"])]
        .map(|(own, scale)| load(&placed(own, scale), false));
    assert!(tiny.warnings.is_empty() && tiny.instances.len() == usual.instances.len(), "{:?}", tiny.warnings);
    let [(found, ids), (expected, its)] = [&tiny, &usual].map(|scene| picture(&gpu, scene));
    alike(&found, &expected, 1).unwrap();
    assert!(its.iter().filter(|object| **object > 0).count() > 300, "control: they are seen");
    let elsewhere = ids.iter().zip(&its).filter(|(a, b)| a != b).count();
    assert!(elsewhere * 200 <= ids.len(), "{elsewhere} pixels show another object");
    // Their instances are placed as the file has them.
    let lifted = [5e14, 0., 0., -1.5, 0., 5e14, 0., 2.0, 0., 0., 5e14, 0.5, 0., 0., 0., 1.];
    let number = tiny.rig.placement("a").unwrap();
    tiny.apply(&Pose { instances: vec![(number, Transform::try_from(lifted).unwrap())], ..Pose::default() }).unwrap();
    let high = tiny.bounds[1][1];
    assert!((high - 2.5).abs() < 1e-4, "{high}");
    assert_silent(&gpu);
}
