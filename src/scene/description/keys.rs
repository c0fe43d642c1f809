//! Which keys of a `[[material]]` table each type reads.
use super::material::{Distribution, MaterialTable, Type};
use Type::{Coated, Conductor, Dielectric, Diffuse, MetallicRoughness, Mirror};

/// A key, whether a table has it, and the types that read it. Some keys that have their default look as if they were absent.
type Key = (&'static str, fn(&MaterialTable) -> bool, &'static [Type]);

const ALL: &[Type] = &[Diffuse, Conductor, Dielectric, Mirror, Coated, MetallicRoughness];
const OPAQUE: &[Type] = &[Diffuse, Conductor, Mirror, Coated, MetallicRoughness];
const BUMPED: &[Type] = &[Diffuse, Conductor, Dielectric, Mirror, Coated];
const MICROFACETS: &[Type] = &[Conductor, Dielectric, Mirror, Coated];
const SPECULAR: &[Type] = &[Conductor, Dielectric, Mirror, Coated, MetallicRoughness];
const METALLIC: &[Type] = &[MetallicRoughness];

/// All keys but `name` and `type`.
const KEYS: [Key; 41] = [
    ("color", |t| t.color.is_some(), OPAQUE),
    ("color_texture", |t| t.color_texture.is_some(), ALL),
    ("alpha", |t| t.alpha != 0.0, MICROFACETS),
    ("alpha_v", |t| t.alpha_v.is_some(), BUMPED), // an error of diffuse and coated ones
    ("distribution", |t| t.distribution != Distribution::default(), MICROFACETS),
    ("eta", |t| t.eta.is_some(), &[Conductor]),
    ("k", |t| t.k.is_some(), &[Conductor]),
    ("metal", |t| t.metal.is_some(), &[Conductor]),
    ("ior", |t| t.ior.is_some(), &[Dielectric, Coated, MetallicRoughness]),
    ("specular", |t| t.specular.is_some(), SPECULAR),
    ("specular_texture", |t| t.specular_texture.is_some(), SPECULAR),
    ("transmission", |t| t.transmission.is_some(), &[Dielectric]),
    ("emission", |t| t.emission.is_some(), ALL),
    ("emission_texture", |t| t.emission_texture.is_some(), ALL),
    ("emission_strength", |t| t.emission_strength.is_some(), ALL),
    ("emission_two_sided", |t| t.emission_two_sided, ALL),
    ("opacity", |t| t.opacity.is_some(), OPAQUE),
    ("opacity_texture", |t| t.opacity_texture.is_some(), OPAQUE),
    ("bump", |t| t.bump.is_some(), BUMPED),
    ("bump_scale", |t| t.bump_scale.is_some(), BUMPED),
    ("normal_map", |t| t.normal_map.is_some(), ALL),
    ("normal_scale", |t| t.normal_scale.is_some(), ALL),
    ("roughness_texture", |t| t.roughness_texture.is_some(), MICROFACETS),
    ("two_sided", |t| t.two_sided.is_some(), OPAQUE),
    ("nonlinear", |t| t.nonlinear, &[Coated]),
    ("metallic", |t| t.metallic.is_some(), METALLIC),
    ("roughness", |t| t.roughness.is_some(), METALLIC),
    ("metallic_roughness_texture", |t| t.metallic_roughness_texture.is_some(), METALLIC),
    ("specular_factor", |t| t.specular_factor.is_some(), METALLIC),
    ("specular_factor_texture", |t| t.specular_factor_texture.is_some(), METALLIC),
    ("transmission_factor", |t| t.transmission_factor.is_some(), METALLIC),
    ("transmission_texture", |t| t.transmission_texture.is_some(), METALLIC),
    ("clearcoat", |t| t.clearcoat.is_some(), METALLIC),
    ("clearcoat_texture", |t| t.clearcoat_texture.is_some(), METALLIC),
    ("clearcoat_roughness", |t| t.clearcoat_roughness.is_some(), METALLIC),
    ("clearcoat_roughness_texture", |t| t.clearcoat_roughness_texture.is_some(), METALLIC),
    ("clearcoat_normal_map", |t| t.clearcoat_normal_map.is_some(), METALLIC),
    ("clearcoat_normal_scale", |t| t.clearcoat_normal_scale.is_some(), METALLIC),
    ("alpha_mode", |t| t.alpha_mode.is_some(), METALLIC),
    ("alpha_cutoff", |t| t.alpha_cutoff.is_some(), METALLIC),
    ("unlit", |t| t.unlit, METALLIC),
];

/// A warning about the keys of a table that its type does not read.
pub fn warning(t: &MaterialTable) -> Option<String> {
    let unread = |(name, is_set, types): &Key| (is_set(t) && !types.contains(&t.kind)).then_some(*name);
    told(&format!("material \"{}\": a {} material", t.name, name(t.kind)), KEYS.iter().filter_map(unread))
}

/// A warning that `what` does not read some keys, if there are any.
pub fn told<'a>(what: &str, unread: impl Iterator<Item = &'a str>) -> Option<String> {
    let unread: Vec<_> = unread.collect();
    (!unread.is_empty()).then(|| format!("{what} does not read {}", unread.join(", ")))
}

/// The name of a type in scene files.
fn name(kind: Type) -> &'static str {
    match kind {
        Diffuse => "diffuse",
        Conductor => "conductor",
        Dielectric => "dielectric",
        Mirror => "mirror",
        Coated => "coated",
        MetallicRoughness => "metallic-roughness",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::Material;
    use crate::scene::load::material::Materials;
    use std::path::Path;

    /// The material of a table, and what is said about it.
    fn build(t: &toml::Table, folder: &Path) -> (Result<Material, String>, String) {
        let (mut materials, mut warnings) = (Materials::default(), Vec::new());
        let table: MaterialTable = toml::from_str(&t.to_string()).unwrap();
        let built = materials.push_table(&table, folder, &mut warnings).map(|_| materials.list[0]);
        (built, warnings.concat())
    }

    /// A value that is nobody's default.
    fn value(key: &str) -> toml::Value {
        match key {
            "distribution" => "ggx".into(),
            "metal" => "Au".into(),
            "alpha_mode" => "mask".into(),
            "emission_two_sided" | "nonlinear" | "unlit" => true.into(),
            "two_sided" => false.into(),
            "bump" => "a.png".into(),
            key if key.ends_with("_texture") || key.ends_with("_map") => "a.png".into(),
            _ => 0.3.into(),
        }
    }

    /// What a key is a part of.
    fn whole(key: &str) -> Option<(&'static str, toml::Value)> {
        match key {
            "emission_strength" => Some(("emission", 1.0.into())),
            "alpha_cutoff" => Some(("alpha_mode", "mask".into())),
            "transmission_texture" => Some(("transmission_factor", 0.5.into())),
            key if key.starts_with("clearcoat_") => Some(("clearcoat", 0.5.into())),
            _ => None,
        }
    }

    #[test]
    fn every_key_counts_or_is_told_not_to() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.png"), "").unwrap();
        for (kind, (key, _, types)) in ALL.iter().flat_map(|kind| KEYS.iter().map(move |key| (*kind, key))) {
            let mut table = toml::Table::from_iter([("type".to_owned(), name(kind).into())]);
            table.extend(whole(key).map(|(key, value)| (key.to_owned(), value)));
            let before = build(&table, folder.path()).0.unwrap();
            table.insert((*key).to_owned(), value(key));
            let (built, said) = build(&table, folder.path());
            let words: Vec<_> = said.split([' ', ',']).collect();
            let is_told = said.contains(&format!("a {} material does not read", name(kind))) && words.contains(key);
            let counts = built.is_ok_and(|m| bytemuck::bytes_of(&m) != bytemuck::bytes_of(&before));
            let refused = build(&table, folder.path()).0.is_err_and(|what| what.contains(*key));
            assert!(counts || is_told || refused, "{kind:?} {key}: {said}");
            assert_eq!(is_told, !types.contains(&kind), "{kind:?} {key}: {said}");
        }
    }

    #[test]
    fn a_color_out_of_range_is_told_once_where_it_is_read() {
        let colors = || KEYS.iter().filter(|key| ["color", "specular", "transmission"].contains(&key.0));
        for (kind, (key, _, types)) in BUMPED.iter().flat_map(|kind| colors().map(move |key| (*kind, key))) {
            let table = toml::Table::from_iter([("type".into(), name(kind).into()), ((*key).to_owned(), 2.0.into())]);
            let said = build(&table, Path::new("")).1;
            let expected = usize::from(types.contains(&kind));
            let found = [": clamped".to_owned(), format!("{key} [2.0")].map(|what| said.matches(&what).count());
            assert_eq!(found, [expected; 2], "{kind:?} {key}: {said}");
        }
    }

    #[test]
    fn the_table_has_all_keys() {
        let unknown = toml::from_str::<MaterialTable>("nothing = 1").unwrap_err().to_string();
        let mut known: Vec<_> =
            unknown.split('`').skip(3).step_by(2).filter(|w| !["name", "type"].contains(w)).collect();
        let mut listed: Vec<_> = KEYS.iter().map(|key| key.0).collect();
        known.sort_unstable();
        listed.sort_unstable();
        assert_eq!(known, listed);
    }

    #[test]
    fn one_line_names_all() {
        let table = MaterialTable { name: "x".into(), unlit: true, clearcoat: Some(1.0), ..MaterialTable::default() };
        assert_eq!(warning(&table).unwrap(), "material \"x\": a diffuse material does not read clearcoat, unlit");
        assert_eq!(warning(&MaterialTable { kind: MetallicRoughness, ..table }), None);
    }
}
