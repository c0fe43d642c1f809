//! A shipped scene with panes.
use tallow::layout::{BSDF_METALLIC, MATERIAL_CLEAR_WALL, Material};
use tallow::scene::Loaded;

/// The scene with its first material of coloured glass: of `scenes/grass`, the blades, in the sun.
pub fn glazed(mut scene: Loaded) -> Loaded {
    let first = &mut scene.materials[0];
    let (kind, flags, base_color) = (BSDF_METALLIC, first.flags | MATERIAL_CLEAR_WALL, [0.9, 0.7, 0.4]);
    let pane = Material { kind, flags, base_color, alpha: 0.0, metallic: 0.0, ..*first };
    *first = Material { transmission_factor: 0.8, specular: [0.04; 3], specular_factor: 1.0, ..pane };
    scene
}
