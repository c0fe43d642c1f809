//! Tests that scenes are the same whether what instances place is baked into world space, as where nothing moves, or stored once.
use std::path::Path;
use tallow::layout::{ATTRIBUTE_COLORS, Triangle};
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
