//! Makes materials of `[[material]]` tables of type `metallic-roughness`.
use super::material::{Materials, emission, reflectance, within};
use super::texture::Kind;
use crate::error::Checked;
use crate::layout::*;
use crate::scene::description::material::{AlphaMode, MaterialTable};
use crate::scene::description::texture::TextureTable;
use std::path::Path;

/// What a material is made of.
struct Source<'a> {
    table: &'a MaterialTable,
    directory: &'a Path,
    warn: &'a mut Vec<String>,
}

impl Materials {
    /// Adds a material of glTF 2.0.
    ///
    /// # Errors
    /// A sentence that names the key at fault.
    pub fn push_metallic(&mut self, table: &MaterialTable, directory: &Path, warn: &mut Vec<String>) -> Checked<u32> {
        let (mut m, mut s) = (Self::plain([1.0; 3]), Source { table, directory, warn });
        let place = format!("material \"{}\"", table.name);
        m.base_color = reflectance(table.color.map_or([1.0; 3], |v| v.0), &place, "color", s.warn)?;
        m.emission = emission(table)?;
        m.flags |= MATERIAL_GGX;
        m.base_texture = self.texture(&mut s, &table.color_texture, Kind::Color)?;
        m.emission_texture = self.texture(&mut s, &table.emission_texture, Kind::Light)?;
        let fades = self.opacity(&mut m, &mut s)?;
        m.normal_scale = table.normal_scale.unwrap_or(1.0);
        self.layers(&mut m, &mut s)?;
        if !(m.normal_scale.is_finite() && m.clearcoat_normal_scale.is_finite()) {
            return Err("normal_scale or clearcoat_normal_scale is not a finite number".to_owned());
        }
        m.bump_texture = self.texture(&mut s, &table.normal_map, Kind::Data)?;
        if m.bump_texture != NONE {
            m.flags |= MATERIAL_NORMAL_MAP;
        }
        // The two sides of a thin wall are alike.
        if table.two_sided == Some(false) && m.transmission_factor == 0.0 {
            m.flags &= !MATERIAL_TWO_SIDED;
        }
        if table.emission_two_sided {
            m.flags |= MATERIAL_EMITS_BEHIND;
        }
        if table.unlit {
            make_unlit(&mut m);
        }
        let index = self.push(&table.name, m);
        if fades {
            self.take_vertex_alpha.push(index);
        }
        Ok(index)
    }

    fn texture(&mut self, s: &mut Source, texture: &Option<TextureTable>, kind: Kind) -> Checked<u32> {
        self.ask(texture.as_ref(), kind, s.directory, s.warn)
    }

    fn layers(&mut self, m: &mut Material, s: &mut Source) -> Checked {
        let t = s.table;
        let unit = |v: Option<f32>, default: f32, key: &str| within(v.unwrap_or(default), 1.0, key);
        m.kind = BSDF_METALLIC;
        m.metallic = unit(t.metallic, 1.0, "metallic")?;
        m.alpha = unit(t.roughness, 1.0, "roughness")?.powi(2);
        m.roughness_texture = self.texture(s, &t.metallic_roughness_texture, Kind::Data)?;
        let ior = t.ior.unwrap_or(1.5);
        if !(ior == 0.0 || (0.1..=1000.0).contains(&ior)) {
            return Err(format!("ior is {ior}: choose a value from 0.1 to 1000, or 0 for all to be reflected"));
        }
        m.eta = [ior; 3];
        m.specular = reflected_head_on(t.specular.map_or([1.0; 3], |v| v.0), ior)?;
        m.specular_texture = self.texture(s, &t.specular_texture, Kind::Color)?;
        m.specular_factor = unit(t.specular_factor, 1.0, "specular_factor")?;
        m.specular_factor_texture = self.texture(s, &t.specular_factor_texture, Kind::Alpha)?;
        m.transmission_factor = unit(t.transmission_factor, 0.0, "transmission_factor")?;
        m.clearcoat = unit(t.clearcoat, 0.0, "clearcoat")?;
        m.clearcoat_alpha = unit(t.clearcoat_roughness, 0.0, "clearcoat_roughness")?.powi(2);
        if m.transmission_factor > 0.0 {
            m.transmission_texture = self.texture(s, &t.transmission_texture, Kind::Red)?;
        }
        if m.clearcoat > 0.0 {
            m.clearcoat_texture = self.texture(s, &t.clearcoat_texture, Kind::Red)?;
            m.clearcoat_roughness_texture = self.texture(s, &t.clearcoat_roughness_texture, Kind::Roughness)?;
            m.clearcoat_normal_texture = self.texture(s, &t.clearcoat_normal_map, Kind::Data)?;
            m.clearcoat_normal_scale = t.clearcoat_normal_scale.unwrap_or(1.0);
        }
        Ok(())
    }

    /// Returns whether alpha makes holes, that of vertices too: not below a cutoff of 0.
    fn opacity(&mut self, m: &mut Material, s: &mut Source) -> Checked<bool> {
        let t = s.table;
        let alpha = within(t.opacity.unwrap_or(1.0), 1.0, "opacity")?;
        let cutoff = within(t.alpha_cutoff.unwrap_or(0.5), 1e6, "alpha_cutoff")?;
        match t.alpha_mode {
            Some(AlphaMode::Mask) if cutoff > 0.0 => m.alpha_cutoff = cutoff,
            Some(AlphaMode::Opaque | AlphaMode::Mask) => return Ok(false),
            _ => {}
        }
        m.opacity = alpha;
        m.opacity_texture = match (&t.opacity_texture, t.alpha_mode) {
            (Some(_), _) => self.texture(s, &t.opacity_texture, Kind::Mask)?,
            (None, Some(_)) => self.texture(s, &t.color_texture, Kind::Alpha)?,
            (None, None) => NONE,
        };
        Ok(t.alpha_mode.is_some())
    }
}

/// Of a dielectric with this `specular` of its table: ((ior - 1) / (ior + 1))^2 of it, which kernels limit to 1. An index of 0 reflects
/// all, as KHR_materials_ior has it.
///
/// # Errors
/// For a colour that is out of range.
pub fn reflected_head_on(specular: [f32; 3], ior: f32) -> Checked<[f32; 3]> {
    match specular.iter().all(|v| (0.0..=1e6).contains(v)) {
        true => Ok(specular.map(|v| v * ((ior - 1.0) / (ior + 1.0)).powi(2))),
        false => Err(format!("specular {specular:?} is negative, NaN or above 1e6")),
    }
}

/// The surface emits its base colour to both sides, and scatters no light.
fn make_unlit(m: &mut Material) {
    (m.emission, m.emission_texture) = (m.base_color, m.base_texture);
    (m.base_color, m.base_texture, m.kind) = ([0.0; 3], NONE, BSDF_DIFFUSE);
    m.flags |= MATERIAL_UNLIT | MATERIAL_EMITS_BEHIND;
}
