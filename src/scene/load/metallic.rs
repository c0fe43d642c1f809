//! Makes materials of `[[material]]` tables of type `metallic-roughness`.
use super::material::{Materials, emission, reflectance, warn_once, within};
use super::texture::Kind;
use crate::layout::*;
use crate::scene::description::material::{AlphaMode, MaterialTable};
use std::path::Path;

impl Materials {
    /// Adds a material of glTF 2.0.
    ///
    /// # Errors
    /// A sentence that names the key at fault.
    pub fn push_metallic(
        &mut self,
        t: &MaterialTable,
        directory: &Path,
        warn: &mut Vec<String>,
    ) -> Result<u32, String> {
        let mut m = Self::plain([1.0; 3]);
        let unit = |v: Option<f32>, default: f32, key: &str| within(v.unwrap_or(default), 1.0, key);
        let what = format!("material \"{}\": color", t.name);
        let base = reflectance(t.color.map_or([1.0; 3], |v| v.0), &what, warn)?;
        let metallic = unit(t.metallic, 1.0, "metallic")?;
        m.alpha = unit(t.roughness, 1.0, "roughness")?.powi(2);
        m.emission = emission(t)?;
        m.kind = BSDF_METALLIC;
        m.flags |= MATERIAL_GGX;
        (m.base_color, m.metallic) = (base, metallic);
        m.base_texture = self.ask(t, t.color_texture.as_ref(), Kind::Color, directory, warn)?;
        m.roughness_texture = self.ask(t, t.metallic_roughness_texture.as_ref(), Kind::Data, directory, warn)?;
        self.specular(&mut m, t, directory, warn)?;
        m.transmission_factor = unit(t.transmission_factor, 0.0, "transmission_factor")?;
        m.clearcoat = unit(t.clearcoat, 0.0, "clearcoat")?;
        m.clearcoat_alpha = unit(t.clearcoat_roughness, 0.0, "clearcoat_roughness")?.powi(2);
        self.opacity(&mut m, t, directory, warn)?;
        m.emission_texture = self.ask(t, t.emission_texture.as_ref(), Kind::Color, directory, warn)?;
        m.bump_texture = self.ask(t, t.normal_map.as_ref(), Kind::Data, directory, warn)?;
        if m.bump_texture != NONE {
            m.flags |= MATERIAL_NORMAL_MAP;
        }
        // The two sides of a thin wall are alike.
        if t.two_sided == Some(false) && m.transmission_factor == 0.0 {
            m.flags &= !MATERIAL_TWO_SIDED;
        }
        missing(t, warn);
        Ok(self.push(&t.name, m))
    }

    /// The dielectric's reflectance head on, `((ior - 1) / (ior + 1))^2` times `specular`, which kernels limit to 1.
    fn specular(
        &mut self,
        m: &mut Material,
        t: &MaterialTable,
        directory: &Path,
        warn: &mut Vec<String>,
    ) -> Result<(), String> {
        let ior = t.ior.unwrap_or(1.5);
        if !(0.1..=10.0).contains(&ior) {
            return Err(format!("ior is {ior}: choose a value from 0.1 to 10"));
        }
        let f0 = ((ior - 1.0) / (ior + 1.0)).powi(2);
        let color = t.specular.map_or([1.0; 3], |v| v.0);
        if !color.iter().all(|v| (0.0..=1e6).contains(v)) {
            return Err(format!("specular {color:?} is negative, NaN or above 1e6"));
        }
        m.specular = color.map(|v| v * f0);
        m.specular_texture = self.ask(t, t.specular_texture.as_ref(), Kind::Color, directory, warn)?;
        m.specular_factor = within(t.specular_factor.unwrap_or(1.0), 1.0, "specular_factor")?;
        Ok(())
    }

    fn opacity(
        &mut self,
        m: &mut Material,
        t: &MaterialTable,
        directory: &Path,
        warn: &mut Vec<String>,
    ) -> Result<(), String> {
        let alpha = within(t.opacity.unwrap_or(1.0), 1.0, "opacity")?;
        within(t.alpha_cutoff.unwrap_or(0.5), 1e6, "alpha_cutoff")?;
        match t.alpha_mode {
            Some(AlphaMode::Opaque) => {}
            None => {
                m.opacity = alpha;
                m.opacity_texture = self.ask(t, t.opacity_texture.as_ref(), Kind::Mask, directory, warn)?;
            }
            Some(mode) => {
                if mode == AlphaMode::Mask {
                    warn_once(warn, "alpha_mode mask is rendered as blend:", &t.name);
                }
                m.opacity = alpha;
                let texture = t.opacity_texture.as_ref();
                m.opacity_texture = match texture {
                    Some(_) => self.ask(t, texture, Kind::Mask, directory, warn)?,
                    None => self.ask(t, t.color_texture.as_ref(), Kind::Alpha, directory, warn)?,
                };
            }
        }
        Ok(())
    }
}

/// Warns of what is not rendered.
fn missing(t: &MaterialTable, warn: &mut Vec<String>) {
    let set = |v: Option<f32>, default: f32| v.is_some_and(|v| v != default);
    let all = [
        (set(t.normal_scale, 1.0), "normal_scale is not rendered:"),
        (t.specular_factor_texture.is_some(), "specular_factor_texture is not rendered:"),
        (t.transmission_texture.is_some(), "transmission_texture is not rendered:"),
        (t.clearcoat_texture.is_some(), "clearcoat_texture is not rendered:"),
        (t.clearcoat_roughness_texture.is_some(), "clearcoat_roughness_texture is not rendered:"),
        (t.unlit, "unlit is not rendered:"),
    ];
    all.iter().filter(|a| a.0).for_each(|a| warn_once(warn, a.1, &t.name));
}
