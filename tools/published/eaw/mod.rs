//! EAW: Dammertz, Sewtz, Hanika and Lensch, Edge-avoiding À-Trous wavelet transform for fast global illumination filtering, 2010.
mod energy;
mod frame;
mod stride;

pub use energy::measure as energy;
pub use frame::measure as frame;
pub use stride::measure as stride;

use super::view::View;

/// Our scenes and those of the paper's figure 12 that they stand in for: one indirect bounce.
pub const VIEWS: [(View, &str); 4] = [
    (view("cornell", "scenes/cornell-box/scene.toml"), "Box"),
    (view("sponza", "crytek-sponza"), "Sponza"),
    (view("sibenik-lamps", "sibenik-lamps"), "Sibenik"),
    (view("grass", "scenes/grass/scene.toml"), "Outdoor"),
];

const fn view(name: &'static str, scene: &'static str) -> View {
    View { name, scene, size: [256, 256], full: [512, 512], depth: 3, reference: 512 }
}
