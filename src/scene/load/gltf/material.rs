//! Materials of glTF become `metallic-roughness` tables. Occlusion textures are left out: a path tracer finds occlusion itself.
use super::asset::Asset;
use super::extension;
use super::picture::{Pictures, TextureInfo};
use crate::error::Result;
use crate::scene::MAX_RADIANCE;
use crate::scene::description::{AlphaMode, MaterialTable, MaterialType, Rgb, TextureTable};
use gltf_json::material::{AlphaMode as Mode, Material, NormalTexture};
use gltf_json::texture::Info;
use gltf_json::validation::Checked;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

/// The name of what has no material: glTF's default, white metal that is fully rough.
pub const DEFAULT: &str = "default";

#[derive(Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct EmissiveStrength {
    emissive_strength: f32,
}

impl Default for EmissiveStrength {
    fn default() -> Self {
        Self { emissive_strength: 1.0 }
    }
}

#[derive(Deserialize)]
#[serde(default)]
struct Ior {
    ior: f32,
}

impl Default for Ior {
    fn default() -> Self {
        Self { ior: 1.5 }
    }
}

#[derive(Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Specular {
    specular_factor: f32,
    specular_texture: Option<TextureInfo>,
    specular_color_factor: [f32; 3],
    specular_color_texture: Option<TextureInfo>,
}

impl Default for Specular {
    fn default() -> Self {
        let (specular_texture, specular_color_texture) = (None, None);
        Self { specular_factor: 1.0, specular_texture, specular_color_factor: [1.0; 3], specular_color_texture }
    }
}

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Transmission {
    transmission_factor: f32,
    transmission_texture: Option<TextureInfo>,
}

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Clearcoat {
    clearcoat_factor: f32,
    clearcoat_texture: Option<TextureInfo>,
    clearcoat_roughness_factor: f32,
    clearcoat_roughness_texture: Option<TextureInfo>,
    clearcoat_normal_texture: Option<CoatNormal>,
}

/// A normal map's reference, with its factor.
#[derive(Deserialize)]
struct CoatNormal {
    #[serde(flatten)]
    info: TextureInfo,
    scale: Option<f32>,
}

/// The table of what has no material.
pub fn default_table() -> MaterialTable {
    let (name, kind) = (DEFAULT.to_owned(), MaterialType::MetallicRoughness);
    MaterialTable { name, kind, ..MaterialTable::default() }
}

/// The table of material `index`, which is to be called `name`.
///
/// Numbers beyond what glTF allows are clamped and named in `clamped`.
///
/// # Errors
/// [`crate::error::Error::Input`] for textures that lead nowhere and damaged extensions.
pub fn table(
    asset: &Asset,
    index: usize,
    name: String,
    pictures: &mut Pictures,
    clamped: &mut Vec<String>,
) -> Result<MaterialTable> {
    let material = &asset.root.materials[index];
    let mut reader = Reader { asset, place: format!("material {index}"), pictures, clamped };
    let mut table = reader.core(material, name)?;
    if let Some(extensions) = &material.extensions {
        reader.extend(&mut table, &extensions.others)?;
    }
    Ok(table)
}

struct Reader<'a> {
    asset: &'a Asset<'a>,
    /// The material, for messages.
    place: String,
    pictures: &'a mut Pictures,
    clamped: &'a mut Vec<String>,
}

/// Largest factor of a specular colour, and largest index of refraction.
const LARGEST_SPECULAR: f32 = 1e6;
const LARGEST_INDEX: f32 = 1000.0;

impl Reader<'_> {
    fn core(&mut self, material: &Material, name: String) -> Result<MaterialTable> {
        let surface = &material.pbr_metallic_roughness;
        let [red, green, blue, alpha] = self.within("baseColorFactor", surface.base_color_factor.0, 1.0);
        let normal = material.normal_texture.as_ref();
        let Checked::Valid(mode) = material.alpha_mode else {
            return Err(self.asset.at(&self.place, "has an alphaMode other than OPAQUE, MASK and BLEND"));
        };
        let emission = self.within("emissiveFactor", material.emissive_factor.0, MAX_RADIANCE);
        let emission = Some(emission).filter(|factor| *factor != [0.0; 3]);
        let emissive = material.emissive_texture.as_ref().filter(|_| emission.is_some());
        Ok(MaterialTable {
            name,
            kind: MaterialType::MetallicRoughness,
            color: Some(Rgb([red, green, blue])),
            opacity: Some(alpha),
            color_texture: self.texture(surface.base_color_texture.as_ref().map(plain))?,
            metallic: Some(self.unit("metallicFactor", surface.metallic_factor.0)),
            roughness: Some(self.unit("roughnessFactor", surface.roughness_factor.0)),
            metallic_roughness_texture: self.texture(surface.metallic_roughness_texture.as_ref().map(plain))?,
            normal_map: self.texture(normal.map(of_normal))?,
            normal_scale: normal.map(|normal| normal.scale.clamp(-LARGEST_SPECULAR, LARGEST_SPECULAR)),
            emission: emission.map(Rgb),
            emission_two_sided: material.double_sided && emission.is_some(),
            emission_texture: self.texture(emissive.map(plain))?,
            alpha_mode: Some(match mode {
                Mode::Opaque => AlphaMode::Opaque,
                Mode::Mask => AlphaMode::Mask,
                Mode::Blend => AlphaMode::Blend,
            }),
            // One above 1 hides all.
            alpha_cutoff: material.alpha_cutoff.map(|cutoff| cutoff.0.clamp(0.0, 2.0)),
            ..MaterialTable::default()
        })
    }

    fn extend(&mut self, table: &mut MaterialTable, all: &Map<String, Value>) -> Result<()> {
        table.unlit = all.contains_key("KHR_materials_unlit");
        let strength = self.extension::<EmissiveStrength>(all, "KHR_materials_emissive_strength")?;
        if let (Some(found), Some(Rgb(emission))) = (strength, &mut table.emission) {
            let strong = emission.map(|v| v * found.emissive_strength);
            *emission = self.within("emissiveStrength", strong, MAX_RADIANCE);
        }
        if let Some(found) = self.extension::<Ior>(all, "KHR_materials_ior")? {
            let [ior] = self.between("ior", [found.ior], [1.0, LARGEST_INDEX]);
            // An index of 0 says that all is reflected.
            table.ior = Some(if found.ior == 0.0 { 0.0 } else { ior });
        }
        if let Some(found) = self.extension::<Specular>(all, "KHR_materials_specular")? {
            table.specular_factor = Some(self.unit("specularFactor", found.specular_factor));
            table.specular_factor_texture = self.texture(found.specular_texture)?;
            table.specular =
                Some(Rgb(self.within("specularColorFactor", found.specular_color_factor, LARGEST_SPECULAR)));
            table.specular_texture = self.texture(found.specular_color_texture)?;
        }
        if let Some(found) = self.extension::<Transmission>(all, "KHR_materials_transmission")? {
            table.transmission_factor = Some(self.unit("transmissionFactor", found.transmission_factor));
            table.transmission_texture = self.texture(found.transmission_texture)?;
        }
        if let Some(found) = self.extension::<Clearcoat>(all, "KHR_materials_clearcoat")? {
            table.clearcoat = Some(self.unit("clearcoatFactor", found.clearcoat_factor));
            table.clearcoat_texture = self.texture(found.clearcoat_texture)?;
            table.clearcoat_roughness = Some(self.unit("clearcoatRoughnessFactor", found.clearcoat_roughness_factor));
            table.clearcoat_roughness_texture = self.texture(found.clearcoat_roughness_texture)?;
            if let Some(CoatNormal { info, scale }) = found.clearcoat_normal_texture {
                table.clearcoat_normal_map = self.texture(Some(info))?;
                table.clearcoat_normal_scale = scale.map(|scale| scale.clamp(-LARGEST_SPECULAR, LARGEST_SPECULAR));
            }
        }
        Ok(())
    }

    fn unit(&mut self, key: &str, v: f32) -> f32 {
        self.within(key, [v], 1.0)[0]
    }

    /// Clamps to 0 and `most`.
    fn within<const N: usize>(&mut self, key: &str, values: [f32; N], most: f32) -> [f32; N] {
        self.between(key, values, [0.0, most])
    }

    fn between<const N: usize>(&mut self, key: &str, values: [f32; N], [low, high]: [f32; 2]) -> [f32; N] {
        let clamped = values.map(|v| if v.is_nan() { low } else { v.clamp(low, high) });
        // An index of refraction of 0 has a meaning of its own.
        if clamped != values && values != [0.0; N] {
            self.clamped.push(format!("{key} of {}", self.place));
        }
        clamped
    }

    fn texture(&mut self, info: Option<TextureInfo>) -> Result<Option<TextureTable>> {
        info.map_or(Ok(None), |info| self.pictures.table(self.asset, &info, &self.place))
    }

    fn extension<T: DeserializeOwned>(&self, all: &Map<String, Value>, name: &str) -> Result<Option<T>> {
        extension::read(self.asset, Some(all), name, &self.place)
    }
}

fn plain(info: &Info) -> TextureInfo {
    let extensions = info.extensions.as_ref().map_or_else(Map::new, |e| e.others.clone());
    TextureInfo { index: info.index.value(), tex_coord: info.tex_coord, extensions }
}

fn of_normal(info: &NormalTexture) -> TextureInfo {
    let extensions = info.extensions.as_ref().map_or_else(Map::new, |e| e.others.clone());
    TextureInfo { index: info.index.value(), tex_coord: info.tex_coord, extensions }
}
