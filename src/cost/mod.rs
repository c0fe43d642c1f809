//! What accuracy costs in time: a grid of methods is measured on one scene, judged against a reference, and summed up in a
//! [`Document`].
pub mod document;

pub use document::Document;

use crate::image::Picture;

/// Images beside a [`Document`], for viewers. All have the size of the scene's film.
#[derive(Clone, Debug)]
pub struct Images {
    /// What the errors are measured against.
    pub reference: Picture,
    /// Indices into [`Document::points`], each with that point's image of its first seed. Points that failed have none.
    pub points: Vec<(usize, Picture)>,
}
