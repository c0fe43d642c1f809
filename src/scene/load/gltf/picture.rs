//! Textures of glTF: pictures in files are named to the renderer, those within the asset are handed over as they are.
use super::asset::Asset;
use super::extension;
use super::uri::{self, Target};
use crate::error::Result;
use crate::scene::description::{PictureFile, TextureFilter, TextureTable, Wrap};
use crate::scene::load::mapping::Mapping;
use gltf_json::texture::{MagFilter, MinFilter, Sampler, WrappingMode};
use gltf_json::validation::Checked;
use gltf_json::{Image, Texture};
use serde::Deserialize;
use serde_json::{Map, Value};
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

/// A reference to a texture, as all kinds of them have it.
#[derive(Clone, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct TextureInfo {
    /// Index of the texture.
    pub index: usize,
    /// Set of texture coordinates.
    #[serde(default)]
    pub tex_coord: u32,
    /// Extensions of the reference, such as `KHR_texture_transform`.
    #[serde(default)]
    pub extensions: Map<String, Value>,
}

/// `KHR_texture_transform`: coordinates are scaled, turned counter-clockwise by `rotation` radians, and moved.
#[derive(Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct TextureTransform {
    offset: [f32; 2],
    rotation: f32,
    scale: [f32; 2],
    tex_coord: Option<u32>,
}

impl Default for TextureTransform {
    fn default() -> Self {
        Self { offset: [0.0; 2], rotation: 0.0, scale: [1.0; 2], tex_coord: None }
    }
}

/// The pictures that materials have asked for.
#[derive(Default)]
pub struct Pictures {
    /// Those within the asset.
    pub within: Vec<PictureFile>,
    /// By index of the image: what materials name it by; `None` for one that cannot be had.
    names: HashMap<usize, Option<PathBuf>>,
    /// Messages about what is missing.
    pub warnings: Vec<String>,
}

impl Pictures {
    /// The table of a texture, or `None` with a warning where it has no picture.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] for an index or an address that leads nowhere.
    pub fn table(&mut self, asset: &Asset, info: &TextureInfo, place: &str) -> Result<Option<TextureTable>> {
        let textures = &asset.root.textures;
        let missing = || asset.at(place, format!("names texture {} of {}", info.index, textures.len()));
        let texture = textures.get(info.index).ok_or_else(missing)?;
        let Some(file) = self.file(asset, texture, info.index)? else { return Ok(None) };
        let name = "KHR_texture_transform";
        let transform: TextureTransform =
            extension::read(asset, Some(&info.extensions), name, place)?.unwrap_or_default();
        let TextureTransform { offset, rotation, scale, tex_coord } = transform;
        let set = tex_coord.unwrap_or(info.tex_coord);
        if set > 1 {
            self.warnings.push(format!("{place}: uses texture coordinates {set}: 0 and 1 can be used; 0 is taken"));
        }
        let uv = if set == 1 { 1 } else { 0 };
        let sampler = texture.sampler.map(|index| &asset.root.samplers[index.value()]);
        let (wrap, filter) = sampler.map_or_else(Default::default, sampling);
        Ok(Some(TextureTable { file, wrap, filter, uv, offset, rotate: rotation.to_degrees(), scale }))
    }

    /// What the picture of a texture is called.
    fn file(&mut self, asset: &Asset, texture: &Texture, index: usize) -> Result<Option<PathBuf>> {
        let source = texture.source.value();
        let Some(image) = asset.root.images.get(source) else {
            self.warnings.push(format!("texture {index}: has no PNG or JPEG; its constant colour is used"));
            return Ok(None);
        };
        if let Some(known) = self.names.get(&source) {
            return Ok(known.clone());
        }
        let name = self.named(asset, image, &format!("image {source}"))?;
        self.names.insert(source, name.clone());
        Ok(name)
    }

    fn named(&mut self, asset: &Asset, image: &Image, place: &str) -> Result<Option<PathBuf>> {
        let bytes: Arc<[u8]> = match (image.buffer_view, &image.uri) {
            (Some(view), _) => asset.view(view.value())?.into(),
            (None, Some(uri)) => match uri::resolve(asset.folder(), uri).map_err(|what| asset.at(place, what))? {
                Target::Data(bytes) => bytes.into(),
                Target::File(path) => {
                    // The renderer finds it from the scene's folder on, as it finds the pictures of other scenes.
                    return Ok(Some(path.strip_prefix(asset.base).unwrap_or(&path).to_owned()));
                }
            },
            (None, None) => {
                self.warnings.push(format!("{place}: has no picture; the constant colour is used"));
                return Ok(None);
            }
        };
        let name = PathBuf::from(format!("{}: {place}", asset.path.display()));
        self.within.push(PictureFile { name: name.clone(), bytes });
        Ok(Some(name))
    }
}

/// How a reference that names a set of texture coordinates reads them: an extension may name another, and transform them.
pub fn coordinates_of(set: u32, extensions: Option<&Map<String, Value>>) -> Mapping {
    let named = extensions.and_then(|all| TextureTransform::deserialize(all.get("KHR_texture_transform")?).ok());
    let TextureTransform { offset, rotation, scale, tex_coord } = named.unwrap_or_default();
    let uv = u32::from(tex_coord.unwrap_or(set) == 1);
    Mapping::from(&TextureTable { uv, offset, rotate: rotation.to_degrees(), scale, ..TextureTable::default() })
}

/// How a sampler repeats a picture and fills the space between texels. Of the filters that shrink pictures only those without
/// mipmaps say something about a path tracer's samples, which are magnified where they are averaged.
fn sampling(sampler: &Sampler) -> ([Wrap; 2], TextureFilter) {
    let wrap = |mode| match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        _ => Wrap::Repeat,
    };
    let filter = match (sampler.mag_filter, sampler.min_filter) {
        (Some(Checked::Valid(MagFilter::Nearest)), _) => TextureFilter::Nearest,
        (None, Some(Checked::Valid(MinFilter::Nearest))) => TextureFilter::Nearest,
        _ => TextureFilter::Linear,
    };
    ([wrap(sampler.wrap_s), wrap(sampler.wrap_t)], filter)
}
