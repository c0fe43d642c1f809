//! The errors that a caller can tell apart. Each says what failed, where, and what to do about it.
use std::path::{Path, PathBuf};

/// Result of operations that can fail for a reason outside the program.
pub type Result<T> = std::result::Result<T, Error>;

/// Result of what fails with a sentence that says what is wrong, to which the caller adds where.
pub(crate) type Checked<T = ()> = std::result::Result<T, String>;

/// The kinds of errors, distinguished by what can be done about them. [`Error::exit_code`] is the command line's exit code.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An option or a setting out of range, alone or together with another; of [`gpu`](crate::gpu) and of what records also what does not
    /// fit together, such as a range beyond a buffer, what was made on another device, or a call before its time.
    #[error("{0}")]
    Usage(String),
    /// A file that cannot be read, or does not hold what it should.
    #[error("{}{}: {what}", path.display(), place.as_deref().map(|p| format!(", {p}")).unwrap_or_default())]
    Input {
        /// Path of the file that was read.
        path: PathBuf,
        /// Where in the file: a line, a key, a mesh.
        place: Option<String>,
        /// What is wrong and how to mend it.
        what: String,
    },
    /// A scene whose arrays were edited and no longer fit together.
    #[error("the scene's arrays do not fit together: {0}: edit all that an index leads to, or load the scene again")]
    Scene(String),
    /// No Vulkan loader, no usable device, a missing feature, or more than the device's limits let it do. Where a function names this error,
    /// the device may also be lost or out of memory.
    #[error("{0}")]
    Device(String),
    /// The device is out of memory: what was asked for is not there, and what was made before is as it was.
    #[error("{0}")]
    OutOfDeviceMemory(String),
    /// What is asked for takes more memory than the host has free, or the driver found no more of it.
    #[error("{0}")]
    Memory(String),
    /// The device was lost: nothing made on it works any more, and a new one must be opened.
    #[error("{0}")]
    DeviceLost(String),
    /// A file that cannot be written.
    #[error("{}: {what}", path.display())]
    Output {
        /// Path of the file to be written.
        path: PathBuf,
        /// What is wrong and how to mend it.
        what: String,
    },
}

impl Error {
    /// An [`Error::Input`] about the whole of a file.
    pub fn input(path: impl AsRef<Path>, what: impl ToString) -> Self {
        Self::Input { path: path.as_ref().to_owned(), place: None, what: what.to_string() }
    }

    /// An [`Error::Input`] about one place in a file, such as `line 12` or `mesh "floor"`.
    pub fn input_at(path: impl AsRef<Path>, place: impl ToString, what: impl ToString) -> Self {
        Self::Input { path: path.as_ref().to_owned(), place: Some(place.to_string()), what: what.to_string() }
    }

    /// An [`Error::Output`] about a file.
    pub fn output(path: impl AsRef<Path>, what: impl ToString) -> Self {
        Self::Output { path: path.as_ref().to_owned(), what: what.to_string() }
    }

    /// Exit code of the command line: 2 usage, 3 input, 4 device or memory, 5 output.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) => 2,
            Self::Input { .. } | Self::Scene(_) => 3,
            Self::Device(_) | Self::OutOfDeviceMemory(_) | Self::DeviceLost(_) | Self::Memory(_) => 4,
            Self::Output { .. } => 5,
        }
    }
}
