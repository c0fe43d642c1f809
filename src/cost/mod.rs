//! What accuracy costs in time: a grid of methods is measured on one scene, judged against a reference, and summed up in a
//! [`Document`].
//!
//! ```text
//! grid -> session -> judge -> summary -> findings
//!            ^         ^
//!          scene   reference, given or rendered until it converges
//! ```
mod assemble;
mod candidate;
pub mod changes;
mod converge;
mod curve;
pub mod document;
pub mod filter_only;
pub mod findings;
mod gain;
pub mod grid;
pub mod interval;
pub mod judge;
mod machine;
mod measure;
mod motion;
pub mod others;
mod parts;
mod plan;
mod point;
pub mod reference;
mod rounds;
mod scatter;
mod session;
pub mod summary;
pub mod table;
pub mod words;

pub use assemble::Ended;
pub use document::Document;
pub use measure::measure;
pub use motion::{JudgedFrame, Motion};
pub use plan::{Plan, Watch, key, seeds_of};

use crate::image::Picture;

/// Images beside a [`Document`], for viewers. All have the size of the scene's film.
#[derive(Clone, Debug)]
pub struct Images {
    /// What the errors are measured against.
    pub reference: Picture,
    /// Indices into [`Document::points`], each with that point's image of its first seed. Points that failed have none.
    pub points: Vec<(usize, Picture)>,
}
