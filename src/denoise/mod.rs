//! Filters, and what turns a render into light that they can filter and back.
pub mod composition;
mod denoiser;
pub mod filter;

pub use denoiser::Denoiser;
