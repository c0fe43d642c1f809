//! The image as it is, without its unusable pixels. Kernel: that of [`super::pack`].
use super::pack::{Pack, Packed};
use super::{Filter, Planes, Row};
use crate::error::Result;
use crate::gpu::Recorder;

/// See [`super::FILTERS`].
pub const ROW: Row = Row {
    name: "none",
    about: "the image as it is; unusable pixels become 0",
    bytes: super::pack::BYTES,
    weighs_noise: false,
    make: |gpu, _, size| Ok(Box::new(None(Pack::new(gpu, size)?))),
    reference: |input, _| Packed::reference(input).iter().map(Packed::output).collect(),
};

struct None(Pack);

impl Filter for None {
    fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        self.0.record(rec, planes)?;
        rec.copy(&self.0.colour, &planes.output)
    }
}
