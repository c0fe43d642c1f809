//! How to embed the renderer, filter what it makes, and place its samples.
#[doc = include_str!("embedding.md")]
pub mod embedding {}
#[doc = include_str!("filtering.md")]
pub mod filtering {}
#[doc = include_str!("placing.md")]
pub mod placing {}
