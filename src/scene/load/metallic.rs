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
        m.flags |= MATERIAL_GGX;
        let color = self.ask(t, t.color_texture.as_ref(), Kind::Color, directory, warn)?;
        m.roughness_texture = self.ask(t, t.metallic_roughness_texture.as_ref(), Kind::Roughness, directory, warn)?;
        warn_once(warn, "metallic-roughness is rendered as a conductor or a coat:", &t.name);
        if metallic >= 0.5 {
            (m.kind, m.eta, m.k) = (BSDF_CONDUCTOR, [0.0; 3], [1.0; 3]);
            (m.specular, m.specular_texture) = (base, color);
        } else {
            m.kind = BSDF_COATED;
            (m.base_color, m.base_texture) = (base, color);
        }
        self.opacity(&mut m, t, directory, warn)?;
        m.emission_texture = self.ask(t, t.emission_texture.as_ref(), Kind::Color, directory, warn)?;
        m.bump_texture = self.ask(t, t.normal_map.as_ref(), Kind::Data, directory, warn)?;
        if m.bump_texture != NONE {
            m.flags |= MATERIAL_NORMAL_MAP;
        }
        if t.two_sided == Some(false) {
            m.flags &= !MATERIAL_TWO_SIDED;
        }
        missing(t, warn);
        Ok(self.push(&t.name, m))
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
    let specular = t.specular.is_some() || t.specular_texture.is_some();
    let all = [
        (set(t.normal_scale, 1.0), "normal_scale is not rendered:"),
        (set(t.specular_factor, 1.0) || specular || t.specular_factor_texture.is_some(), "specular is not rendered:"),
        (set(t.ior, 1.5), "ior of metallic-roughness is not rendered:"),
        (set(t.transmission_factor, 0.0), "transmission is not rendered:"),
        (set(t.clearcoat, 0.0), "clearcoat is not rendered:"),
        (t.unlit, "unlit is not rendered:"),
    ];
    all.iter().filter(|a| a.0).for_each(|a| warn_once(warn, a.1, &t.name));
}
