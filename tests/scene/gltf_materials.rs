//! Tests which picture and which number of a glTF material goes where, how pictures lie on a surface, and colours of
//! vertices.
use crate::gltf_file::{data, triangle};
use crate::gltf_motion::{add, load};
use serde_json::{Value, json};
use std::f32::consts::FRAC_PI_2;
use tallow::layout::*;
use tallow::scene::Scene;

const SLOTS: u32 = 10;

/// The four bytes of all texels of the picture of a slot, which is `slot + 1` texels wide.
fn texel(slot: u32) -> [u8; 4] {
    [10, 50, 90, 130].map(|channel| channel + slot as u8)
}

/// The triangle with a picture for every slot; texture `i` shows picture `SLOTS - 1 - i`.
pub fn with_pictures() -> Value {
    let mut json = triangle();
    let picture = |slot: u32| {
        let mut png = std::io::Cursor::new(Vec::new());
        let texels = image::RgbaImage::from_pixel(slot + 1, 1, image::Rgba(texel(slot)));
        texels.write_to(&mut png, image::ImageFormat::Png).unwrap();
        json!({ "uri": data(&png.into_inner()) })
    };
    json["images"] = (0..SLOTS).map(picture).collect();
    json["textures"] = (0..SLOTS).map(|i| json!({ "source": SLOTS - 1 - i })).collect();
    json
}

/// A reference to the picture of a slot.
fn shows(slot: u32) -> Value {
    json!({ "index": SLOTS - 1 - slot })
}

/// Every number is another one, and none is a default.
fn full() -> Value {
    let mut json = with_pictures();
    json["materials"][0] = json!({
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.1875, 0.3125, 0.4375, 0.6875], "baseColorTexture": shows(0),
            "metallicFactor": 0.25, "roughnessFactor": 0.5, "metallicRoughnessTexture": shows(1)
        },
        "normalTexture": { "index": shows(2)["index"], "scale": 2.5 },
        "emissiveFactor": [0.5, 0.25, 1.0], "emissiveTexture": shows(3),
        "alphaMode": "MASK", "alphaCutoff": 0.125, "doubleSided": true,
        "extensions": {
            "KHR_materials_clearcoat": {
                "clearcoatFactor": 0.625, "clearcoatTexture": shows(4),
                "clearcoatRoughnessFactor": 0.75, "clearcoatRoughnessTexture": shows(5),
                "clearcoatNormalTexture": { "index": shows(6)["index"], "scale": 3.5 }
            },
            "KHR_materials_transmission": { "transmissionFactor": 0.375, "transmissionTexture": shows(7) },
            "KHR_materials_specular": {
                "specularFactor": 0.875, "specularTexture": shows(8),
                "specularColorFactor": [0.25, 0.5, 2.0], "specularColorTexture": shows(9)
            },
            "KHR_materials_ior": { "ior": 3.0 },
            "KHR_materials_emissive_strength": { "emissiveStrength": 4.0 }
        }
    });
    json
}

#[test]
fn every_picture_goes_to_its_slot() {
    let scene = load(&full());
    let m = &scene.materials[0];
    let grey = |slot, channel: usize| [texel(slot)[channel]; 4];
    let rows = [
        (0, m.base_texture, texel(0), TEXTURE_SRGB),
        (0, m.opacity_texture, grey(0, 3), 0),
        (1, m.roughness_texture, texel(1), 0),
        (2, m.bump_texture, texel(2), 0),
        (3, m.emission_texture, texel(3), TEXTURE_SRGB),
        (4, m.clearcoat_texture, grey(4, 0), 0),
        (5, m.clearcoat_roughness_texture, grey(5, 1), 0),
        (6, m.clearcoat_normal_texture, texel(6), 0),
        (7, m.transmission_texture, grey(7, 0), 0),
        (8, m.specular_factor_texture, grey(8, 3), 0),
        (9, m.specular_texture, texel(9), TEXTURE_SRGB),
    ];
    let seen = |t: &Texture| (t.width, scene.texels[t.first as usize].to_le_bytes(), t.flags);
    let wrong: Vec<_> = rows
        .into_iter()
        .map(|(slot, found, texel, flags)| {
            (slot, scene.textures.get(found as usize).map(seen), (slot + 1, texel, flags))
        })
        .filter(|(_, found, expected)| *found != Some(*expected))
        .collect();
    assert!(wrong.is_empty(), "slot, found, expected: {wrong:?}");
    assert_eq!(scene.textures.len(), 11, "{:?}", scene.warnings);
}

/// A material whose pictures and derived numbers are those of `found`, which other tests look at.
pub fn with_pictures_of(found: &Material, numbers: Material) -> Material {
    Material {
        base_texture: found.base_texture,
        specular_texture: found.specular_texture,
        opacity_texture: found.opacity_texture,
        bump_texture: found.bump_texture,
        roughness_texture: found.roughness_texture,
        emission_texture: found.emission_texture,
        specular_factor_texture: found.specular_factor_texture,
        transmission_texture: found.transmission_texture,
        clearcoat_texture: found.clearcoat_texture,
        clearcoat_roughness_texture: found.clearcoat_roughness_texture,
        clearcoat_normal_texture: found.clearcoat_normal_texture,
        emission_weight: found.emission_weight,
        coat_table: found.coat_table,
        // What only other kinds of materials read.
        transmission: [1.0; 3],
        bump_scale: 1.0,
        kind: BSDF_METALLIC,
        ..numbers
    }
}

#[test]
fn every_number_goes_to_its_place() {
    let found = load(&full()).materials[0];
    let common = MATERIAL_GGX | MATERIAL_TWO_SIDED | MATERIAL_NORMAL_MAP;
    let numbers = Material {
        base_color: [0.1875, 0.3125, 0.4375],
        opacity: 0.6875,
        alpha_cutoff: 0.125,
        flags: common | MATERIAL_MASKED | MATERIAL_EMITS_BEHIND,
        metallic: 0.25,
        alpha: 0.25, // the square of the roughness
        normal_scale: 2.5,
        emission: [2.0, 1.0, 4.0],
        clearcoat: 0.625,
        clearcoat_alpha: 0.5625,
        clearcoat_normal_scale: 3.5,
        transmission_factor: 0.375,
        specular_factor: 0.875,
        specular: [0.0625, 0.125, 0.5], // a quarter, which an index of 3 reflects head on
        eta: [3.0; 3],
        ..Material::default()
    };
    assert_eq!(found, with_pictures_of(&found, numbers));

    let mut bare = with_pictures();
    bare["materials"][0] = json!({
        "alphaMode": "MASK", "pbrMetallicRoughness": { "baseColorTexture": shows(0) }, "normalTexture": shows(2),
        "extensions": {
            "KHR_materials_clearcoat": { "clearcoatFactor": 1.0, "clearcoatNormalTexture": shows(6) },
            "KHR_materials_transmission": {}, "KHR_materials_specular": {}, "KHR_materials_ior": {},
            "KHR_materials_emissive_strength": {}
        }
    });
    let found = load(&bare).materials[0];
    let defaults = Material {
        base_color: [1.0; 3],
        opacity: 1.0,
        alpha_cutoff: 0.5,
        flags: common | MATERIAL_MASKED,
        metallic: 1.0,
        alpha: 1.0,
        normal_scale: 1.0,
        clearcoat: 1.0,
        clearcoat_normal_scale: 1.0,
        specular_factor: 1.0,
        specular: [0.2f32.powi(2); 3], // an index of 1.5
        eta: [1.5; 3],
        ..Material::default()
    };
    assert_eq!(found, with_pictures_of(&found, defaults));

    // As those that came of specular and glossiness have it: all that the colour says is reflected.
    let mut converted = with_pictures();
    converted["materials"][0] = json!({
        "extensions": { "KHR_materials_ior": { "ior": 0 }, "KHR_materials_specular": { "specularColorFactor": [0.9, 0.5, 0.125] } }
    });
    assert_eq!(load(&converted).materials[0].specular, [0.9, 0.5, 0.125]);
}

#[test]
fn pictures_lie_as_samplers_and_references_say() {
    let [nearest, linear, near_mipmaps, clamp, mirror, repeat] = [9728, 9729, 9984, 33071, 33648, 10497];
    let transform = |t: Value| json!({ "extensions": { "KHR_texture_transform": t } });
    let rest = [[1.0, 1.0], [0.0, 0.0], [0.0, 0.0]];
    // What the extension reads at (u, w), with w = 1 - v down: (0.25 + 3 w, 0.5 - 2 u).
    let turned = json!({ "offset": [0.25, 0.5], "rotation": FRAC_PI_2, "scale": [2, 3], "texCoord": 1 });
    let mut second = transform(json!({ "texCoord": 0, "offset": [0.5, 0.25] }));
    second["texCoord"] = json!(1);
    let cases = [
        (json!({}), json!({}), 0, rest),
        (json!({ "wrapS": clamp, "wrapT": mirror }), json!({}), TEXTURE_CLAMP_U | TEXTURE_MIRROR_V, rest),
        (json!({ "wrapS": mirror, "wrapT": repeat }), json!({}), TEXTURE_MIRROR_U, rest),
        (json!({ "wrapT": clamp }), json!({}), TEXTURE_CLAMP_V, rest),
        (json!({ "wrapS": clamp, "wrapT": clamp }), json!({}), TEXTURE_CLAMP, rest),
        (json!({ "magFilter": nearest, "minFilter": linear }), json!({}), TEXTURE_NEAREST, rest),
        (json!({ "minFilter": nearest }), json!({}), TEXTURE_NEAREST, rest),
        (json!({ "magFilter": linear, "minFilter": nearest }), json!({}), 0, rest),
        (json!({ "minFilter": near_mipmaps }), json!({}), 0, rest),
        (json!({}), json!({ "texCoord": 1 }), TEXTURE_SECOND_UV, rest),
        (json!({}), second, 0, [[1.0, 1.0], [0.0, 0.0], [0.5, -0.25]]),
        (json!({}), transform(turned), TEXTURE_SECOND_UV | TEXTURE_SHEARED, [[0.0, 0.0], [-3.0, 2.0], [3.25, 0.5]]),
    ];
    let lies = |sampler: &Value, reference: &Value| {
        let mut json = with_pictures();
        json["samplers"] = json!([{}, sampler]);
        json["textures"][0]["sampler"] = json!(1);
        json["materials"][0]["normalTexture"] = reference.clone();
        json["materials"][0]["normalTexture"]["index"] = json!(0);
        let t = load(&json).textures[0];
        (t.flags, [t.scale, t.shear, t.offset])
    };
    let wrong: Vec<_> = cases
        .iter()
        .map(|(sampler, reference, flags, places)| (sampler, reference, lies(sampler, reference), (*flags, *places)))
        .filter(|(_, _, found, expected)| found != expected)
        .collect();
    assert!(wrong.is_empty(), "sampler, reference, found, expected: {wrong:#?}");
}

#[test]
fn vertices_have_the_colours_and_opacities_of_the_file() {
    let colours = |values: &[f32], kind: &str| {
        let mut json = triangle();
        json["materials"][0]["alphaMode"] = json!("BLEND");
        let accessor = add(&mut json, values, kind);
        json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(accessor);
        let scene: Scene = load(&json).scene;
        let s = &scene.shading[0];
        assert_eq!(s.attributes, ATTRIBUTE_COLORS);
        let words = &scene.texels[s.first as usize..][..6];
        (
            words.iter().flat_map(|w| [w & 0xffff, w >> 16]).collect::<Vec<_>>(),
            scene.materials[0].flags & MATERIAL_MASKED,
        )
    };
    let (found, masked) = colours(&[1.0, 0.0, 0.2, 0.4, 0.0, 0.6, 1.0, 0.8, 0.2, 1.0, 0.0, 0.0], "VEC4");
    let fifth = 13107;
    assert_eq!(found, [5, 0, 1, 2, 0, 3, 5, 4, 1, 5, 0, 0].map(|n| n * fifth));
    assert_eq!(masked, MATERIAL_MASKED);
    let (found, masked) = colours(&[1.0, 0.0, 0.2, 0.0, 0.6, 1.0, 0.2, 1.0, 0.0], "VEC3");
    assert_eq!(found, [5, 0, 1, 5, 0, 3, 5, 5, 1, 5, 0, 5].map(|n| n * fifth));
    assert_eq!(masked, 0);
}
