//! Makes sheets of pictures, with the results in the upper row and their error maps below, all on one scale.
use super::case;
use std::path::Path;
use tallow::image::Picture;
use tallow::image::difference::{heat_map, heat_map_to};

/// Gap between pictures in pixels.
const GAP: usize = 4;

/// One column of the sheet: a result and its name.
pub struct Tile {
    name: String,
    picture: Picture,
}

impl Tile {
    /// Makes a column; `name` appears in the legend.
    pub fn new(name: &str, picture: &Picture) -> Self {
        Self { name: name.to_owned(), picture: picture.clone() }
    }
}

/// Writes the sheet, with the reference as the last column, and prints its legend. The first tile is unfiltered; the scale
/// fits the largest error of the others.
///
/// # Errors
/// When it cannot be written.
pub fn write(path: &Path, tiles: &[Tile], reference: &Picture) -> anyhow::Result<()> {
    let top = tiles[1..].iter().map(|t| heat_map(&t.picture, reference).1).fold(0.0, f32::max);
    let pictures: Vec<_> = tiles.iter().map(|t| &t.picture).chain([reference]).collect();
    let maps: Vec<_> = pictures.iter().map(|p| heat_map_to(p, reference, top)).collect();
    // Maps are wider than pictures, because of the scale bar at their right edge.
    let (column, height) = (maps[0].width as usize + GAP, reference.height as usize);
    let mut sheet =
        Picture { width: (column * pictures.len()) as u32, height: (2 * height + GAP) as u32, pixels: vec![] };
    sheet.pixels = vec![[1.0; 3]; sheet.width as usize * sheet.height as usize];
    for (i, (picture, map)) in pictures.into_iter().zip(&maps).enumerate() {
        paste(&mut sheet, picture, [i * column, 0]);
        paste(&mut sheet, map, [i * column, height + GAP]);
    }
    case::write(&sheet, path)?;
    let names: Vec<_> = tiles.iter().map(|t| t.name.as_str()).chain(["reference"]).collect();
    println!("{}: {}; error maps from black, 0, to {top:.4} and above\n", path.display(), names.join(", "));
    Ok(())
}

fn paste(sheet: &mut Picture, picture: &Picture, [x, y]: [usize; 2]) {
    let (from, to) = (picture.width as usize, sheet.width as usize);
    for (row, pixels) in picture.pixels.chunks_exact(from).enumerate() {
        let start = (y + row) * to + x;
        sheet.pixels[start..start + from].copy_from_slice(pixels);
    }
}
