//! What a user can choose to filter an image by.
use super::{FILTERS, Row, cannot_fill, oidn};
use crate::error::Result;
use crate::gpu::Oidn;

/// What filters an image: kernels of the renderer's device, or a library of the host.
#[derive(Clone, Copy)]
pub enum Method {
    /// A row of [`FILTERS`].
    Kernels(&'static Row),
    /// Open Image Denoise, which is loaded where it is installed. It takes the colour whole, and no engine's frame.
    Oidn,
}

impl Method {
    /// All of them, in the order of `--help`.
    pub fn all() -> impl Iterator<Item = Self> {
        FILTERS.iter().map(|row| Self::Kernels(row)).chain([Self::Oidn])
    }

    /// What a user types.
    pub fn name(self) -> &'static str {
        match self {
            Self::Kernels(row) => row.name,
            Self::Oidn => "oidn",
        }
    }

    /// One line of help.
    pub fn about(self) -> &'static str {
        match self {
            Self::Kernels(row) => row.about,
            Self::Oidn => {
                "Open Image Denoise, where it is installed: a neural network, on the processor, for the whole colour"
            }
        }
    }

    /// To be asked before long work: whether it can run here.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] where Open Image Denoise is chosen but not installed, with how to get it.
    pub fn check(self) -> Result<()> {
        match self {
            Self::Kernels(_) => Ok(()),
            Self::Oidn => Oidn::open().map(drop),
        }
    }

    /// As [`Row::check_filling`].
    ///
    /// # Errors
    /// [`crate::error::Error::Usage`].
    pub fn check_filling(self, stride: u32) -> Result<()> {
        match self {
            Self::Kernels(row) => row.check_filling(stride),
            Self::Oidn => cannot_fill(self.name(), stride),
        }
    }

    /// Device memory that a pixel takes, beside the [`super::Planes`].
    pub(crate) fn device_bytes(self) -> u64 {
        match self {
            Self::Kernels(row) => row.bytes,
            Self::Oidn => 0,
        }
    }

    /// Host memory that a pixel takes.
    pub(crate) fn host_bytes(self) -> u64 {
        match self {
            Self::Kernels(_) => 0,
            Self::Oidn => oidn::HOST_BYTES,
        }
    }
}

impl From<&'static Row> for Method {
    fn from(row: &'static Row) -> Self {
        Self::Kernels(row)
    }
}
