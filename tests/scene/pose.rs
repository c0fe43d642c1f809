//! Tests that a scene in another pose is the scene that would have been loaded in that pose, and the messages about poses that
//! cannot be.
use crate::poses::{MOMENTS, Moment, at, pose};
use bytemuck::{Pod, cast_slice};
use glam::{DAffine3, DVec3, Vec3};
use std::path::Path;
use tallow::layout::{Instance, LIGHT_DIRECTIONAL, LIGHT_ENVIRONMENT};
use tallow::scene::description::Transform;
use tallow::scene::{MaterialChange, Pose, Scene, Vertices};

/// Bytes of all arrays that kernels read. Trees that were not built anew have another shape, and other nodes.
fn arrays(scene: &Scene) -> Vec<(&'static str, Vec<u8>)> {
    fn bytes<T: Pod>(values: &[T]) -> Vec<u8> {
        cast_slice(values).to_vec()
    }
    vec![
        ("nodes", bytes(&scene.nodes)),
        ("triangles", bytes(&scene.triangles)),
        ("shading", bytes(&scene.shading)),
        ("instances", bytes(&scene.instances.iter().map(|i| Instance { root: 0, ..*i }).collect::<Vec<_>>())),
        ("materials", bytes(&scene.materials)),
        ("lights", bytes(&scene.lights)),
        ("light_table", bytes(&scene.light_table)),
        ("light_nodes", bytes(&scene.light_nodes)),
        ("scale", bytes(&[scene.triangle_pdf_scale])),
        ("bounds", bytes(scene.bounds.as_flattened())),
        ("camera", bytes(&[scene.camera([4, 3]).unwrap()])),
    ]
}

fn differing(a: &Scene, b: &Scene) -> Vec<&'static str> {
    arrays(a).into_iter().zip(arrays(b)).filter(|(a, b)| a != b).map(|(a, _)| a.0).collect()
}

fn none() -> Vec<&'static str> {
    Vec::new()
}

#[test]
fn a_pose_has_the_arrays_of_a_scene_that_was_loaded_in_it() {
    let mut scene = at(&Moment::default()).scene;
    for moment in MOMENTS.iter().chain(MOMENTS.iter().rev()) {
        scene.apply(&pose(&scene, moment, 0.0)).unwrap();
        scene.check().unwrap();
        let fresh = at(moment).scene;
        // Room that was left for larger trees moves the nodes behind it.
        let found = differing(&scene, &fresh);
        assert!(found.iter().all(|name| *name == "nodes"), "{moment:?}: {found:?}");
        let other = at(&Moment { turn: 0.5, ..*moment }).scene;
        assert!(differing(&scene, &other).contains(&"instances"), "control");
    }
}

#[test]
fn a_refitted_mesh_keeps_its_lights_and_instances_and_the_way_does_not_count() {
    let mut scene = at(&Moment::default()).scene;
    let size = [4, 3];
    for moment in &MOMENTS {
        let change = scene.apply(&pose(&scene, moment, f32::INFINITY)).unwrap();
        assert!(change.deformed.iter().all(|d| !d.rebuilt && d.cost > 0.0), "{change:?}");
        scene.check().unwrap();
        let found = differing(&scene, &at(moment).scene);
        assert!(found.iter().all(|name| ["nodes", "triangles", "shading"].contains(name)), "{moment:?}: {found:?}");
        // Straight from how it was loaded it is known by the same fingerprint.
        let mut straight = at(&Moment::default()).scene;
        straight.apply(&pose(&straight, moment, f32::INFINITY)).unwrap();
        assert_eq!(scene.fingerprint(size).unwrap(), straight.fingerprint(size).unwrap());
        assert_eq!(differing(&scene, &straight), none());
        let loaded = at(&Moment::default()).scene;
        assert_ne!(scene.fingerprint(size).unwrap(), loaded.fingerprint(size).unwrap());
    }
}

/// A scene that is where it was loaded is that scene: its files can be resumed, however it came there.
#[test]
fn a_pose_that_changes_nothing_leaves_the_scene_what_it_is() {
    let text = "[camera]\nworld_from_camera = [1,0,0,0, 0,1,0,0, 0,0,1,9, 0,0,0,1]\n[environment]\nradiance = 1\n\
        [[mesh]]\nname = 'box'\nshape = 'cube'\n[[instance]]\nname = 'door'\nmesh = 'box'\n";
    let free = text.replace("world_from_camera = [1,0,0,0, 0,1,0,0, 0,0,1,9, 0,0,0,1]", "");
    let (mut scene, mut framed) = (scene_of(text), scene_of(&free));
    let size = [4, 3];
    let known = scene.fingerprint(size).unwrap();
    let is_known = |scene: &Scene| scene.fingerprint(size).unwrap() == known;
    scene.apply(&Pose::default()).unwrap();
    assert!(is_known(&scene), "a pose that says nothing");
    scene.apply(&Pose { camera: Some(scene.view.clone()), ..Pose::default() }).unwrap();
    assert!(is_known(&scene), "the same camera");
    let to = |x: f64| Pose {
        instances: vec![(
            0,
            Transform::try_from([1., 0., 0., x, 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.]).unwrap(),
        )],
        ..Pose::default()
    };
    // A camera with a matrix does not look elsewhere because something moves; one that frames the scene does, if only from a target.
    let mut aimed = scene_of(&free.replace("[camera]", "[camera]\ntarget = [0, 0, 0]"));
    assert!(!scene.apply(&to(4.0)).unwrap().framing && framed.apply(&to(4.0)).unwrap().framing);
    assert!(aimed.apply(&to(0.25)).unwrap().framing, "however little the film's other shape would show of it");
    assert!(!is_known(&scene), "control");
    scene.apply(&to(0.0)).unwrap();
    assert!(is_known(&scene), "away and back");
}

fn scene_of(text: &str) -> Scene {
    Scene::parse(Path::new("door.toml"), text).unwrap().scene
}

/// Pixels of a scene at rest keep all that they have, whatever is said again of where things are.
#[test]
fn the_same_pose_again_changes_nothing() {
    for moment in &MOMENTS {
        let mut scene = at(&Moment::default()).scene;
        let to = pose(&scene, moment, 1.4);
        assert!(!scene.apply(&to).unwrap().is_of_camera_alone(), "control");
        let before = arrays(&scene);
        let again = scene.apply(&to).unwrap();
        assert!(again.is_of_camera_alone(), "{moment:?}: {again:?}");
        assert!(arrays(&scene) == before, "{moment:?}");
    }
}

#[test]
fn a_tree_over_lamps_follows_them() {
    let at = |x: f64, emission: f32| {
        let text = format!(
            "[[material]]\nname = 'lamp'\nemission = {emission}\n[[mesh]]\nname = 'ball'\nshape = 'sphere'\nsegments = 8\n\
             material = 'lamp'\n[[instance]]\nname = 'one'\nmesh = 'ball'\ntransform = {{ translate = [{x:?}, 2.0, 0.0] }}\n\
             [[instance]]\nmesh = 'ball'\ntransform = {{ translate = [-5.0, 2.0, 0.0] }}\n\
             [environment]\nradiance = 0.1\n"
        );
        Scene::parse(Path::new("lamps.toml"), &text).unwrap().scene
    };
    let mut scene = at(0.0, 3.0);
    assert!(scene.has_light_tree() && scene.light_nodes.len() > scene.lights.len());
    let to = |x: f64| Transform::try_from([1., 0., 0., x, 0., 1., 0., 2., 0., 0., 1., 0., 0., 0., 0., 1.]).unwrap();
    scene.apply(&Pose { instances: vec![(0, to(4.0))], ..Pose::default() }).unwrap();
    assert_eq!(scene.light_nodes, at(4.0, 3.0).light_nodes);
    assert_ne!(scene.light_nodes, at(0.0, 3.0).light_nodes, "control");
    // The sky alone is left, and the tree has no light.
    let dark = MaterialChange { emission: Some([0.0; 3]), ..MaterialChange::default() };
    scene.apply(&Pose { materials: vec![(0, dark)], ..Pose::default() }).unwrap();
    scene.check().unwrap();
    assert_eq!(scene.light_nodes.iter().map(|n| n.power).collect::<Vec<_>>(), [0.0, 1.0]);
    let lit = MaterialChange { emission: Some([3.0; 3]), ..MaterialChange::default() };
    scene.apply(&Pose { materials: vec![(0, lit)], ..Pose::default() }).unwrap();
    assert_eq!(scene.light_nodes, at(4.0, 3.0).light_nodes);
}

/// A key that says what the table says changes nothing.
#[test]
fn numbers_of_materials_are_those_of_their_tables() {
    let text = "[camera]\nposition = [0, 0, 9]\n[environment]\nradiance = 1\n\
        [[material]]\nname = 'plastic'\ntype = 'metallic-roughness'\nmetallic = 0\nspecular = [1.5, 1.0, 0.5]\nior = 1.8\n\
        [[material]]\nname = 'sign'\ntype = 'metallic-roughness'\nunlit = true\ncolor = [0.5, 0.25, 1.0]\n\
        [[material]]\nname = 'copper'\ntype = 'conductor'\nmetal = 'Cu'\nspecular = 0.8\nalpha = 0.2\nalpha_v = 0.4\n\
        [[mesh]]\nshape = 'sphere'\nmaterial = 'plastic'\n[[mesh]]\nshape = 'sphere'\nmaterial = 'sign'\n\
        [[mesh]]\nshape = 'sphere'\nmaterial = 'copper'\n";
    let mut scene = Scene::parse(Path::new("three.toml"), text).unwrap().scene;
    let before = scene.materials.clone();
    let changes = [
        MaterialChange { specular: Some([1.5, 1.0, 0.5]), ..MaterialChange::default() },
        MaterialChange { color: Some([0.5, 0.25, 1.0]), ..MaterialChange::default() },
        MaterialChange { specular: Some([0.8; 3]), alpha: Some(0.2), ..MaterialChange::default() },
    ];
    let pose = |factor: f32| {
        let dimmed = |c: MaterialChange| MaterialChange {
            specular: c.specular.map(|v| v.map(|v| factor * v)),
            color: c.color.map(|v| v.map(|v| factor * v)),
            ..c
        };
        Pose { materials: changes.into_iter().map(dimmed).enumerate().collect(), ..Pose::default() }
    };
    scene.apply(&pose(1.0)).unwrap();
    assert_eq!(scene.materials, before);
    let sign = MaterialChange { emission: Some([0.0, 5.0, 0.0]), ..MaterialChange::default() };
    scene.apply(&Pose { materials: vec![(1, sign)], ..Pose::default() }).unwrap();
    assert_eq!(scene.materials, before, "what is unlit shows its color alone, as of its table");
    scene.apply(&pose(0.5)).unwrap();
    let halved = |i: usize| before[i].specular.map(|v| 0.5 * v);
    assert_eq!([scene.materials[0].specular, scene.materials[2].specular], [halved(0), halved(2)], "control");
    assert_eq!((scene.materials[1].emission, scene.materials[1].base_color), ([0.25, 0.125, 0.5], [0.0; 3]));
}

/// Checks that all corners below a node lie in the boxes of its children, which reach beyond them by two cells of their grid, and what
/// boxes are grown by, at most; returns the corners.
fn check_boxes(scene: &Scene, index: u32) -> Vec<DVec3> {
    let node = &scene.nodes[index as usize];
    let bytes = |words: [u32; 2]| bytemuck::cast::<_, [u8; 8]>(words);
    let [x, y, z, inner] = node.e_imask.to_le_bytes();
    let cell = DVec3::from([x, y, z].map(|e| f64::from(f32::from_bits(u32::from(e) << 23))));
    let (mut next, mut all) = (node.child_base, Vec::new());
    for (slot, meta) in bytes(node.meta).into_iter().enumerate().filter(|(_, meta)| *meta != 0) {
        let corners = if inner >> slot & 1 == 1 {
            next += 1;
            check_boxes(scene, next - 1)
        } else {
            let first = (node.primitive_base + u32::from(meta & 31)) as usize;
            let leaf = &scene.triangles[first..first + (meta >> 5).count_ones() as usize];
            leaf.iter().flat_map(|t| [t.v0, t.v1, t.v2].map(|p| Vec3::from(p).as_dvec3())).collect()
        };
        let end = |words: [[u32; 2]; 3]| {
            Vec3::from(node.p).as_dvec3() + cell * DVec3::from(words.map(|w| f64::from(bytes(w)[slot])))
        };
        let (low, high) = (end([node.min_x, node.min_y, node.min_z]), end([node.max_x, node.max_y, node.max_z]));
        let least = corners.iter().fold(DVec3::INFINITY, |low, p| low.min(*p));
        let most = corners.iter().fold(DVec3::NEG_INFINITY, |high, p| high.max(*p));
        assert!(low.cmple(least).all() && most.cmple(high).all(), "a corner is outside: {low} {least} {most} {high}");
        let (spare, grown) = ((least - low).max(high - most), 1e-6 * least.abs().max(most.abs()).max_element());
        assert!(spare.cmple(2.0 * cell + grown).all(), "larger than what it holds by {spare}, in cells of {cell}");
        all.extend(corners);
    }
    all
}

/// Rays seldom meet what lies between a corner and a box that is a cell too small; the boxes themselves tell.
#[test]
fn refitted_boxes_hold_what_is_in_them_and_little_more() {
    let mut scene = at(&Moment::default()).scene;
    let mesh = scene.rig.mesh("cloth").unwrap();
    let check = |scene: &Scene| {
        let cloth = scene.instances.iter().find(|i| scene.names.objects[i.object as usize] == "cloth").unwrap();
        assert_eq!(check_boxes(scene, cloth.root).len(), 3 * 2 * 23 * 23);
    };
    check(&scene);
    for moment in &MOMENTS {
        scene.apply(&pose(&scene, moment, f32::INFINITY)).unwrap();
        check(&scene);
    }
    let mut random = fastrand::Rng::with_seed(11);
    for scale in [1.0, 1e-3, 3e4] {
        let positions = (0..24 * 24).map(|_| std::array::from_fn(|_| scale * (random.f32() + 0.2))).collect();
        let meshes = vec![(mesh, Vertices { positions, ..Vertices::default() })];
        scene.apply(&Pose { meshes, rebuild_above: f32::INFINITY, ..Pose::default() }).unwrap();
        check(&scene);
    }
}

#[test]
fn sun_and_sky_shine_where_all_is_hidden() {
    let text = "[[mesh]]\nname = 'a'\nshape = 'cube'\nmoving = true\n[environment]\nradiance = 0.5\n\
                [[light]]\ntype = 'directional'\ndirection = [0, -1, 0]\nirradiance = 1\n";
    let mut scene = Scene::parse(std::path::Path::new("scene.toml"), text).unwrap().scene;
    let before = scene.lights.clone();
    assert_eq!(before.iter().map(|l| l.kind).collect::<Vec<_>>(), [LIGHT_DIRECTIONAL, LIGHT_ENVIRONMENT]);
    let sized = |scale: f64| {
        let mut rows = [0.0; 16];
        [0, 5, 10].iter().for_each(|&i| rows[i] = scale);
        rows[15] = 1.0;
        Pose { instances: vec![(0, Transform::try_from(rows).unwrap())], ..Pose::default() }
    };
    for scale in [0.0, 1.0, 0.0] {
        scene.apply(&sized(scale)).unwrap();
        assert_eq!((scene.seen_instances(), &scene.lights), (usize::from(scale > 0.0), &before));
    }
}

#[test]
fn a_tree_that_has_become_bad_is_built_anew() {
    let mut scene = at(&Moment::default()).scene;
    let mesh = scene.rig.mesh("cloth").unwrap();
    let mut positions: Vec<[f32; 3]> = Vec::new();
    let mut random = fastrand::Rng::with_seed(1);
    positions.resize_with(24 * 24, || std::array::from_fn(|_| random.f32()));
    let to = Vertices { positions, ..Vertices::default() };
    let pose = |to: &Vertices| Pose { meshes: vec![(mesh, to.clone())], ..Pose::default() };
    let first = scene.apply(&pose(&to)).unwrap().deformed[0];
    assert!(first.rebuilt && first.cost > 1.4, "{first:?}");
    scene.check().unwrap();
    let mut near = to;
    near.positions[0][0] += 1e-4;
    let second = scene.apply(&pose(&near)).unwrap().deformed[0];
    assert!(!second.rebuilt && (second.cost - 1.0).abs() < 1e-3, "{second:?}");
}

#[test]
fn a_mesh_that_shrinks_to_nothing_or_turns_inside_out_comes_back() {
    let mut scene = at(&Moment::default()).scene;
    let back = |scene: &Scene| pose(scene, &Moment::default(), 0.0);
    scene.apply(&back(&scene)).unwrap();
    let whole = scene.clone();
    let (number, cloth) = back(&scene).meshes.remove(0);
    let scales: [[f32; 3]; 6] =
        [[0.0; 3], [1.0, -1.0, 1.0], [0.0, 1.0, 1.0], [-1.0; 3], [1e-30; 3], [f32::MIN_POSITIVE, 0.0, 1e9]];
    for rebuild_above in [f32::INFINITY, 1.4, 0.0] {
        for by in scales {
            let scaled = |v: &[f32; 3]| std::array::from_fn(|axis| v[axis] * by[axis]);
            let positions = cloth.positions.iter().map(scaled).collect();
            // Normals of no length at all are repaired, as those of files are.
            let normals = cloth.normals.iter().map(scaled).collect();
            let to = Vertices { positions, normals, ..Vertices::default() };
            let pose = Pose { meshes: vec![(number, to)], rebuild_above, ..Pose::default() };
            let change = scene.apply(&pose).unwrap();
            scene.check().unwrap();
            assert!(change.deformed.iter().all(|d| d.cost.is_finite()), "{by:?}: {change:?}");
            let finite = |v: [f32; 3]| v.iter().all(|v| v.is_finite());
            assert!(scene.bounds.into_iter().all(finite) && scene.nodes.iter().all(|n| finite(n.p)), "{by:?}");
            assert!(scene.lights.iter().all(|light| light.probability.is_finite()), "{by:?}");
        }
    }
    scene.apply(&back(&scene)).unwrap();
    let found = differing(&scene, &whole);
    assert!(found.iter().all(|name| *name == "nodes"), "{found:?}");
}

#[test]
fn what_is_hidden_comes_back() {
    let mut scene = at(&Moment::default()).scene;
    let whole = scene.clone();
    let lights = scene.lights.len();
    scene.large_lamps = true; // the panel is none
    let gone = Transform::from(DAffine3::ZERO);
    let hide = Pose { instances: (0..3).map(|i| (i, gone)).collect(), ..Pose::default() };
    scene.apply(&hide).unwrap();
    scene.check().unwrap();
    assert_eq!(scene.lights.len(), lights - 2, "the panel's two triangles shine no more");
    assert!(scene.large_lamps, "lamps are sampled as the compiled kernels do, whatever is in view");
    let tiny = Transform::try_from([1e-14, 0., 0., 0., 0., 1e-14, 0., 0., 0., 0., 1e-14, 0., 0., 0., 0., 1.]).unwrap();
    scene.apply(&Pose { instances: vec![(0, tiny)], ..Pose::default() }).unwrap();
    scene.apply(&pose(&scene, &Moment::default(), 1.4)).unwrap();
    assert_eq!(differing(&scene, &whole), none());
}

/// A cube of this transform, and one that a pose moves.
fn beside(cube: &str, edge: f64) -> Scene {
    let text = format!(
        "[camera]\nposition = [0, 1, 4]\ntarget = [0, 0, 0]\n[[mesh]]\nname = 'large'\nshape = 'cube'\n\
         transform = {{ scale = {edge:?} }}\n[[mesh]]\nname = 'small'\nshape = 'cube'\n[[instance]]\nmesh = 'large'\n\
         transform = {{ {cube} }}\n[[instance]]\nmesh = 'small'\n"
    );
    Scene::parse(std::path::Path::new("scene.toml"), &text).unwrap().scene
}

/// The second cube this far away.
fn away(x: f64) -> Pose {
    let rows = [1., 0., 0., x, 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];
    Pose { instances: vec![(1, Transform::try_from(rows).unwrap())], ..Pose::default() }
}

/// Such a pose hides what it makes too small to see, and no later one does.
#[test]
fn a_scene_that_grows_and_shrinks_again_is_as_before() {
    let mut scene = beside("scale = 1e-10", 1.0);
    scene.apply(&away(2.0)).unwrap();
    let (before, known) = (arrays(&scene), scene.fingerprint([4, 3]).unwrap());
    scene.apply(&away(1e4)).unwrap();
    assert_eq!(scene.seen_instances(), 1, "control: less than a 1e-13 of the scene");
    scene.apply(&away(2.0)).unwrap();
    assert!(arrays(&scene) == before && scene.fingerprint([4, 3]).unwrap() == known);
}

/// In nanometres: it fills the picture.
#[test]
fn what_is_large_and_out_of_reach_is_refused_as_by_the_loader() {
    let mut scene = beside("scale = 1e-9", 1e9);
    scene.apply(&away(2.0)).unwrap();
    let before = arrays(&scene);
    let said = scene.apply(&away(1e4)).unwrap_err().to_string();
    assert!(
        said.contains("an instance of \"large\": seen from it, the scene reaches beyond the limit of 1e12"),
        "{said}"
    );
    assert!(arrays(&scene) == before);
}

#[test]
fn poses_that_cannot_be_are_one_line_and_change_nothing() {
    let mut scene = at(&Moment::default()).scene;
    let (before, mesh) = (arrays(&scene), scene.rig.mesh("cloth").unwrap());
    let place = |number, at| Pose { instances: vec![(number, Transform::from(at))], ..Pose::default() };
    let deform = |mesh, positions: Vec<[f32; 3]>, normals| Pose {
        meshes: vec![(mesh, Vertices { positions, normals, ..Vertices::default() })],
        ..Pose::default()
    };
    let still = vec![[0.0; 3]; 576];
    let twice = (mesh, Vertices { positions: still.clone(), ..Vertices::default() });
    let mut broken = still.clone();
    broken[99][1] = f32::NAN;
    let mut far = still.clone();
    far[3][0] = 2e12;
    let cases = [
        (place(0, DAffine3::NAN), "instance 0 gets a transform with NaN"),
        (place(9, DAffine3::IDENTITY), "instance 9 of 4"),
        (deform(mesh, still[..9].to_vec(), Vec::new()), "has 576 vertices, not 9"),
        (deform(mesh, still.clone(), vec![[0.0; 3]; 5]), "576 positions but 5 normals"),
        (deform(mesh, broken, Vec::new()), "a vertex with a NaN"),
        (deform(mesh, far, Vec::new()), "the limit is 1e12"),
        (deform(0, still, Vec::new()), "mesh 0 cannot be deformed"),
        (Pose { meshes: vec![twice.clone(), twice], ..Pose::default() }, "mesh 4 is posed twice: keep one"),
        (Pose { rebuild_above: f32::NAN, ..Pose::default() }, "rebuild_above is NaN"),
        (Pose { rebuild_above: -1.0, ..Pose::default() }, "rebuild_above is -1"),
        (Pose { materials: vec![(7, Default::default())], ..Pose::default() }, "material 7 of"),
        (Pose { lights: vec![(0, Default::default())], ..Pose::default() }, "light 0: needs intensity"),
        (Pose { lights: vec![(1, Default::default())], ..Pose::default() }, "light 1 of 1: there is none"),
    ];
    for (pose, line) in cases {
        let error = scene.apply(&pose).unwrap_err();
        let said = error.to_string();
        assert!(said.contains(line) && !said.contains('\n') && error.exit_code() == 2, "{said}");
        assert!(arrays(&scene) == before, "{said}");
    }
}

#[test]
fn the_light_changes_where_all_meshes_are_empty() {
    use tallow::scene::EnvironmentChange;
    use tallow::scene::description::{Description, EnvironmentTable, LightTable, Mesh, MeshTable, Rgb};
    let light = |strength| LightTable {
        position: Some([0.0; 3]),
        intensity: Some(Rgb([strength; 3])),
        ..LightTable::default()
    };
    for moving in [false, true] {
        let empty = MeshTable { data: Some(Mesh::default()), moving, ..MeshTable::default() };
        let environment = Some(EnvironmentTable::default());
        let description =
            Description { mesh: vec![empty], environment, light: vec![light(1.0)], ..Description::default() };
        let mut scene = Scene::build(&description).unwrap().scene;
        let environment = Some(EnvironmentChange { radiance: Some([2.0; 3]), rotation: None });
        scene.apply(&Pose { environment, lights: vec![(0, light(3.0))], ..Pose::default() }).unwrap();
        assert_eq!(scene.lights.iter().map(|light| light.value[0]).collect::<Vec<_>>(), [3.0, 2.0]);
    }
    let said = Scene::default().apply(&Pose { lights: vec![(0, light(1.0))], ..Pose::default() }).unwrap_err();
    assert!(said.to_string().contains("neither loaded nor built"), "{said}");
}

#[test]
fn a_scene_whose_centre_comes_to_lie_on_its_camera_is_refused() {
    let text = "[camera]\nposition = [0, 0, 5]\n[[mesh]]\nshape = 'cube'\nmoving = true\n";
    let mut scene = Scene::parse(std::path::Path::new("scene.toml"), text).unwrap().scene;
    let before = arrays(&scene);
    let at = |z: f64| {
        let rows = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., z, 0., 0., 0., 1.];
        Pose { instances: vec![(0, Transform::try_from(rows).unwrap())], ..Pose::default() }
    };
    let error = scene.apply(&at(5.0)).unwrap_err();
    let said = error.to_string();
    assert!(said.contains("camera: position and target are the same point") && error.exit_code() == 2, "{said}");
    assert!(arrays(&scene) == before);
    scene.apply(&at(4.0)).unwrap();
    scene.view.position = Some([0.0, 0.0, 4.0]);
    let error = scene.camera([4, 3]).unwrap_err();
    assert!(error.to_string().starts_with("camera: ") && error.exit_code() == 2, "{error}");
}

/// A square with tangents that turn by `angle` about its normal.
fn mapped(angle: f32) -> (Scene, Vertices) {
    use tallow::scene::description::{Bitmap, Description, MaterialTable, Mesh, MeshTable};
    let (sin, cos) = angle.sin_cos();
    let positions = vec![[0.0, 0.0, angle], [1.0, 0.0, 0.0], [1.0, 1.0, angle], [0.0, 1.0, 0.0]];
    let mesh = Mesh {
        positions: positions.clone(),
        normals: vec![[0.0, 0.0, 1.0]; 4],
        uvs: positions.iter().map(|p| [p[0], p[1]]).collect(),
        colors: vec![[0.5; 4]; 4],
        tangents: vec![[cos, sin, 0.0, 1.0]; 4],
        indices: vec![0, 1, 2, 0, 2, 3],
        ..Mesh::default()
    };
    let Mesh { normals, tangents, .. } = mesh.clone();
    let material = MaterialTable { name: "m".into(), normal_map: Some("n".into()), ..MaterialTable::default() };
    let table = MeshTable { data: Some(mesh), material: Some("m".into()), moving: true, ..MeshTable::default() };
    let bitmap = Bitmap { name: "n".into(), width: 1, height: 1, rgba: vec![[128, 128, 255, 255]].into() };
    let (mesh, material, bitmap) = (vec![table], vec![material], vec![bitmap]);
    let loaded = Scene::build(&Description { mesh, material, bitmap, ..Description::default() }).unwrap();
    (loaded.scene, Vertices { positions, normals, tangents, ..Vertices::default() })
}

#[test]
fn tangents_follow_a_deformed_mesh() {
    let (mut scene, _) = mapped(0.0);
    let (fresh, to) = mapped(0.7);
    let before = scene.texels.clone();
    let deform = |to: Vertices| Pose { meshes: vec![(0, to)], ..Pose::default() };
    let change = scene.apply(&deform(Vertices { tangents: Vec::new(), ..to.clone() })).unwrap();
    assert!(change.texels.is_empty() && scene.texels == before, "none are given: they stay");
    let change = scene.apply(&deform(to.clone())).unwrap();
    assert_eq!(scene.texels, fresh.texels);
    // Of two triangles the colours and then the tangents, of which the latter have changed: from the first to the last word.
    assert!(change.texels.len() == 1 && change.texels[0] == (1 + 6..1 + 9 + 9), "{:?}", change.texels);
    assert_ne!(scene.texels, before, "control");
    let few = Vertices { tangents: to.tangents[..3].to_vec(), ..to };
    let said = scene.apply(&deform(few)).unwrap_err().to_string();
    assert!(said.contains("4 positions but 3 tangents"), "{said}");
}
