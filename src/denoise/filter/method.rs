//! What a user can choose to filter an image by.
use super::{FILTERS, Row, none, oidn, readers};
use crate::error::{Error, Result};
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

    /// Whether it leaves the image as it is.
    pub fn is_none(self) -> bool {
        matches!(self, Self::Kernels(row) if row.name == none::ROW.name)
    }

    /// Whether it changes an image whose light was traced for pixels `stride` apart: `none` fills in the others, and does nothing else.
    pub fn changes(self, stride: u32) -> bool {
        !self.is_none() || stride > 1
    }

    /// Whether it is given what the lens blurs, sharp light and textures, too.
    pub(crate) fn weighs_noise(self) -> bool {
        matches!(self, Self::Kernels(row) if row.weighs_noise)
    }

    /// Whether it filters an image but keeps away from it what the lens blurs of sharp light.
    pub fn leaves_noise_of_lens(self) -> bool {
        matches!(self, Self::Kernels(row) if !row.weighs_noise) && !self.is_none()
    }

    /// Whether it reads the setting of this option. What no filter in particular reads is read by all.
    pub fn reads(self, option: &str) -> bool {
        let filters = readers(option);
        filters.is_empty() || filters.contains(&self.name())
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
    /// [`Error::Device`] where Open Image Denoise is chosen but not installed, with how to get it.
    pub fn check(self) -> Result<()> {
        match self {
            Self::Kernels(_) => Ok(()),
            Self::Oidn => Oidn::open().map(drop),
        }
    }

    /// Whether it can filter light that was traced for pixels `stride` apart.
    ///
    /// # Errors
    /// [`Error::Usage`] where it wants the colour whole.
    pub fn check_stride(self, stride: u32) -> Result<()> {
        match self {
            Self::Oidn if stride > 1 => Err(Error::Usage(format!(
                "{}, and oidn wants the colour whole: choose another filter",
                missing_light(stride)
            ))),
            _ => Ok(()),
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

/// What is wrong with light that was traced for pixels `stride` apart, to which callers add the remedy.
pub(crate) fn missing_light(stride: u32) -> String {
    format!("with indirect_stride {stride} most pixels lack indirect light until a filter fills it in")
}
