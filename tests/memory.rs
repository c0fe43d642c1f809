//! Loads a mesh of four million triangles, alone in its process, so that its memory can be measured: as many as it takes for what
//! grows with them to leave all else behind, and to be beyond the 128 MiB that a storage binding has at least.
#![cfg(target_os = "linux")]
mod support;

use std::path::Path;
use std::time::Instant;
use tallow::render::{Outputs, Renderer, frame_constants};
use tallow::scene::Scene;
use tallow::twins::primary_hit::guide;

/// A grid of bumps written as quads, without normals.
fn write_grid(path: &Path, side: u32) -> std::io::Result<()> {
    use std::io::Write;
    let mut out = std::io::BufWriter::new(std::fs::File::create(path)?);
    for y in 0..=side {
        for x in 0..=side {
            writeln!(out, "v {x} {} {y}", ((x * 7 + y * 13) % 17) as f32 * 0.1)?;
        }
    }
    for y in 0..side {
        for x in 0..side {
            let first = y * (side + 1) + x + 1;
            writeln!(out, "f {first} {} {} {}", first + side + 1, first + side + 2, first + 1)?;
        }
    }
    out.flush()
}

/// Most memory this process ever held, in bytes.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM"))?;
    line.split_whitespace().nth(1)?.parse::<u64>().ok().map(|kib| kib * 1024)
}

#[test]
fn four_million_triangles_load_within_430_bytes_each_and_render() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("grid.obj");
    write_grid(&path, 1415).unwrap();
    let start = Instant::now();
    let scene = Scene::load(&path).map(|scene| scene.with(|s| (s.width, s.height, s.spp) = (32, 18, 1))).unwrap();
    assert!(scene.triangles.len() > 4_000_000);
    let each = peak_memory().expect("Linux tells") as f64 / scene.triangles.len() as f64;
    println!("{} triangles in {:.1} s, {each:.0} bytes each", scene.triangles.len(), start.elapsed().as_secs_f64());
    assert!(each < 430.0); // 4 GiB for ten million
    let gpu = support::gpu();
    let renderer =
        Renderer::new(&gpu, &scene, &scene.settings, Outputs { guides: true, ..Outputs::default() }).unwrap();
    let stats = support::render(&gpu, &renderer);
    assert!(stats.iter().all(|s| s.mean.iter().all(|v| v.is_finite())));
    let hits = renderer.film().tiles[0].guide.read().unwrap();
    let twins: Vec<_> =
        (0..stats.len() as u32).map(|p| guide(&scene, &frame_constants(&scene, &scene.settings).unwrap(), p)).collect();
    let alike = hits.iter().zip(&twins).filter(|(a, b)| (a.depth - b.depth).abs() <= 1e-4 * b.depth).count();
    let apart = hits.len() - alike;
    let surface = hits.iter().filter(|hit| hit.depth > 0.0).count();
    println!("{surface} of {} pixels show the mesh, {apart} of them elsewhere than the twin", stats.len());
    assert!(surface >= 32 && apart == 0); // nearly flat, it fills a band of the picture
    support::assert_silent(&gpu);
}
