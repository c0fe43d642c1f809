//! The guided filter by summed-area tables, as Bauszat, Eisemann and Magnor (EGSR 2011) have it: kept to be measured
//! against [`super::guided`], whose sums keep their digits. Kernels: `glsl/guided/guided_table_*.comp`.
use super::pack::Packed;
use crate::denoise::filter::{Filter, Planes};
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::layout::{GuidedPush, vec4};
use crate::shaders::{
    guided_table_columns, guided_table_fits, guided_table_models, guided_table_moments, guided_table_result, shared,
};

/// `vec4`s of a record of moments, and of models.
const MOMENTS: u32 = shared::moments::MOMENTS as u32;
const FIT: u32 = shared::linear_model::FIT as u32;

pub struct GuidedTable {
    pack: Packed,
    moments: Kernel<guided_table_moments::Bind<'static>>,
    fits: Kernel<guided_table_fits::Bind<'static>>,
    columns: Kernel<guided_table_columns::Bind<'static>>,
    models: Kernel<guided_table_models::Bind<'static>>,
    result: Kernel<guided_table_result::Bind<'static>>,
    model: [Buffer<vec4>; 4],
    /// Summed along rows, and then down columns too.
    rows: Buffer<vec4>,
    table: Buffer<vec4>,
    radius: u32,
    eps: vec4,
}

impl GuidedTable {
    /// For images of (width, height).
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the tables, 128 bytes per pixel, do not fit.
    pub fn new(gpu: &Gpu, pack: Packed, radius: u32, eps: vec4, size: [u32; 2]) -> Result<Self> {
        let plane = |name| Buffer::new(gpu, name, pack.colour.len(), Location::Device);
        let table =
            |name| Buffer::new(gpu, name, size[0] as usize * size[1] as usize * MOMENTS as usize, Location::Device);
        Ok(Self {
            moments: Kernel::new(gpu, &Default::default())?,
            fits: Kernel::new(gpu, &Default::default())?,
            columns: Kernel::new(gpu, &Default::default())?,
            models: Kernel::new(gpu, &Default::default())?,
            result: Kernel::new(gpu, &Default::default())?,
            model: [plane("slope_r")?, plane("slope_g")?, plane("slope_b")?, plane("value")?],
            rows: table("rows")?,
            table: table("table")?,
            radius,
            eps,
            pack,
        })
    }
}

impl Filter for GuidedTable {
    fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        let ([width, height], radius, eps) = (planes.size, self.radius, self.eps);
        let [slope_r, slope_g, slope_b, value] = &self.model;
        let Packed { colour, channels, .. } = &self.pack;
        let (rows, table, filtered) = (&self.rows, &self.table, &planes.output);
        let push =
            |width| GuidedPush { size: [width, height], first_row: 0, rows: height, radius, eps, ..Default::default() };
        let lines = self.moments.groups([height, 1]);
        let pixels = self.models.groups([width, height]);
        let columns = |record: u32| (push(record * width), self.columns.groups([record * width, 1]));
        self.pack.record(rec, planes)?;

        let bind = guided_table_moments::Bind { colour, channels, table: rows };
        rec.dispatch(&self.moments, bind, &push(width), lines)?;
        let (down, groups) = columns(MOMENTS);
        rec.dispatch(&self.columns, guided_table_columns::Bind { rows, table }, &down, groups)?;
        let bind = guided_table_models::Bind { table, slope_r, slope_g, slope_b, value };
        rec.dispatch(&self.models, bind, &push(width), pixels)?;

        let bind = guided_table_fits::Bind { slope_r, slope_g, slope_b, value, table: rows };
        rec.dispatch(&self.fits, bind, &push(width), self.fits.groups([height, 1]))?;
        let (down, groups) = columns(FIT);
        rec.dispatch(&self.columns, guided_table_columns::Bind { rows, table }, &down, groups)?;
        let bind = guided_table_result::Bind { table, channels, colour, filtered };
        rec.dispatch(&self.result, bind, &push(width), self.result.groups([width, height]))
    }
}
