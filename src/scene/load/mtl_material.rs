//! The meaning of MTL statements. A block becomes, by the first rule that fits:
//! 1. `Pm` of at least 0.5: a conductor whose reflectance at normal incidence is Kd. With map_Kd, the tint of a perfect
//!    mirror, since indices cannot be textured.
//! 2. `illum` 3 or 5 with black Kd and no map_Kd: a mirror tinted by Ks (white where Ks is black).
//! 3. `illum` 4, 6, 7 or 9 without map_d, or d below 1 together with Tf and Ni above 1: a dielectric of index Ni
//!    (1.5 where absent), its transmission tinted by Tf. It is none where Ni is 0 or 1, which Maya writes of what is opaque, nor for
//!    `illum` 6 or 9 with d below 1 and no Tf, as Blender writes an alpha.
//! 4. Ks above black and `illum` other than 0 and 1: a diffuse base Kd under a coat of index Ni (1.5 where it is not
//!    above 1). Ks is the coat's reflectance at normal incidence, capped at what the index gives.
//! 5. Otherwise diffuse.
//!
//! Roughness: alpha = Pr^2; without Pr, sqrt(2 / (Ns + 2)) for coats and conductors, and smooth for 2 and 3.
//! d (or 1 - Tr) and map_d are opacity except on dielectrics. `norm` wins over a bump map. Bump heights are `-bm` world
//! units; without -bm, 0.0005 of the scene's diagonal. A bump map whose colours are those of a normal map is read as one, with `-bm`
//! as the factor of its x and y. A black Kd under a map_Kd counts as white.
use super::material::{Materials, radiance, reflectance};
use super::metal;
use super::mtl::{Map, Mtl, map};
use super::texture::Kind;
use crate::error::Checked;
use crate::layout::{BSDF_COATED, BSDF_CONDUCTOR, BSDF_DIELECTRIC, BSDF_DIFFUSE, MATERIAL_NORMAL_MAP, Material, NONE};
use crate::scene::MAX_COORDINATE;
use crate::scene::description::material::Type;

impl Materials {
    /// Adds what an MTL block means (module documentation).
    ///
    /// # Errors
    /// A sentence that names the statement at fault.
    pub fn push_mtl(&mut self, mtl: &Mtl, warn: &mut Vec<String>) -> Checked<u32> {
        let block = &mtl.block;
        let mut m = Self::plain([0.0; 3]);
        let place = format!("material \"{}\"", mtl.name());
        let textured = block.diffuse_texture.is_some();
        let kd = match block.diffuse.unwrap_or([if textured { 1.0 } else { 0.6 }; 3]) {
            [0.0, 0.0, 0.0] if textured => [1.0; 3],
            kd => kd,
        };
        m.base_color = reflectance(kd, &place, "Kd", warn)?;
        let or_mapped = |color: Option<[f32; 3]>, mapped: bool| color.unwrap_or([f32::from(mapped); 3]);
        let ks = reflectance(or_mapped(block.specular, block.specular_texture.is_some()), &place, "Ks", warn)?;
        m.emission = radiance(or_mapped(block.emissive, mtl.map("map_Ke").is_some()), "emission")?;
        m.opacity = block.dissolve.unwrap_or(1.0).clamp(0.0, 1.0);
        let kind = mtl_kind(mtl, m.base_color, ks, m.opacity);
        mtl_interface(&mut m, mtl, kind, ks, warn)?;
        self.mtl_textures(&mut m, mtl, kind, warn);
        let index = self.push(mtl.name(), m);
        if m.bump_texture != NONE && bump(mtl).is_some_and(|b| b.bump.is_none()) {
            self.default_bumps.push(index);
        }
        Ok(index)
    }

    fn mtl_textures(&mut self, m: &mut Material, mtl: &Mtl, kind: Type, warn: &mut Vec<String>) {
        let textures = &mut self.textures;
        let mut ask = |map: Option<Map>, kind| match map {
            Some(map) => textures.request(&mtl.directory, &map.file, kind, map.mapping, warn),
            None => NONE,
        };
        let of = |text: &Option<String>| text.as_deref().and_then(map);
        match kind {
            Type::Conductor => m.specular_texture = ask(of(&mtl.block.diffuse_texture), Kind::Color),
            Type::Mirror | Type::Dielectric | Type::MetallicRoughness => {}
            Type::Diffuse => m.base_texture = ask(of(&mtl.block.diffuse_texture), Kind::Color),
            Type::Coated => {
                m.base_texture = ask(of(&mtl.block.diffuse_texture), Kind::Color);
                m.specular_texture = ask(of(&mtl.block.specular_texture), Kind::Color);
            }
        }
        let roughness = mtl.map("map_Pr").filter(|_| kind != Type::Diffuse);
        if roughness.is_some() {
            m.roughness_texture = ask(roughness, Kind::Roughness);
            m.alpha = mtl.number("Pr").map_or(1.0, |_| m.alpha);
        }
        if kind != Type::Dielectric {
            m.opacity_texture = ask(of(&mtl.block.dissolve_texture), Kind::Mask);
        }
        if m.emission != [0.0; 3] {
            m.emission_texture = ask(mtl.map("map_Ke"), Kind::Light);
        }
        self.mtl_relief(m, mtl, warn);
    }

    /// The bump or normal map. Blender writes normal maps as bump maps, with their strength as `-bm`.
    fn mtl_relief(&mut self, m: &mut Material, mtl: &Mtl, warn: &mut Vec<String>) {
        let textures = &mut self.textures;
        let (norm, bump) = (mtl.map("norm"), bump(mtl));
        let height = bump.as_ref().and_then(|b| b.bump).unwrap_or(1.0);
        let said = norm.is_some();
        let Some(Map { file, mapping, .. }) = norm.or(bump) else { return };
        let seen = !said && textures.holds_normals(&mtl.directory, &file);
        let kind = if said || seen { Kind::Data } else { Kind::Height };
        m.bump_texture = textures.request(&mtl.directory, &file, kind, mapping, warn);
        m.bump_scale = height.clamp(-MAX_COORDINATE as f32, MAX_COORDINATE as f32);
        if seen {
            m.normal_scale = height;
            let name = mtl.name();
            let what =
                "is read as a normal map, as its colours say: name it by norm, or save it in grey if it holds heights";
            warn.push(format!("material \"{name}\": bump map {file} {what}"));
        }
        if m.bump_texture != NONE && kind == Kind::Data {
            m.flags |= MATERIAL_NORMAL_MAP;
        }
    }
}

fn bump(mtl: &Mtl) -> Option<Map> {
    mtl.block.normal_texture.as_deref().and_then(map)
}

/// Which of the rules of the module documentation applies.
fn mtl_kind(mtl: &Mtl, kd: [f32; 3], ks: [f32; 3], d: f32) -> Type {
    let (block, masked) = (&mtl.block, mtl.block.dissolve_texture.is_some());
    let black = kd == [0.0; 3] && block.diffuse_texture.is_none();
    let tinted_glass = d < 1.0 && mtl.tf().is_some() && block.optical_density.is_some_and(|n| n > 1.0);
    let refracts = block.optical_density.is_none_or(|n| n != 0.0 && n != 1.0);
    let is_alpha = matches!(block.illumination_model, Some(6 | 9)) && d < 1.0 && mtl.tf().is_none();
    match block.illumination_model.unwrap_or(2) {
        _ if mtl.number("Pm").is_some_and(|pm| pm >= 0.5) => Type::Conductor,
        3 | 5 if black => Type::Mirror,
        4 | 6 | 7 | 9 if !masked && refracts && !is_alpha => Type::Dielectric,
        _ if tinted_glass && !masked => Type::Dielectric,
        0 | 1 => Type::Diffuse,
        _ if ks != [0.0; 3] => Type::Coated,
        _ => Type::Diffuse,
    }
}

fn mtl_interface(m: &mut Material, mtl: &Mtl, kind: Type, ks: [f32; 3], warn: &mut Vec<String>) -> Checked {
    let glossy = (2.0 / (mtl.block.shininess.unwrap_or(0.0).max(0.0) + 2.0)).sqrt();
    let default = if matches!(kind, Type::Mirror | Type::Dielectric) { 0.0 } else { glossy };
    m.alpha = mtl.number("Pr").map_or(default, |pr| pr.clamp(0.0, 1.0).powi(2));
    let index = mtl.block.optical_density.filter(|n| (0.1..=10.0).contains(n));
    match kind {
        Type::Diffuse => m.kind = BSDF_DIFFUSE,
        Type::Conductor | Type::Mirror | Type::MetallicRoughness => {
            m.kind = BSDF_CONDUCTOR;
            (m.eta, m.k) = ([0.0; 3], [1.0; 3]);
            let white = if ks == [0.0; 3] { [1.0; 3] } else { ks };
            m.specular = if kind == Type::Mirror { white } else { m.base_color };
            if kind == Type::Conductor && mtl.block.diffuse_texture.is_none() {
                let constants = m.base_color.map(metal::metal_from_reflectance);
                (m.eta, m.k, m.specular) = (constants.map(|c| c.0), constants.map(|c| c.1), [1.0; 3]);
            }
        }
        Type::Dielectric => {
            m.kind = BSDF_DIELECTRIC;
            m.eta = [index.unwrap_or(1.5); 3];
            m.opacity = 1.0;
            let place = format!("material \"{}\"", mtl.name());
            m.transmission = reflectance(mtl.tf().unwrap_or([1.0; 3]), &place, "Tf", warn)?;
        }
        Type::Coated => {
            m.kind = BSDF_COATED;
            let index = index.filter(|&n| n > 1.0).unwrap_or(1.5);
            m.eta = [index; 3];
            m.specular = ks.map(|ks| (ks / metal::normal_reflectance(index)).min(1.0));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::TEXTURE_SRGB;
    use crate::scene::load::mtl;

    #[test]
    fn bump_maps_that_hold_normals_are_read_as_normal_maps() {
        let folder = tempfile::tempdir().unwrap();
        for (name, color) in [("nrm.png", [128, 128, 255]), ("grey.png", [128; 3])] {
            image::RgbImage::from_pixel(4, 4, image::Rgb(color)).save(folder.path().join(name)).unwrap();
        }
        let read = |text: &str| {
            let block = &mtl::parse(&folder.path().join("a.mtl"), &format!("newmtl a\n{text}")).unwrap()[0];
            let (mut materials, mut warnings) = (Materials::default(), Vec::new());
            materials.push_mtl(block, &mut warnings).unwrap();
            let textures = materials.textures.decode().unwrap().textures;
            assert!(textures.len() == 1 && textures[0].flags & TEXTURE_SRGB == 0, "{text}");
            let m = materials.list[0];
            (m.flags & MATERIAL_NORMAL_MAP != 0, m.normal_scale, m.bump_scale, warnings)
        };
        let (normals, scale, _, said) = read("map_Bump -bm 0.25 nrm.png");
        assert_eq!((normals, scale, said.len()), (true, 0.25, 1));
        assert!(said[0].starts_with("material \"a\": bump map nrm.png is read as a normal map"), "{said:?}");
        assert_eq!(read("map_Bump nrm.png").1, 1.0);
        assert_eq!(read("map_Bump -bm 0.25 grey.png"), (false, 1.0, 0.25, Vec::new()));
        assert_eq!(read("norm nrm.png\nmap_Bump -bm 0.25 nrm.png"), (true, 1.0, 0.25, Vec::new()));
        assert!(read("norm grey.png").0, "control");
    }
}
