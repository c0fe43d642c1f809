//! New numbers of a material, with the ranges that its table has.
use crate::error::Checked;
use crate::layout::{BSDF_CONDUCTOR, BSDF_DIELECTRIC, BSDF_METALLIC, MATERIAL_MASKED, MATERIAL_UNLIT, Material};
use crate::scene::load::material::{is_masked, mark_clear_wall, radiance, reflectance, within};
use crate::scene::load::metallic::reflected_head_on;
use crate::scene::pose::MaterialChange;

/// The material with these numbers. Reflectances are clamped to [0, 1], since curves may overshoot.
///
/// # Errors
/// A sentence that names the number at fault.
pub fn changed(m: &Material, to: &MaterialChange) -> Checked<Material> {
    // Warnings, which alone need a place, are those of the check before.
    let tint = |value: [f32; 3], key: &str| reflectance(value, "", key, &mut Vec::new());
    let mut m = *m;
    if let Some(color) = to.color {
        match m.kind {
            BSDF_DIELECTRIC => return Err("a dielectric has no color: change specular or transmission".to_owned()),
            BSDF_CONDUCTOR => m.specular = tint(color, "color")?,
            _ if m.flags & MATERIAL_UNLIT != 0 => m.emission = tint(color, "color")?,
            _ => m.base_color = tint(color, "color")?,
        }
    }
    if let Some(specular) = to.specular {
        m.specular = match m.kind {
            BSDF_METALLIC => reflected_head_on(specular, m.eta[0])?,
            _ => tint(specular, "specular")?,
        };
    }
    if let Some(transmission) = to.transmission {
        m.transmission = tint(transmission, "transmission")?;
    }
    // What is unlit shows its color in place of light of its own.
    if let Some(emission) = to.emission.filter(|_| m.flags & MATERIAL_UNLIT == 0) {
        m.emission = radiance(emission, "emission")?;
    }
    if let Some(alpha) = to.alpha {
        m.alpha = within(alpha, 1.0, "alpha")?;
    }
    if let Some(opacity) = to.opacity {
        m.opacity = within(opacity, 1.0, "opacity")?;
        m.flags = m.flags & !MATERIAL_MASKED | if is_masked(&m) { MATERIAL_MASKED } else { 0 };
    }
    mark_clear_wall(&mut m);
    Ok(m)
}
