//! Makes materials of the `[[material]]` tables.
use super::mapping::Mapping;
use super::metal;
use super::texture::{Kind, TextureSet};
use crate::error::Checked;
use crate::layout::*;
use crate::scene::description::keys;
use crate::scene::description::material::{Distribution, MaterialTable, Type};
use crate::scene::description::texture::TextureTable;
use crate::scene::description::value::Rgb;
use crate::scene::{MAX_COORDINATE, MAX_RADIANCE};
use std::path::Path;

/// The materials of a scene and the textures they ask for.
#[derive(Debug, Default)]
pub struct Materials {
    /// The materials in the form that kernels read.
    pub list: Vec<Material>,
    /// Names of the materials, in the same order.
    pub names: Vec<String>,
    /// Textures that materials have asked for so far.
    pub textures: TextureSet,
    /// Materials whose bump height is a share of the scene's size, which is known last.
    pub default_bumps: Vec<u32>,
    /// Those for which opacities of vertices count.
    pub take_vertex_alpha: Vec<u32>,
}

/// Marks thin walls without a coat that are smooth, or whose picture may make them so: shadow rays of lights without extent pass
/// where they are.
pub fn mark_clear_wall(m: &mut Material) {
    let clear = (is_smooth_wall(m) || is_wall(m) && m.roughness_texture != NONE) && m.clearcoat == 0.0;
    m.flags = m.flags & !MATERIAL_CLEAR_WALL | if clear { MATERIAL_CLEAR_WALL } else { 0 };
}

/// Whether its opacity may let rays pass.
pub fn is_masked(m: &Material) -> bool {
    let partly = m.opacity < 1.0 || m.opacity_texture != NONE || m.flags & MATERIAL_VERTEX_MASK != 0;
    m.kind != BSDF_DIELECTRIC && (partly || m.alpha_cutoff > 1.0)
}

/// Whether it is a thin wall that lets light straight through.
pub fn is_smooth_wall(m: &Material) -> bool {
    is_wall(m) && m.alpha < SMOOTH_ALPHA
}

/// Whether it is a thin wall that light passes.
fn is_wall(m: &Material) -> bool {
    m.kind == BSDF_METALLIC && m.transmission_factor > 0.0
}

impl Materials {
    /// A diffuse grey with nothing else on.
    pub fn plain(color: [f32; 3]) -> Material {
        Material {
            base_color: color,
            kind: BSDF_DIFFUSE,
            opacity: 1.0,
            flags: MATERIAL_TWO_SIDED,
            specular: [1.0; 3],
            transmission: [1.0; 3],
            eta: [1.5; 3],
            bump_scale: 1.0,
            base_texture: NONE,
            specular_texture: NONE,
            opacity_texture: NONE,
            bump_texture: NONE,
            roughness_texture: NONE,
            emission_texture: NONE,
            normal_scale: 1.0,
            specular_factor_texture: NONE,
            transmission_texture: NONE,
            clearcoat_texture: NONE,
            clearcoat_roughness_texture: NONE,
            clearcoat_normal_texture: NONE,
            clearcoat_normal_scale: 1.0,
            ..Material::default()
        }
    }

    /// Adds a finished material and returns its index.
    pub fn push(&mut self, name: &str, mut material: Material) -> u32 {
        if is_masked(&material) {
            material.flags |= MATERIAL_MASKED;
        }
        self.list.push(material);
        self.names.push(name.to_owned());
        self.list.len() as u32 - 1
    }

    /// Says that some vertices have an opacity below 1.
    pub fn mask_by_vertices(&mut self) {
        for &index in &self.take_vertex_alpha {
            self.list[index as usize].flags |= MATERIAL_VERTEX_MASK | MATERIAL_MASKED;
        }
    }

    /// Adds a `[[material]]`.
    ///
    /// # Errors
    /// A sentence that names the key at fault.
    pub fn push_table(&mut self, t: &MaterialTable, directory: &Path, warn: &mut Vec<String>) -> Checked<u32> {
        warn.extend(keys::warning(t));
        if t.kind == Type::MetallicRoughness {
            return self.push_metallic(t, directory, warn);
        }
        let body = matches!(t.kind, Type::Diffuse | Type::Coated);
        let mut m = Self::plain([if body && t.color_texture.is_none() { 0.5 } else { 1.0 }; 3]);
        let mut tint = |to: &mut [f32; 3], color: Option<Rgb>, key: &str| -> Checked {
            if let Some(color) = color {
                *to = reflectance(color.0, &format!("material \"{}\"", t.name), key, warn)?;
            }
            Ok(())
        };
        match t.kind {
            _ if body => tint(&mut m.base_color, t.color, "color")?,
            Type::Dielectric => tint(&mut m.transmission, t.transmission, "transmission")?,
            // What a metal reflects is all the colour that it has.
            _ if t.specular.is_none() => tint(&mut m.specular, t.color, "color")?,
            _ => {}
        }
        if t.kind != Type::Diffuse {
            tint(&mut m.specular, t.specular, "specular")?;
        }
        m.opacity = within(t.opacity.unwrap_or(1.0), 1.0, "opacity")?;
        let rough = t.roughness_texture.is_some() && t.alpha == 0.0;
        m.alpha = if rough { 1.0 } else { within(t.alpha, 1.0, "alpha")? };
        m.emission = emission(t)?;
        self.interface(&mut m, t)?;
        if let Some(alpha_v) = t.alpha_v {
            stretch(&mut m, alpha_v)?;
        }
        if t.two_sided == Some(false) {
            m.flags &= !MATERIAL_TWO_SIDED;
        }
        if t.distribution == Distribution::Ggx {
            m.flags |= MATERIAL_GGX;
        }
        if t.emission_two_sided {
            m.flags |= MATERIAL_EMITS_BEHIND;
        }
        if t.nonlinear {
            m.flags |= MATERIAL_NONLINEAR;
        }
        self.table_textures(&mut m, t, body, directory, warn)?;
        Ok(self.push(&t.name, m))
    }

    fn interface(&self, m: &mut Material, t: &MaterialTable) -> Checked {
        let ior = t.ior.unwrap_or(1.5);
        if !(0.1..=10.0).contains(&ior) {
            return Err(format!("ior is {ior}: choose a value from 0.1 to 10"));
        }
        m.eta = [ior; 3];
        m.kind = match t.kind {
            Type::Diffuse => BSDF_DIFFUSE,
            Type::Dielectric => BSDF_DIELECTRIC,
            Type::Coated => BSDF_COATED,
            Type::Mirror | Type::Conductor | Type::MetallicRoughness => BSDF_CONDUCTOR,
        };
        if m.kind == BSDF_CONDUCTOR {
            (m.eta, m.k) = ([0.0; 3], [1.0; 3]);
        }
        if t.kind == Type::Conductor {
            if t.metal.is_some() && (t.eta.is_some() || t.k.is_some()) {
                return Err("has both metal and eta or k: choose one".into());
            }
            if let Some(name) = &t.metal {
                (m.eta, m.k) = metal::metal(name)?;
            } else if t.eta.is_some() || t.k.is_some() {
                (m.eta, m.k) = (t.eta.map_or([1.0; 3], |v| v.0), t.k.map_or([0.0; 3], |v| v.0));
            }
        }
        match m.eta.iter().chain(&m.k).all(|v| (0.0..=100.0).contains(v)) {
            true => Ok(()),
            false => Err("eta and k must lie between 0 and 100".into()),
        }
    }

    fn table_textures(
        &mut self,
        m: &mut Material,
        t: &MaterialTable,
        body: bool,
        directory: &Path,
        warn: &mut Vec<String>,
    ) -> Checked {
        if t.bump.is_some() && t.normal_map.is_some() {
            return Err("has both bump and normal_map: choose one".into());
        }
        let mut ask = |texture: Option<&TextureTable>, kind| self.ask(texture, kind, directory, warn);
        if body {
            m.base_texture = ask(t.color_texture.as_ref(), Kind::Color)?;
        }
        if m.kind != BSDF_DIFFUSE {
            let tint = if body {
                &t.specular_texture
            } else {
                t.specular_texture.as_ref().map_or(&t.color_texture, |_| &t.specular_texture)
            };
            m.specular_texture = ask(tint.as_ref(), Kind::Color)?;
            m.roughness_texture = ask(t.roughness_texture.as_ref(), Kind::Roughness)?;
        }
        m.opacity_texture = ask(t.opacity_texture.as_ref(), Kind::Mask)?;
        m.emission_texture = ask(t.emission_texture.as_ref(), Kind::Light)?;
        m.bump_texture = match &t.normal_map {
            Some(normals) => ask(Some(normals), Kind::Data)?,
            None => ask(t.bump.as_ref(), Kind::Height)?,
        };
        if t.normal_map.is_some() && m.bump_texture != NONE {
            m.flags |= MATERIAL_NORMAL_MAP;
        }
        m.normal_scale = t.normal_scale.unwrap_or(1.0);
        m.bump_scale = t.bump_scale.unwrap_or(1.0);
        if m.bump_scale.is_nan() || m.bump_scale.abs() > MAX_COORDINATE as f32 {
            return Err(format!("bump_scale is {:e}: choose a height within {MAX_COORDINATE:e}", m.bump_scale));
        }
        match m.normal_scale.is_finite() {
            true => Ok(()),
            false => Err("normal_scale is not a finite number".into()),
        }
    }
}

impl Materials {
    /// Index of a texture, or [`NONE`].
    ///
    /// # Errors
    /// For settings that are out of range.
    pub fn ask(
        &mut self,
        texture: Option<&TextureTable>,
        kind: Kind,
        directory: &Path,
        warn: &mut Vec<String>,
    ) -> Checked<u32> {
        let Some(texture) = texture else { return Ok(NONE) };
        let file = texture.file.to_string_lossy().replace('\\', "/");
        texture.check().map_err(|what| format!("texture {file}: {what}"))?;
        let mapping = Mapping::from(texture);
        Ok(self.textures.request(directory, &file, kind, mapping, warn))
    }
}

/// Gives an interface another roughness along v. None is smooth along one direction alone.
///
/// # Errors
/// For a number out of range and for other kinds of materials.
fn stretch(m: &mut Material, alpha_v: f32) -> Checked {
    within(alpha_v, 1.0, "alpha_v")?;
    if !matches!(m.kind, BSDF_CONDUCTOR | BSDF_DIELECTRIC) {
        return Err("has alpha_v, which is for conductors and dielectrics".to_owned());
    }
    if m.alpha.max(alpha_v) >= SMOOTH_ALPHA {
        m.alpha = m.alpha.max(SMOOTH_ALPHA);
        m.anisotropy = alpha_v.max(SMOOTH_ALPHA) / m.alpha - 1.0;
    }
    Ok(())
}

/// Whether its normals, or those of its clear coat, come from a map in tangent space.
pub fn has_normal_map(m: &Material) -> bool {
    m.flags & MATERIAL_NORMAL_MAP != 0 || m.clearcoat_normal_texture != NONE
}

/// Radiance that a table asks for.
///
/// # Errors
/// For one that is out of range.
pub fn emission(t: &MaterialTable) -> Checked<[f32; 3]> {
    let strength = t.emission_strength.unwrap_or(1.0);
    let emission = t.emission.map_or([f32::from(t.emission_texture.is_some()); 3], |v| v.0);
    radiance(emission.map(|v| v * strength), "emission")
}

/// A colour that must not exceed 1; larger values are clamped with a warning.
///
/// # Errors
/// For one that is not finite, with its `key`. The caller adds `place` to errors, as to all others, while warnings begin with it here.
pub fn reflectance(color: [f32; 3], place: &str, key: &str, warn: &mut Vec<String>) -> Checked<[f32; 3]> {
    if !color.iter().all(|v| v.is_finite()) {
        return Err(format!("{key} is not finite"));
    }
    let clamped = color.map(|v| v.clamp(0.0, 1.0));
    if clamped != color {
        warn.push(format!("{place}: {key} {color:?} lies outside [0, 1]: clamped"));
    }
    Ok(clamped)
}

/// A colour from 0 to [`MAX_RADIANCE`].
///
/// # Errors
/// With the colour and `what` it is, for another one.
pub fn radiance(color: [f32; 3], what: &str) -> Checked<[f32; 3]> {
    match color.iter().all(|v| (0.0..=MAX_RADIANCE).contains(v)) {
        true => Ok(color),
        false => Err(format!("{what} {color:?} is negative, NaN or above {MAX_RADIANCE:e}")),
    }
}

/// A number from 0 to `max`.
///
/// # Errors
/// With the key, for another one.
pub fn within(v: f32, max: f32, key: &str) -> Checked<f32> {
    match v {
        v if (0.0..=max).contains(&v) => Ok(v),
        v => Err(format!("{key} is {v}: choose a value from 0 to {max}")),
    }
}
