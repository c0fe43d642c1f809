//! GEO: Bauszat, Eisemann and Magnor, Adaptive sampling for geometry-aware reconstruction filters, 2011.
mod errors;
mod times;

pub use errors::measure as errors;
pub use times::measure as times;
