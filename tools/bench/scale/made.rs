//! The scenes, made as large as one likes.
use anyhow::{Result, bail};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use tallow::scene::description::settings::Settings;
use tallow::scene::description::{
    Description, EnvironmentTable, InstanceTable, MaterialTable, Mesh, MeshTable, Rgb, Shape, TextureTable, Transform,
};
use tallow::scene::{Loaded, Scene};

/// Loads what was made.
type Load = Box<dyn FnOnce() -> Result<Loaded>>;

/// Makes what a row of this size is loaded from. Files go to `folder`.
pub fn make(what: &str, size: u32, folder: &Path) -> Result<Load> {
    Ok(match what {
        "triangles" => {
            let file = folder.join("grid.obj");
            write_grid(&file, edge(size))?;
            Box::new(move || Ok(Scene::load(&file)?.with(small)))
        }
        "texture" => {
            let file = folder.join("picture.png");
            write_picture(&file, size)?;
            build(textured(file))
        }
        "lamps" => build(lamps(edge(size))),
        "instances" => build(instances(size)),
        "meshes" => build(meshes(size)),
        "film" => {
            let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/scene.toml");
            Box::new(move || Ok(Scene::load(&file)?.with(|s| (s.width, s.height, s.spp) = (size, size, 1))))
        }
        other => bail!("no row \"{other}\""),
    })
}

/// A film that takes no time.
pub fn small(settings: &mut Settings) {
    (settings.width, settings.height, settings.spp) = (64, 64, 1);
}

fn build(description: Description) -> Load {
    Box::new(move || Ok(Scene::build(&description)?.with(small)))
}

/// Squares along an edge of a grid of so many triangles.
fn edge(triangles: u32) -> u32 {
    f64::from(triangles / 2).sqrt().ceil() as u32
}

/// Height of a grid of bumps at a corner.
fn height([x, y]: [u32; 2]) -> f32 {
    ((x * 7 + y * 13) % 17) as f32 * 0.1
}

/// Corners of a grid, row by row.
fn corners(edge: u32) -> impl Iterator<Item = [u32; 2]> {
    (0..=edge).flat_map(move |y| (0..=edge).map(move |x| [x, y]))
}

/// Squares of a grid, by the numbers of their corners.
fn squares(edge: u32) -> impl Iterator<Item = [u32; 4]> {
    let first = move |i: u32| i / edge * (edge + 1) + i % edge;
    (0..edge * edge).map(move |i| [0, edge + 1, edge + 2, 1].map(|corner| first(i) + corner))
}

fn write_grid(path: &Path, edge: u32) -> Result<()> {
    let mut out = BufWriter::new(File::create(path)?);
    for [x, y] in corners(edge) {
        writeln!(out, "v {x} {:.1} {y}", height([x, y]))?;
    }
    for [a, b, c, d] in squares(edge) {
        writeln!(out, "f {} {} {} {}", a + 1, b + 1, c + 1, d + 1)?;
    }
    Ok(out.flush()?)
}

fn grid(edge: u32) -> Mesh {
    Mesh {
        positions: corners(edge).map(|[x, y]| [x as f32, height([x, y]), y as f32]).collect(),
        indices: squares(edge).flat_map(|[a, b, c, d]| [a, b, c, a, c, d]).collect(),
        ..Mesh::default()
    }
}

/// Noise, since a plain picture would be read in no time.
fn write_picture(path: &Path, edge: u32) -> Result<()> {
    let mut random = fastrand::Rng::with_seed(1);
    let mut picture = image::RgbImage::new(edge, edge);
    random.fill(&mut picture);
    let out = BufWriter::new(File::create(path)?);
    use image::codecs::png::{CompressionType, FilterType, PngEncoder};
    Ok(picture.write_with_encoder(PngEncoder::new_with_quality(out, CompressionType::Fast, FilterType::NoFilter))?)
}

fn sky() -> Option<EnvironmentTable> {
    Some(EnvironmentTable::default())
}

fn textured(file: PathBuf) -> Description {
    let picture = Some(TextureTable::from(file.as_path()));
    let material = MaterialTable { name: "picture".into(), color_texture: picture, ..MaterialTable::default() };
    let mesh = MeshTable { shape: Some(Shape::Rectangle), material: Some("picture".into()), ..MeshTable::default() };
    Description { environment: sky(), material: vec![material], mesh: vec![mesh], ..Description::default() }
}

fn lamps(edge: u32) -> Description {
    let material = MaterialTable { name: "lamp".into(), emission: Some(Rgb([1.0; 3])), ..MaterialTable::default() };
    let mesh = MeshTable { data: Some(grid(edge)), material: Some("lamp".into()), ..MeshTable::default() };
    Description { material: vec![material], mesh: vec![mesh], ..Description::default() }
}

/// Puts a copy to place number `i` of a square grid.
fn place(mesh: &str, i: u32, spacing: f64) -> InstanceTable {
    let [x, y] = [i % 300, i / 300].map(|v| f64::from(v) * spacing);
    let transform = Transform::try_from([1., 0., 0., x, 0., 1., 0., 0., 0., 0., 1., y, 0., 0., 0., 1.]).unwrap();
    InstanceTable { mesh: mesh.to_owned(), transform, ..InstanceTable::default() }
}

fn instances(count: u32) -> Description {
    let ball =
        MeshTable { name: Some("ball".into()), shape: Some(Shape::Sphere), segments: Some(32), ..MeshTable::default() };
    let instance = (0..count).map(|i| place("ball", i, 2.5)).collect();
    Description { environment: sky(), mesh: vec![ball], instance, ..Description::default() }
}

fn meshes(count: u32) -> Description {
    let shape = Some(Shape::Cube);
    let name = |i: u32| Some(i.to_string());
    let mesh =
        (0..count).map(|i| MeshTable { name: name(i), shape, material: name(i), ..MeshTable::default() }).collect();
    let material = (0..count).map(|i| MaterialTable { name: i.to_string(), ..MaterialTable::default() }).collect();
    let instance = (0..2 * count).map(|i| place(&(i / 2).to_string(), i, 3.0)).collect();
    Description { environment: sky(), mesh, material, instance, ..Description::default() }
}
