//! Every OBJ below TALLOW_DATA/scenes loads with its textures; prints what loading takes.
use std::path::{Path, PathBuf};
use std::time::Instant;
use tallow::scene::Scene;

/// # Panics
/// When there is none: these tests are ignored unless asked for.
fn data() -> PathBuf {
    let found = std::env::var_os("TALLOW_DATA").expect("TALLOW_DATA must name the folder of the outside data");
    found.into()
}

fn objs(directory: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(directory).expect("a readable directory").flatten() {
        match entry.path() {
            path if path.is_dir() => objs(&path, found),
            path if path.extension().is_some_and(|e| e == "obj") => found.push(path),
            _ => {}
        }
    }
}

#[test]
#[ignore = "needs TALLOW_DATA"]
fn every_obj_loads() {
    let data = data();
    let mut paths = Vec::new();
    objs(&data.join("scenes"), &mut paths);
    assert!(paths.len() >= 50, "only {} OBJ files below {}", paths.len(), data.display());
    paths.sort();
    for path in paths {
        let start = Instant::now();
        let scene = Scene::load(&path, &|_| {}).unwrap_or_else(|e| panic!("{e}"));
        let name = path.strip_prefix(&data).unwrap_or(&path).display().to_string();
        println!("{:5.0} ms {:8} triangles {name}", start.elapsed().as_secs_f64() * 1e3, scene.triangles.len());
        scene.warnings.iter().for_each(|w| println!("         {w}"));
        assert!(!scene.triangles.is_empty() && !scene.lights.is_empty(), "{name}");
        let missing = scene.warnings.iter().find(|w| w.contains("no such file") || w.contains("not found"));
        assert!(missing.is_none() || name.contains("gltf"), "{missing:?}");
        assert!(scene.shading.is_empty() || scene.shading.len() == scene.triangles.len());
        let bytes = scene.triangles.len() * 48 + scene.shading.len() * 48 + scene.nodes.len() * 80;
        // Every leaf holds a triangle or more; tiny scenes have a node to themselves.
        assert!(bytes <= 200 * scene.triangles.len() + 80, "{name}: {bytes} bytes");
    }
}

#[test]
#[ignore = "needs TALLOW_DATA"]
fn sponza_loads_with_its_textures() {
    let data = data();
    let path = data.join("scenes/crytek-sponza/sponza.obj");
    let mut best = f64::INFINITY;
    for _ in 0..3 {
        let start = Instant::now();
        let scene = Scene::load(&path, &|_| {}).expect("Sponza loads");
        best = best.min(start.elapsed().as_secs_f64());
        let (n, bytes) = (scene.triangles.len(), scene.texels.len() * 4);
        println!(
            "Sponza: {n} triangles, {} nodes, {} textures, {bytes} bytes",
            scene.nodes.len(),
            scene.textures.len()
        );
        assert!(n > 262_000 && scene.textures.len() > 40);
    }
    println!("Sponza is ready in {best:.2} s");
}
