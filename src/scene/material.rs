//! Materials: what the `[[material]]` tables say, and what MTL statements are taken to mean.
//!
//! An MTL block becomes, by the first rule that fits:
//! 1. `Pm` of at least 0.5: a conductor whose reflectance at normal incidence is Kd. With map_Kd, the tint of a perfect
//!    mirror, since indices cannot be textured.
//! 2. `illum` 3 or 5 with black Kd and no map_Kd: a mirror tinted by Ks (white where Ks is black).
//! 3. `illum` 4, 6, 7 or 9 without map_d, or d below 1 together with Tf and Ni above 1: a dielectric of index Ni
//!    (1.5 where absent), its transmission tinted by Tf.
//! 4. Ks above black and `illum` other than 0 and 1: a diffuse base Kd under a coat of index Ni (1.5 where it is not
//!    above 1). Ks is the coat's reflectance at normal incidence, capped at what the index gives.
//! 5. Otherwise diffuse.
//!
//! Roughness: alpha = Pr^2; without Pr, sqrt(2 / (Ns + 2)) for coats and conductors, and smooth for 2 and 3.
//! d (or 1 - Tr) and map_d are opacity except on dielectrics. `norm` wins over a bump map. Bump heights are `-bm` world
//! units; without -bm, 0.0005 of the scene's diagonal. A black Kd under a map_Kd counts as white.
use super::fresnel;
use super::mtl::{Map, Mtl};
use super::texture::{Kind, Mapping, TextureSet};
use super::value::Rgb;
use crate::layout::{self, *};
use crate::twins::coat::coat_table;
use serde::Deserialize;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// The materials of a scene and the textures they ask for.
#[derive(Debug, Default)]
pub struct Materials {
    /// As kernels read them.
    pub list: Vec<layout::Material>,
    /// Same order.
    pub names: Vec<String>,
    /// Asked for so far.
    pub textures: TextureSet,
    /// Materials whose bump height is a share of the scene's size, known only in the end.
    pub default_bumps: Vec<u32>,
}

/// What a material reflects like.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Type {
    /// Lambertian.
    #[default]
    Diffuse,
    /// Microfacet metal.
    Conductor,
    /// Microfacet glass.
    Dielectric,
    /// A conductor of eta 0, k 1, whose Fresnel reflectance is 1 at every angle, tinted by `color`.
    Mirror,
    /// Diffuse base under a dielectric coat.
    Coated,
}

/// Microfacet distribution.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Distribution {
    /// Beckmann.
    #[default]
    Beckmann,
    /// GGX (Trowbridge-Reitz).
    Ggx,
}

/// A `[[material]]` table. Colours are linear Rec. 709, one number or `[r, g, b]`; files are relative to the scene file.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MaterialTable {
    /// What meshes and OBJ files call it; replaces an MTL material of that name.
    pub name: String,
    /// Default diffuse.
    #[serde(rename = "type")]
    pub kind: Type,
    /// Albedo, or the tint of a mirror or conductor; default 0.5 (diffuse, coated without texture), else 1.
    pub color: Option<Rgb>,
    /// sRGB picture, multiplies `color`.
    pub color_texture: Option<PathBuf>,
    /// Microfacet roughness in [0, 1]; below 0.01 smooth; default 0.
    pub alpha: f32,
    /// Default Beckmann.
    pub distribution: Distribution,
    /// Conductor: index of refraction.
    pub eta: Option<Rgb>,
    /// Conductor: extinction.
    pub k: Option<Rgb>,
    /// Conductor: eta and k by name.
    pub metal: Option<String>,
    /// Dielectric and coat: interior over exterior index; default 1.5.
    pub ior: Option<f32>,
    /// Tint of specular reflection; default 1.
    pub specular: Option<Rgb>,
    /// sRGB picture, multiplies `specular`.
    pub specular_texture: Option<PathBuf>,
    /// Tint of transmission; default 1.
    pub transmission: Option<Rgb>,
    /// Radiance of the front side, W/(m^2 sr).
    pub emission: Option<Rgb>,
    /// sRGB picture, multiplies `emission` (default then 1).
    pub emission_texture: Option<PathBuf>,
    /// In [0, 1]; default 1.
    pub opacity: Option<f32>,
    /// Mask: its alpha channel, or its red channel where it has none.
    pub opacity_texture: Option<PathBuf>,
    /// Height map.
    pub bump: Option<PathBuf>,
    /// World units per unit of the height map; default 1.
    pub bump_scale: Option<f32>,
    /// Tangent-space normal map, instead of `bump`.
    pub normal_map: Option<PathBuf>,
    /// Perceptual roughness (root of alpha) in its green channel; multiplies the root of `alpha` (default then 1).
    pub roughness_texture: Option<PathBuf>,
    /// Default true.
    pub two_sided: Option<bool>,
    /// Coated: light that is reflected below the coat takes on the base's colour each time; default false.
    pub nonlinear: bool,
}

impl Materials {
    /// A diffuse grey with nothing else on.
    pub fn plain(color: [f32; 3]) -> layout::Material {
        layout::Material {
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
            ..layout::Material::default()
        }
    }

    /// Adds a finished material and returns its index.
    pub fn push(&mut self, name: &str, mut material: layout::Material) -> u32 {
        if material.kind == BSDF_COATED {
            material.internal_fresnel = fresnel::mean_internal(material.eta[0]);
        }
        let masked = material.opacity < 1.0 || material.opacity_texture != NONE;
        if masked && material.kind != BSDF_DIELECTRIC {
            material.flags |= MATERIAL_MASKED;
        }
        self.list.push(material);
        self.names.push(name.to_owned());
        self.list.len() as u32 - 1
    }

    /// Adds what rough coats reflect to the words of the textures: a table for each index and distribution.
    pub fn add_coat_tables(materials: &mut [layout::Material], texels: &mut Vec<u32>) {
        let mut tables = HashMap::new();
        for m in materials.iter_mut().filter(|m| m.kind == BSDF_COATED && m.alpha >= SMOOTH_ALPHA) {
            let ggx = m.flags & MATERIAL_GGX != 0;
            m.coat_table = *tables.entry((m.eta[0].to_bits(), ggx)).or_insert_with(|| {
                let first = texels.len() as u32;
                texels.extend(coat_table(m.eta[0], ggx).into_iter().map(f32::to_bits));
                first
            });
        }
    }

    /// Adds a `[[material]]`.
    ///
    /// # Errors
    /// A sentence that names the key at fault.
    pub fn push_table(&mut self, t: &MaterialTable, directory: &Path, warn: &mut Vec<String>) -> Result<u32, String> {
        let mut m = Self::plain([0.5; 3]);
        let named = |key: &str| format!("material \"{}\": {key}", t.name);
        let tint = |v: Option<Rgb>, or: f32, key: &str, warn: &mut Vec<String>| {
            reflectance(v.map_or([or; 3], |v| v.0), &named(key), warn)
        };
        let body = matches!(t.kind, Type::Diffuse | Type::Coated);
        let default = if body && t.color_texture.is_none() { 0.5 } else { 1.0 };
        m.base_color = tint(t.color, default, "color", warn)?;
        m.specular = tint(if body { t.specular } else { t.specular.or(t.color) }, 1.0, "specular", warn)?;
        m.transmission = tint(t.transmission, 1.0, "transmission", warn)?;
        if t.kind == Type::Dielectric {
            m.specular = tint(t.specular, 1.0, "specular", warn)?;
        }
        m.opacity = within(t.opacity.unwrap_or(1.0), 1.0, "opacity")?;
        let rough = t.roughness_texture.is_some() && t.alpha == 0.0;
        m.alpha = if rough { 1.0 } else { within(t.alpha, 1.0, "alpha")? };
        m.emission = radiance(t.emission.map_or([f32::from(t.emission_texture.is_some()); 3], |v| v.0))?;
        self.interface(&mut m, t)?;
        if t.two_sided == Some(false) {
            m.flags &= !MATERIAL_TWO_SIDED;
        }
        if t.distribution == Distribution::Ggx {
            m.flags |= MATERIAL_GGX;
        }
        if t.nonlinear {
            m.flags |= MATERIAL_NONLINEAR;
        }
        self.table_textures(&mut m, t, body, directory, warn)?;
        Ok(self.push(&t.name, m))
    }

    fn interface(&self, m: &mut layout::Material, t: &MaterialTable) -> Result<(), String> {
        let ior = t.ior.unwrap_or(1.5);
        if !(0.1..=10.0).contains(&ior) {
            return Err(format!("ior is {ior}: choose a value from 0.1 to 10"));
        }
        m.eta = [ior; 3];
        m.kind = match t.kind {
            Type::Diffuse => BSDF_DIFFUSE,
            Type::Dielectric => BSDF_DIELECTRIC,
            Type::Coated => BSDF_COATED,
            Type::Mirror | Type::Conductor => BSDF_CONDUCTOR,
        };
        if m.kind == BSDF_CONDUCTOR {
            (m.eta, m.k) = ([0.0; 3], [1.0; 3]);
        }
        if t.kind == Type::Conductor {
            if let Some(name) = &t.metal {
                (m.eta, m.k) = fresnel::metal(name)?;
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
        m: &mut layout::Material,
        t: &MaterialTable,
        body: bool,
        directory: &Path,
        warn: &mut Vec<String>,
    ) -> Result<(), String> {
        if t.bump.is_some() && t.normal_map.is_some() {
            return Err("has both bump and normal_map: choose one".into());
        }
        let mut ask = |file: Option<&PathBuf>, kind| match file.map(|f| f.to_string_lossy().replace('\\', "/")) {
            Some(file) => self.textures.request(directory, &file, kind, Mapping::default(), warn),
            None => NONE,
        };
        if body {
            m.base_texture = ask(t.color_texture.as_ref(), Kind::Color);
        }
        if m.kind != BSDF_DIFFUSE {
            let tint = if body {
                &t.specular_texture
            } else {
                t.specular_texture.as_ref().map_or(&t.color_texture, |_| &t.specular_texture)
            };
            m.specular_texture = ask(tint.as_ref(), Kind::Color);
            m.roughness_texture = ask(t.roughness_texture.as_ref(), Kind::Roughness);
        }
        m.opacity_texture = ask(t.opacity_texture.as_ref(), Kind::Mask);
        m.emission_texture = ask(t.emission_texture.as_ref(), Kind::Color);
        m.bump_texture = ask(t.bump.as_ref().or(t.normal_map.as_ref()), Kind::Data);
        if t.normal_map.is_some() && m.bump_texture != NONE {
            m.flags |= MATERIAL_NORMAL_MAP;
        }
        m.bump_scale = t.bump_scale.unwrap_or(1.0);
        match m.bump_scale.is_finite() {
            true => Ok(()),
            false => Err("bump_scale is not a finite number".into()),
        }
    }

    /// Adds what an MTL block means (module documentation).
    ///
    /// # Errors
    /// A sentence that names the statement at fault.
    pub fn push_mtl(&mut self, mtl: &Mtl, warn: &mut Vec<String>) -> Result<u32, String> {
        let color = |key: &str, or: f32| mtl.colors.get(key).copied().unwrap_or([or; 3]);
        let mut m = Self::plain([0.0; 3]);
        let named = |key: &str| format!("material \"{}\": {key}", mtl.name);
        let textured = mtl.maps.contains_key("map_Kd");
        let kd = match color("Kd", if textured { 1.0 } else { 0.6 }) {
            [0.0, 0.0, 0.0] if textured => [1.0; 3],
            kd => kd,
        };
        m.base_color = reflectance(kd, &named("Kd"), warn)?;
        let ks = reflectance(color("Ks", f32::from(mtl.maps.contains_key("map_Ks"))), &named("Ks"), warn)?;
        m.emission = radiance(color("Ke", f32::from(mtl.maps.contains_key("map_Ke"))))?;
        m.opacity = mtl.numbers.get("d").copied().unwrap_or(1.0).clamp(0.0, 1.0);
        let kind = mtl_kind(mtl, m.base_color, ks, m.opacity);
        mtl_interface(&mut m, mtl, kind, ks, warn)?;
        self.mtl_textures(&mut m, mtl, kind, warn);
        let index = self.push(&mtl.name, m);
        if m.bump_texture != NONE && mtl.maps.get("bump").is_some_and(|b| b.bump.is_none()) {
            self.default_bumps.push(index);
        }
        Ok(index)
    }

    fn mtl_textures(&mut self, m: &mut layout::Material, mtl: &Mtl, kind: Type, warn: &mut Vec<String>) {
        let textures = &mut self.textures;
        let mut ask = |map: Option<&Map>, kind| match map {
            Some(map) => textures.request(&mtl.directory, &map.file, kind, map.mapping, warn),
            None => NONE,
        };
        match kind {
            Type::Conductor => m.specular_texture = ask(mtl.maps.get("map_Kd"), Kind::Color),
            Type::Mirror | Type::Dielectric => {}
            Type::Diffuse => m.base_texture = ask(mtl.maps.get("map_Kd"), Kind::Color),
            Type::Coated => {
                m.base_texture = ask(mtl.maps.get("map_Kd"), Kind::Color);
                m.specular_texture = ask(mtl.maps.get("map_Ks"), Kind::Color);
            }
        }
        if kind != Type::Diffuse && mtl.maps.contains_key("map_Pr") {
            m.roughness_texture = ask(mtl.maps.get("map_Pr"), Kind::Roughness);
            m.alpha = mtl.numbers.get("Pr").map_or(1.0, |_| m.alpha);
        }
        if kind != Type::Dielectric {
            m.opacity_texture = ask(mtl.maps.get("map_d"), Kind::Mask);
        }
        if m.emission != [0.0; 3] {
            m.emission_texture = ask(mtl.maps.get("map_Ke"), Kind::Color);
        }
        let bump = mtl.maps.get("bump");
        m.bump_texture = ask(mtl.maps.get("norm").or(bump), Kind::Data);
        if m.bump_texture != NONE && mtl.maps.contains_key("norm") {
            m.flags |= MATERIAL_NORMAL_MAP;
        }
        m.bump_scale = bump.and_then(|b| b.bump).unwrap_or(1.0);
    }
}

/// Which of the rules of the module documentation applies.
fn mtl_kind(mtl: &Mtl, kd: [f32; 3], ks: [f32; 3], d: f32) -> Type {
    let number = |key: &str| mtl.numbers.get(key).copied();
    let illum = number("illum").unwrap_or(2.0) as i32;
    let black = kd == [0.0; 3] && !mtl.maps.contains_key("map_Kd");
    let tinted_glass = d < 1.0 && mtl.colors.contains_key("Tf") && number("Ni").is_some_and(|n| n > 1.0);
    match illum {
        _ if number("Pm").is_some_and(|pm| pm >= 0.5) => Type::Conductor,
        3 | 5 if black => Type::Mirror,
        4 | 6 | 7 | 9 if !mtl.maps.contains_key("map_d") => Type::Dielectric,
        _ if tinted_glass && !mtl.maps.contains_key("map_d") => Type::Dielectric,
        0 | 1 => Type::Diffuse,
        _ if ks != [0.0; 3] => Type::Coated,
        _ => Type::Diffuse,
    }
}

fn mtl_interface(
    m: &mut layout::Material,
    mtl: &Mtl,
    kind: Type,
    ks: [f32; 3],
    warn: &mut Vec<String>,
) -> Result<(), String> {
    let number = |key: &str| mtl.numbers.get(key).copied();
    let glossy = (2.0 / (number("Ns").unwrap_or(0.0).max(0.0) + 2.0)).sqrt();
    let default = if matches!(kind, Type::Mirror | Type::Dielectric) { 0.0 } else { glossy };
    m.alpha = number("Pr").map_or(default, |pr| pr.clamp(0.0, 1.0).powi(2));
    let index = number("Ni").filter(|n| (0.1..=10.0).contains(n));
    match kind {
        Type::Diffuse => m.kind = BSDF_DIFFUSE,
        Type::Conductor | Type::Mirror => {
            m.kind = BSDF_CONDUCTOR;
            (m.eta, m.k) = ([0.0; 3], [1.0; 3]);
            let white = if ks == [0.0; 3] { [1.0; 3] } else { ks };
            m.specular = if kind == Type::Mirror { white } else { m.base_color };
            if kind == Type::Conductor && !mtl.maps.contains_key("map_Kd") {
                let constants = m.base_color.map(fresnel::metal_from_reflectance);
                (m.eta, m.k, m.specular) = (constants.map(|c| c.0), constants.map(|c| c.1), [1.0; 3]);
            }
        }
        Type::Dielectric => {
            m.kind = BSDF_DIELECTRIC;
            m.eta = [index.unwrap_or(1.5); 3];
            m.opacity = 1.0;
            let tf = mtl.colors.get("Tf").copied().unwrap_or([1.0; 3]);
            m.transmission = reflectance(tf, &format!("material \"{}\": Tf", mtl.name), warn)?;
        }
        Type::Coated => {
            m.kind = BSDF_COATED;
            let index = index.filter(|&n| n > 1.0).unwrap_or(1.5);
            m.eta = [index; 3];
            m.specular = ks.map(|ks| (ks / fresnel::normal_reflectance(index)).min(1.0));
        }
    }
    Ok(())
}

/// A colour that must not exceed 1; more is clamped and said so.
fn reflectance(color: [f32; 3], what: &str, warn: &mut Vec<String>) -> Result<[f32; 3], String> {
    if !color.iter().all(|v| v.is_finite()) {
        return Err(format!("{what} is not finite"));
    }
    let clamped = color.map(|v| v.clamp(0.0, 1.0));
    if clamped != color {
        warn.push(format!("{what} {color:?} lies outside [0, 1]: clamped"));
    }
    Ok(clamped)
}

fn radiance(color: [f32; 3]) -> Result<[f32; 3], String> {
    match color.iter().all(|v| v.is_finite() && (0.0..=1e18).contains(v)) {
        true => Ok(color),
        false => Err(format!("emission {color:?} is negative, NaN or above 1e18")),
    }
}

fn within(v: f32, max: f32, key: &str) -> Result<f32, String> {
    match v {
        v if (0.0..=max).contains(&v) => Ok(v),
        v => Err(format!("{key} is {v}: choose a value from 0 to {max}")),
    }
}
