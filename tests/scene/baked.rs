//! Tests that scenes are the same whether what instances place is baked into world space, as where nothing moves, or stored once.
use std::path::Path;
use tallow::layout::{ATTRIBUTE_COLORS, Triangle};
use tallow::scene::description::Transform;
use tallow::scene::{Loaded, Pose, Scene, SceneFile, Vertices};

/// The scene as `tallow sequence` has it, and as `tallow render` does.
fn both(folder: &Path, text: &str) -> [Loaded; 2] {
    let path = folder.join("scene.toml");
    std::fs::write(&path, text).unwrap();
    [false, true].map(|still| {
        let mut file = SceneFile::open(&path).unwrap();
        if still {
            file.stays_still();
        }
        file.load().unwrap()
    })
}

/// All triangles that are seen, with the number of their object and how the mesh says that they are shaded.
fn triangles(scene: &Scene) -> Vec<(Triangle, u32, u32)> {
    let meshes = scene.meshes();
    let attributes = |i: usize| scene.shading.get(i).map_or(0, |s| s.attributes);
    let of_mesh = |mesh: usize, first: u32| {
        meshes[mesh].clone().map(move |i| (scene.triangles[i], first + scene.triangles[i].object, attributes(i)))
    };
    match scene.meshes_of_instances().unwrap() {
        none if none.is_empty() => of_mesh(0, 0).collect(),
        all => all.into_iter().zip(&scene.instances).flat_map(|(mesh, i)| of_mesh(mesh, i.object)).collect(),
    }
}

const COLOURED: &str = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nf 1 2 3\n";
const LEAVES: &str = "[[material]]\nname = 'gold'\ntype = 'conductor'\n\
    [[instance]]\nmesh = 'leaf'\nmaterial = 'gold'\ntransform = { translate = [2, 0, 0] }\n\
    [[instance]]\nmesh = 'leaf'\n[[instance]]\nmesh = 'leaf'\nmaterial = 'gold'\ntransform = { translate = [4, 0, 0] }\n";

/// By object, whether the colours of vertices tint it; those in other materials come last.
fn tinted(scene: &Scene) -> Vec<bool> {
    let mut all: Vec<_> =
        triangles(scene).iter().map(|(_, object, has)| (*object, has & ATTRIBUTE_COLORS != 0)).collect();
    all.sort_unstable();
    all.into_iter().map(|(_, tinted)| tinted).collect()
}

#[test]
fn colours_of_obj_vertices_tint_no_material_that_an_instance_gives() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("leaf.obj"), COLOURED).unwrap();
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n\
        property list uchar int vertex_indices\nend_header\n0 0 0 255 0 0\n1 0 0 0 255 0\n0 1 0 0 0 255\n3 0 1 2\n";
    std::fs::write(folder.path().join("leaf.ply"), ply).unwrap();
    for (file, colours) in [("obj", [true, false, false]), ("ply", [true; 3])] {
        let text = format!("[[mesh]]\nname = 'leaf'\nfile = 'leaf.{file}'\n{LEAVES}");
        for (scene, kind) in both(folder.path(), &text).iter().zip(["stored", "baked"]) {
            assert_eq!(tinted(scene), colours, "{file}, {kind}");
        }
    }
}

/// It is stored twice then, and both are deformed.
#[test]
fn a_moving_mesh_that_some_instances_show_in_its_colours_is_deformed_in_all() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("leaf.obj"), COLOURED).unwrap();
    let text = format!("[[mesh]]\nname = 'leaf'\nfile = 'leaf.obj'\nmoving = true\n{LEAVES}");
    let [mut scene, _] = both(folder.path(), &text);
    assert_eq!((tinted(&scene), scene.triangles.len()), (vec![true, false, false], 2));
    let leaf = scene.rig.mesh("leaf").unwrap();
    let bent = Vertices { positions: vec![[0.0; 3], [1.0, 0.0, 0.5], [0.0, 3.0, 0.0]], ..Vertices::default() };
    let change = scene.apply(&Pose { meshes: vec![(leaf, bent)], ..Pose::default() }).unwrap();
    assert!(scene.triangles.iter().all(|t| t.v2 == [0.0, 3.0, 0.0]), "{:?}", scene.triangles);
    assert!(change.deformed.iter().map(|d| d.mesh).eq([leaf; 2]) && scene.bounds[1][1] == 3.0, "{change:?}");
}

/// Whether two boxes are the same but for rounding.
fn close(a: [[f32; 3]; 2], b: [[f32; 3]; 2]) -> bool {
    a.as_flattened().iter().zip(b.as_flattened()).all(|(a, b)| (a - b).abs() < 1e-5 * (1.0 + a.abs()))
}

#[test]
fn bounds_are_those_of_what_is_placed_and_so_are_default_heights_of_bumps() {
    let folder = tempfile::tempdir().unwrap();
    image::GrayImage::new(2, 2).save(folder.path().join("bump.png")).unwrap();
    std::fs::write(folder.path().join("stone.mtl"), "newmtl stone\nmap_bump bump.png\n").unwrap();
    let stone =
        "mtllib stone.mtl\nv 0 0 1\nv 1 0 -1\nv -1 0 -1\nv 0 2 0\nvt 0 0\nusemtl stone\nf 1/1 2/1 4/1\nf 2/1 3/1 4/1\n";
    std::fs::write(folder.path().join("stone.obj"), stone).unwrap();
    let placed = |angle: i32| {
        format!(
            "[[mesh]]\nname = 'stone'\nfile = 'stone.obj'\n[[mesh]]\nname = 'ball'\nshape = 'sphere'\n\
             [[mesh]]\nshape = 'sphere'\nsegments = 40\nname = 'round'\n\
             [[instance]]\nname = 'first'\nmesh = 'stone'\ntransform = {{ rotate = [30, {angle}, 45], translate = [3, 0, 0] }}\n\
             [[instance]]\nmesh = 'stone'\ntransform = {{ rotate = [0, 70, -20], scale = [1, 2, 1], translate = [-3, 0, 1] }}\n\
             [[instance]]\nmesh = 'ball'\ntransform = {{ rotate = [45, 45, 45], translate = [0, 0, 2] }}\n\
             [[instance]]\nmesh = 'round'\ntransform = {{ rotate = [45, 45, 0], scale = 2, translate = [0, 1, -2] }}\n"
        )
    };
    let [mut stored, baked] = both(folder.path(), &placed(60));
    assert!(stored.instances.len() == 4 && baked.instances.is_empty());
    assert!(close(stored.bounds, baked.bounds), "{:?} is not {:?}", stored.bounds, baked.bounds);
    let heights = [&stored, &baked].map(|scene| scene.materials.iter().map(|m| m.bump_scale).fold(0.0, f32::max));
    assert!(heights[0] > 0.0 && (heights[0] / heights[1] - 1.0).abs() < 1e-5, "{heights:?}");
    // In another pose, too.
    let [turned, fixed] = both(folder.path(), &placed(200));
    assert!(!close(stored.bounds, turned.bounds), "control");
    let there = glam::DAffine3::from_mat4(
        glam::Mat4::from_cols_array_2d(&{
            let i = turned.instances[turned.instance_numbers().iter().position(|n| *n == 0).unwrap()];
            [i.world0, i.world1, i.world2, [0.0, 0.0, 0.0, 1.0]]
        })
        .transpose()
        .as_dmat4(),
    );
    let first = stored.rig.placement("first").unwrap();
    stored.apply(&Pose { instances: vec![(first, Transform::from(there))], ..Pose::default() }).unwrap();
    assert!(close(stored.bounds, fixed.bounds), "{:?} is not {:?}", stored.bounds, fixed.bounds);
}

#[test]
fn a_scene_too_small_for_rays_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let warned = |scale: &str| {
        let text = format!("[[mesh]]\nshape = 'cube'\ntransform = {{ scale = {scale} }}\n");
        both(folder.path(), &text)
            .map(|scene| scene.warnings.iter().any(|w| w.contains("choose a smaller unit of length")))
    };
    assert_eq!((warned("1e-12"), warned("1e-6")), ([true; 2], [false; 2]));
}

/// One instance among others is no larger than what rounding leaves of its place: it is not seen.
#[test]
fn an_instance_too_small_to_be_seen_refuses_no_scene() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("leaf.obj"), COLOURED).unwrap();
    std::fs::write(folder.path().join("flat.obj"), "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n").unwrap();
    for scale in ["1e-8", "1e-13"] {
        let text = format!(
            "[[mesh]]\nname = 'leaf'\nfile = 'leaf.obj'\n[[instance]]\nname = 'far'\nmesh = 'leaf'\n\
             transform = {{ scale = {scale}, translate = [5, 0, 0] }}\n[[instance]]\nmesh = 'leaf'\n"
        );
        let [mut stored, baked] = both(folder.path(), &text);
        assert_eq!(baked.triangles.len(), 1, "{scale}");
        assert_eq!(stored.seen_instances(), if scale == "1e-13" { 1 } else { 2 }, "{scale}");
        // It can grow.
        let far = stored.rig.placement("far").unwrap();
        let moved = Transform::from(glam::DAffine3::from_translation(glam::DVec3::X * 7.0));
        stored.apply(&Pose { instances: vec![(far, moved)], ..Pose::default() }).unwrap();
        assert_eq!((stored.seen_instances(), stored.bounds[1][0]), (2, 8.0), "{scale}");
    }
    // A file without any surface is at fault wherever it is placed.
    let text = "[[mesh]]\nname = 'flat'\nfile = 'flat.obj'\n[[instance]]\nmesh = 'flat'\n";
    std::fs::write(folder.path().join("scene.toml"), text).unwrap();
    for still in [false, true] {
        let mut file = SceneFile::open(&folder.path().join("scene.toml")).unwrap();
        if still {
            file.stays_still();
        }
        assert!(file.load().is_err_and(|e| e.to_string().contains("has no triangles")), "{still}");
    }
}
